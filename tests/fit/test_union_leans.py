"""Check planes that face walls which are not quite along the axes."""

import math

import numpy as np
import pytest
import shapely

from hiproof.fit.layout.scene import MOST_WALL_LEAN, find_leans
from hiproof.fit.roof import fit_building
from hiproof.model import Roof
from points_of_roofs import scatter
from roof_zoo import FRAME


def make_wedge(skew):
    """Make a plan 12 m long whose long walls converge by `skew` (tangent each).

    They are 8 m apart on the left.
    """
    return shapely.Polygon([(0, -4), (12, -4 + 12 * skew), (12, 4 - 12 * skew), (0, 4)])


def scan_wedge(skew, pitch, rng, density=6.0):
    """Return points of a gable over it, each slope square to its wall.

    The eaves are 5 m high, the noise is 2 cm.
    """
    outline = make_wedge(skew)
    xy = scatter(outline, rng, density)
    inwards = [(s * xy[:, 1] + 4 - skew * xy[:, 0]) / math.hypot(1.0, skew) for s in (1.0, -1.0)]
    z = 5.0 + pitch * np.minimum(*inwards)
    return outline, np.column_stack([xy, z + rng.normal(0.0, 0.02, len(xy))]), z


@pytest.mark.parametrize("skew", [0.0, 0.05, 0.1, 0.18])
@pytest.mark.parametrize("pitch", [0.6, 1.2])
def test_a_gable_over_walls_that_run_together_is_one_part(skew, pitch):
    outline, points, z = scan_wedge(skew, pitch, np.random.default_rng(4))
    fit = fit_building(points, outline)
    assert len(fit.roof_parts) == 1
    roof = Roof(fit.roof_parts, outline, FRAME)
    inner = shapely.contains_xy(outline.buffer(-0.2), *points[:, :2].T)
    assert np.abs(roof.height_at(points[inner, :2]) - z[inner]).max() < 0.15


def test_slopes_that_face_neither_wall_nor_each_other_are_one_gable():
    outline = shapely.Polygon([(-6, -7), (6, -6), (7.5, 7.5), (-6.8, 6.5)])
    rng = np.random.default_rng(2)
    xy = rng.uniform(-8, 8, (2000, 2))
    xy = xy[shapely.contains_xy(outline, *xy.T)]
    facing = [np.radians(5.0), np.radians(180.0 - 2.5)]
    z = 9.0 - 0.5 * np.max([xy @ (math.cos(angle), math.sin(angle)) for angle in facing], axis=0)
    fit = fit_building(np.column_stack([xy, z + rng.normal(0.0, 0.02, len(xy))]), outline)
    assert len(fit.roof_parts) == 1
    inner = shapely.contains_xy(outline.buffer(-0.3), *xy.T)
    assert np.abs(Roof(fit.roof_parts, outline, FRAME).height_at(xy[inner]) - z[inner]).max() < 0.15


def test_walls_are_those_near_an_axis_but_not_along_it():
    ring = np.array([(0, 0), (10, 0), (9, 8), (4, 8.2), (1, 8)], float)
    assert find_leans(ring, 0) == pytest.approx([1 / 8, -1 / 8], abs=1e-9) or find_leans(
        ring, 0
    ) == pytest.approx([-1 / 8, 1 / 8], abs=1e-9)
    assert find_leans(ring, 1) == pytest.approx([-0.2 / 5, 0.2 / 3], abs=1e-9)
    assert find_leans(np.array([(0, 0), (5, 0), (5, 4), (0, 4)], float), 0) == []
    assert (
        find_leans(np.array([(0, 0), (8, 0), (8 - 4 * 2 * MOST_WALL_LEAN, 4), (0, 4)], float), 0)
        == []
    )
