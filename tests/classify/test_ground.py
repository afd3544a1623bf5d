"""The ground filter: houses, pits and trees go, slopes stay, and gaps are filled."""

import numpy as np
import pytest

from hiproof.classify.ground import bare_points, fill_gaps, ground_grid, open_heights


def land(slope=0.0, side=60.0, density=4.0, seed=0):
    """Points (n, 3) of a plane that rises along x by `slope`, and its height at any place."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, side, (int(density * side**2), 2)) + (85000.0, 446000.0)
    rise = lambda at: 3.0 + slope * (at[:, 0] - 85000.0)  # noqa: E731
    return np.column_stack([xy, rise(xy)]), rise


def add_house(xyz, size=(14.0, 9.0), height=6.0):
    offset = np.abs(xyz[:, :2] - xyz[:, :2].mean(axis=0))
    is_house = (offset < np.array(size) / 2).all(axis=1)
    return np.where(is_house[:, None], xyz + (0, 0, height), xyz), is_house


@pytest.mark.parametrize("slope", [0.0, 0.1, 0.3])
def test_a_house_is_taken_away_and_the_ground_under_it_is_that_around(slope):
    xyz, rise = land(slope)
    house, is_house = add_house(xyz)
    difference = ground_grid(house).height_at(house[is_house]) - rise(house[is_house])
    assert np.abs(difference).mean() < 0.15 + slope  # lowest in cells of a metre


@pytest.mark.parametrize("slope", [0.5, 1.0, 2.0])
def test_a_slope_steeper_than_roofs_is_ground_up_to_its_border(slope):
    xyz, rise = land(slope)
    difference = rise(xyz) - ground_grid(xyz).height_at(xyz)
    assert np.quantile(np.abs(difference), 0.99) < 1.0 * slope


def test_a_pit_of_noise_is_no_ground():
    xyz, rise = land()
    pit = np.concatenate([xyz, [[*xyz[:, :2].mean(axis=0), -20.0]]])
    np.testing.assert_allclose(ground_grid(pit).height_at(xyz), rise(xyz), atol=0.01)


@pytest.mark.parametrize("z", [-9999.0, -1e5])
def test_a_height_that_stands_for_none_tilts_no_ground(z):
    house, is_house = add_house(land(0.1)[0])
    pit = np.concatenate([house, [[*(house[:, :2].min(axis=0) + 5.0), z]]])
    np.testing.assert_allclose(
        ground_grid(pit).height_at(house[is_house]),
        ground_grid(house).height_at(house[is_house]),
        atol=0.01,
    )


def test_bare_points_are_those_of_the_ground():
    xyz, _ = add_house(land()[0])
    cells = np.unique(np.floor(xyz[:, :2]), axis=0, return_index=True)[1]
    bare = bare_points(xyz[cells])
    assert 0.8 * len(cells) < len(bare) < len(cells)
    assert (bare[:, 2] == 3.0).all()


def test_an_opening_is_that_of_its_definition():
    rng = np.random.default_rng(0)
    z = rng.random((9, 8))
    z[rng.random(z.shape) < 0.2] = np.nan
    expected = np.full(z.shape, -np.inf)
    for i, j in np.argwhere(np.isfinite(z)):
        window = np.s_[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2]
        expected[window] = np.maximum(expected[window], np.nanmin(z[window]))
    assert np.array_equal(open_heights(z, 1), expected)


def test_nothing_known_is_level_and_what_is_known_stays():
    assert not fill_gaps(np.full((3, 4), np.nan)).any()
    z = np.array([[1.0, np.nan, np.nan], [2.0, np.nan, 5.0]])
    result = fill_gaps(z)
    assert np.array_equal(result[np.isfinite(z)], z[np.isfinite(z)])
    assert (result >= 1).all() and (result <= 5).all()
