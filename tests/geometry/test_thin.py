"""Points put into cells and counted once: against NumPy's own functions and plain loops."""

import numpy as np
import pytest

from hiproof.geometry.thin import rank_in_cells, without_repeats


@pytest.mark.parametrize("points", [0, 1, 7, 3000])
def test_each_point_is_kept_once_in_its_order(points):
    rng = np.random.default_rng(points)
    xyz = np.round(rng.uniform(-2, 2, (points, 3)), 1)
    xyz = np.concatenate([xyz, xyz[: points // 2], xyz])
    first = np.sort(np.unique(xyz, axis=0, return_index=True)[1]) if points else np.zeros(0, int)
    assert np.array_equal(without_repeats(xyz), xyz[first])


def test_a_thousand_equal_points_are_one():
    assert len(without_repeats(np.full((1000, 3), 4.25))) == 1


@pytest.mark.parametrize("spread", [3.0, 1e6], ids=["dense", "scattered"])
@pytest.mark.parametrize("cell_m", [1.0, 2.5])
def test_one_point_a_cell_equals_the_plain_loop(spread, cell_m):
    xyz = np.round(np.random.default_rng(3).uniform(-spread, spread, (400, 3)), 2)
    slow = {}
    for point in xyz:
        slow.setdefault((np.floor(point[1] / cell_m), np.floor(point[0] / cell_m)), []).append(
            point
        )
    expected = [
        [*np.mean(members, axis=0)[:2], np.sort([p[2] for p in members])[(len(members) - 1) // 2]]
        for _, members in sorted(slow.items())
    ]
    assert np.allclose(
        rank_in_cells(xyz, cell_m, lambda counts: (counts - 1) // 2), expected, atol=1e-9
    )
