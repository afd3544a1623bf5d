"""Check welding: a repair is kept if the roof gets cheaper, and outlines stay."""

import numpy as np
import pytest
import shapely

from hiproof.fit.roof import fit_building
from hiproof.model.heights import find_highest


@pytest.mark.parametrize("seed", [0, 1])
def test_long_steps_of_a_hand_on_a_large_level_roof_go(seed):
    rng = np.random.default_rng(seed)
    x, y = rng.random((2, 20 * 24 * 14)) * [[24.0], [14.0]]
    z = 3.0 + 0.08 * (x > 7.2) - 0.08 * (x > 16.8) + rng.normal(0.0, 0.02, len(x))
    fit = fit_building(np.column_stack([x, y, z]), shapely.box(0, 0, 24, 14))
    rows = np.concatenate([piece.planes for part in fit.roof_parts for piece in part.pieces])
    assert np.ptp(rows, axis=0) == pytest.approx(np.zeros(3), abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("lean", "is_lower"), [(0.08, False), (0.15, True), (-0.2, False)])
def test_a_long_step_that_leans_is_one_line(lean, is_lower, seed):
    rng = np.random.default_rng(seed)
    xy = rng.random((8 * 30 * 14, 2)) * [30.0, 14.0]
    beyond = xy[:, 0] - 13.0 - lean * (xy[:, 1] - 7.0)
    z = np.where(beyond > 0.0, 3.0 if is_lower else 9.0, 6.0)
    points = np.column_stack([xy, z + rng.normal(0.0, 0.02, len(xy))])
    fit = fit_building(points, shapely.box(0, 0, 30, 14))
    away = np.abs(beyond) > 0.25
    height, _ = find_highest(fit.roof_parts, xy[away])
    assert np.mean(np.abs(height - z[away]) > 0.1) < 0.005
