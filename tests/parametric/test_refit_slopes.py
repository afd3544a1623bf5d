"""The roof under the points as a refit sees it, held against the roof itself and against
differences of its heights.
"""

import numpy as np
import pytest

from hiproof.parametric.refit import UNBOUNDED_M, Heights, list_unknowns
from hiproof.simulate import random_compound

STEP = 1e-6


def scene(seed):
    """A compound with one pitch changed, so that parts meet anew, and points about its outline,
    some beside it.
    """
    rng = np.random.default_rng(seed)
    roof = random_compound(rng).roof
    west, south, east, north = roof.outline.bounds
    xy = rng.uniform((west - 1.0, south - 1.0), (east + 1.0, north + 1.0), (400, 2))
    points = np.column_stack([xy, rng.normal(3.0, 2.0, len(xy))])
    return roof, points, list_unknowns(roof.parts, {})


@pytest.mark.parametrize("seed", range(6))
def test_heights_are_the_roofs(seed):
    roof, points, unknowns = scene(seed)
    expected = points[:, 2] - roof.height_at(points[:, :2])
    gaps = Heights(roof.parts, points, unknowns).at(unknowns.start).gaps
    covered = np.isfinite(expected)
    np.testing.assert_allclose(gaps[covered], expected[covered], atol=1e-6)
    assert (np.abs(gaps[~covered]) == UNBOUNDED_M).all()


@pytest.mark.parametrize("seed", range(6))
def test_slopes_are_differences_of_heights_away_from_creases(seed):
    roof, points, unknowns = scene(seed)
    heights, x = Heights(roof.parts, points, unknowns), unknowns.start
    surface = heights.at(x)
    slopes = heights.jacobian(x, surface)
    for column in range(len(x)):
        moved = [heights.at(x + sign * STEP * np.eye(len(x))[column]) for sign in (1.0, -1.0)]
        is_one_plane = np.logical_and.reduce(
            [(m.part == surface.part) & (m.row == surface.row) for m in moved]
        )
        numeric = (moved[1].gaps - moved[0].gaps) / (2.0 * STEP)
        assert is_one_plane.mean() > 0.9
        np.testing.assert_allclose(
            slopes[is_one_plane, column], numeric[is_one_plane], atol=1e-2, rtol=1e-3
        )
