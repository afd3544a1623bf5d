"""Check bays: pieces that walls cut off an outline, and level volumes over them."""

import numpy as np
import pytest
import shapely
from shapely import box

from hiproof.fit.roof import fit_building
from points_of_roofs import scatter

HOUSE = box(0, 0, 16, 12)
BUMPS = {
    "beside a wall": box(16, 5, 17.1, 6.4),
    "at a corner": box(16, 0, 17.2, 1.3),
    "a bay window": shapely.Polygon([(16, 4), (17, 4.6), (17, 7), (16, 7.6)]),
    "turned to the south": box(7, -1.1, 8.4, 0),
}


def scan_roof(rng, outline, height, density=5.0):
    """Return points (n, 3) at random over `outline`, on a roof of this `height`."""
    xy = scatter(outline, rng, density)
    return np.column_stack([xy, height(*xy.T) + rng.normal(0.0, 0.02, len(xy))])


def measure_height(fit, x, y):
    return max(float(part.height_at(np.array([[x, y]]))[0]) for part in fit.roof_parts)


@pytest.mark.parametrize("name", BUMPS)
@pytest.mark.parametrize("seed", range(3))
def test_a_small_bay_has_the_height_of_its_own_few_points(name, seed):
    bump = BUMPS[name]
    outline = HOUSE.union(bump)
    rng = np.random.default_rng(seed)
    points = scan_roof(
        rng, outline, lambda x, y: np.where(shapely.contains_xy(bump, x, y), 3.0, 8.0)
    )
    fit = fit_building(points, outline)
    middle = bump.centroid
    assert measure_height(fit, middle.x, middle.y) == pytest.approx(3.0, abs=0.1)
    assert measure_height(fit, 8.0, 6.0) == pytest.approx(8.0, abs=0.1)
    assert len(fit.roof_parts) == 2


@pytest.mark.parametrize("name", BUMPS)
@pytest.mark.parametrize("seed", range(3))
def test_a_bay_under_the_same_roof_is_none(name, seed):
    """Level, or a slope that runs on over it."""
    outline = HOUSE.union(BUMPS[name])
    rng = np.random.default_rng(seed)
    for slope in (0.0, 0.5):
        fit = fit_building(
            scan_roof(rng, outline, lambda x, y, k=slope: 8.0 - k * np.hypot(0, x - 8)), outline
        )
        assert len(fit.roof_parts) == 1


def test_a_bay_too_narrow_for_the_base_has_its_height_all_the_same():
    # half a metre of the lowest roof was left to the base, and then drawn as the slope beside it
    house, strip, right = box(0, 0, 9, 5), box(9, 2.0, 9.45, 5), 0
    outline = house.union(strip)
    for seed in range(20):
        points = scan_roof(
            np.random.default_rng(seed),
            outline,
            lambda x, y: np.where(x > 9, 3.0, 8.0 - 0.7 * np.abs(x - 4.5)),
            density=8.0,
        )
        fit = fit_building(points, outline)
        is_low = abs(measure_height(fit, 9.2, 3.5) - 3.0) < 0.1
        right += is_low and sorted(part.type for part in fit.roof_parts) == ["flat", "gable"]
    assert right >= 13


def test_returns_of_its_walls_are_no_roof_of_a_bay():
    rng, bump = np.random.default_rng(0), BUMPS["beside a wall"]
    outline = HOUSE.union(bump)
    roof = scan_roof(rng, outline, lambda x, y: np.full(len(x), 8.0))
    along = bump.exterior.intersection(outline.exterior).buffer(0.05).intersection(outline)
    walls = scan_roof(rng, along, lambda x, y: rng.uniform(0.0, 7.5, len(x)), density=150.0)
    assert len(walls) > 8
    assert len(fit_building(np.vstack([roof, walls]), outline).roof_parts) == 1
