"""Check that a strip over a row of dormers is split at its gaps, and nothing else is."""

import numpy as np
import pytest
import shapely

from hiproof.fit.union.allowed import list_allowed_shapes
from hiproof.fit.union.gaps import split_at_gaps
from hiproof.fit.union.plan import lay_out_plan
from hiproof.fit.union.scene import make_scene
from hiproof.fit.union.volumes import LEVEL, OFFSET0, SLOPE0, U0, V1, make_base
from points_of_roofs import sample_heights

OUTLINE = shapely.box(-12, -5, 12, 5)
ROW = ((-9.0, -6.0), (-5.0, -2.0), (-1.0, 2.0), (3.0, 6.0))  # m: the dormers along the eave


def split_row(dormers):
    """Return the volumes of a monopitch and a strip from the first to the last dormer, split.

    The plan's u is y, its v is -x: the longer side of the outline lies along v.
    """

    def height(x, y):
        z = 4.0 + 0.6 * (y + 5.0)
        for start, end in dormers:
            z = np.where((start < x) & (x < end) & (y < -2.0), np.maximum(z, 6.5), z)
        return z

    points = sample_heights(height, OUTLINE, 6.0, 0.02)
    plan = lay_out_plan(points, OUTLINE)
    scene = make_scene(plan, OUTLINE, [0.0], 3.0, 0.2, list_allowed_shapes(()))
    volumes = np.repeat(make_base(-50.0), 3, axis=0)
    volumes[1, U0 : V1 + 1] = -5.0, 5.0, -12.0, 12.0
    volumes[1, OFFSET0 + LEVEL] = np.inf
    volumes[1, [OFFSET0, SLOPE0]] = 7.0 - plan.frame.origin[2], 0.6
    volumes[2, U0 : V1 + 1] = -5.0, -2.0, -dormers[-1][1], -dormers[0][0]
    volumes[2, OFFSET0 + LEVEL] = 6.5 - plan.frame.origin[2]
    return split_at_gaps(volumes, scene)


@pytest.mark.parametrize("dormers", [ROW, ROW[:2], (ROW[0], ROW[3])])
def test_a_strip_is_split_into_the_dormers_of_its_row(dormers):
    pieces = split_row(dormers)[2:]
    ends = np.sort(-pieces[:, [V1, V1 - 1]], axis=0)
    assert ends == pytest.approx(np.array(dormers), abs=0.45)  # points are 0.4 m apart
    assert pieces[:, U0 + 1] == pytest.approx(np.full(len(dormers), -2.0), abs=0.45)


def test_a_strip_without_a_gap_stays_one():
    (strip,) = split_row(((-9.0, 6.0),))[2:]
    assert (strip[V1 - 1], strip[V1]) == (-6.0, 9.0)


def test_a_gap_that_no_points_show_splits_nothing():
    """A gap of 5 cm lies between points."""
    (strip,) = split_row(((-9.0, -2.0), (-1.95, 6.0)))[2:]
    assert (strip[V1 - 1], strip[V1]) == (-6.0, 9.0)
