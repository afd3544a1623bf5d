"""Footprints that lie beside their roofs: found and moved where points show it, left alone where
they do not.
"""

import numpy as np
import pytest
import shapely

from hiproof import reconstruct
from hiproof.city.plan.work_plan import AROUND_M as PLANNED_AROUND_M
from hiproof.fit.align import AROUND_M, find_shift
from hiproof.settings import Settings
from points_of_roofs import scatter

L_SHAPE = shapely.Polygon([(0, 0), (16, 0), (16, 8), (7, 8), (7, 14), (0, 14)])
OFF = Settings.from_dict({"reconstruct": {"align": "off"}})


def points_in(outline, density=5.0, seed=0, noise_m=0.05):
    """Points (n, 3) of a gable over the outline's box, spread by chance over the outline."""
    rng = np.random.default_rng(seed)
    xy, (_, y0, _, y1) = scatter(outline, rng, density), outline.bounds
    z = 8.0 - 0.6 * np.abs(xy[:, 1] - 0.5 * (y0 + y1))
    return np.column_stack([xy + rng.normal(0.0, noise_m, xy.shape), z])


def move(outline, shift):
    return shapely.transform(outline, lambda c: c + shift)


@pytest.mark.parametrize("distance", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("angle", [0.3, 2.0, 4.4])
def test_the_shift_is_found(distance, angle):
    shift = distance * np.array([np.cos(angle), np.sin(angle)])
    result = find_shift(points_in(L_SHAPE)[:, :2], move(L_SHAPE, -shift))
    assert result.is_clear
    assert np.hypot(*(result.xy - shift)) < 0.1
    assert (np.abs(result.xy - shift) < 4 * result.sigma).all()


def test_a_footprint_in_its_place_stays():
    for seed in range(5):
        assert not find_shift(points_in(L_SHAPE, seed=seed)[:, :2], L_SHAPE).is_clear


def test_a_house_in_a_row_is_not_moved_along_the_row():
    row = points_in(shapely.box(-20, 0, 26, 9))
    result = find_shift(row[:, :2], shapely.box(0.8, 0, 6.8, 9))
    assert not result.is_clear


def test_points_cut_off_at_the_footprint_tell_nothing():
    footprint = move(L_SHAPE, (1.0, 0.5))
    points = points_in(L_SHAPE)
    inside = points[shapely.contains_xy(footprint, points[:, 0], points[:, 1])]
    assert not find_shift(inside[:, :2], footprint).is_clear


@pytest.mark.parametrize("reach", [0.4, -0.4])
def test_a_roof_larger_or_smaller_than_its_footprint_is_no_shift_and_is_said(reach):
    result = find_shift(points_in(L_SHAPE)[:, :2], L_SHAPE.buffer(-reach, join_style="mitre"))
    assert not result.is_clear
    assert result.is_size_clear and result.beyond == pytest.approx(reach, abs=0.1)


def test_a_roof_that_reaches_unequally_beyond_its_walls_moves_no_footprint():
    """Such a roof may stand over these walls, whatever its overhangs are."""
    stayed = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        length, width, *reach = *rng.uniform((7, 6), (20, 12)), *rng.uniform(-0.4, 1.2, 4).clip(0)
        roof = shapely.box(-reach[0], -reach[1], length + reach[2], width + reach[3])
        found = find_shift(points_in(roof, seed=seed)[:, :2], shapely.box(0, 0, length, width))
        stayed.append(not found.is_clear)
    assert sum(stayed) >= 19


@pytest.mark.parametrize("count", [0, 1, 19])
def test_few_points_tell_nothing(count):
    assert not find_shift(points_in(L_SHAPE)[:count, :2], L_SHAPE).is_clear


def test_points_in_one_place_tell_nothing():
    assert not find_shift(np.full((200, 2), 0.5), L_SHAPE).is_clear


def test_reconstruct_moves_the_outline_and_keeps_the_footprint():
    house = shapely.box(0, 0, 12, 8)
    points, footprint = points_in(house), move(house, (-1.0, 0.5))
    assert AROUND_M == PLANNED_AROUND_M
    building = reconstruct(points, footprint)
    assert building.shift == (pytest.approx(1.0, abs=0.1), pytest.approx(-0.5, abs=0.1))
    assert building.footprint.equals(footprint)
    outline = shapely.transform(building.roof.outline, building.roof.frame.to_world)
    assert np.hypot(*(np.array(outline.centroid.coords[0]) - house.centroid.coords[0])) < 0.1
    assert "was moved by (" in building.detail


def test_align_off_leaves_it():
    house = shapely.box(0, 0, 12, 8)
    building = reconstruct(points_in(house), move(house, (-1.0, 0.5)), settings=OFF)
    assert building.shift == (0.0, 0.0) and "moved" not in building.detail


@pytest.mark.parametrize("overhang", [0.8, 1.0])
@pytest.mark.parametrize("distance", [0.0, 0.5, 2.0])
def test_a_roof_that_overhangs_all_around_does_not_hide_a_shift_of_more(overhang, distance):
    """One of less may be a roof that reaches farther on one side than on the other."""
    shift = distance * np.array([0.8, 0.6])
    roof = points_in(L_SHAPE.buffer(overhang, join_style="mitre"))[:, :2]
    result = find_shift(roof, move(L_SHAPE, -shift))
    assert np.hypot(*(result.xy - shift)) < 0.1 and result.is_clear == (distance > overhang)
    assert result.is_size_clear and result.beyond == pytest.approx(overhang, abs=0.1)
