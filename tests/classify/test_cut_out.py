"""Roofs cut out along their outlines are told from scenes with their ground, at any density, with
walls and without.
"""

import numpy as np
import pytest

from hiproof.classify.cut_out import find_next_heights, is_cut_out
from hiproof.classify.split import split_buildings
from hiproof.errors import InputError
from hiproof.model import PointCloud
from hiproof.simulate import SOURCES, Defects, ScanSettings, random_building, random_compound, scan
from leafy_scenes import drone, forest

ROOF, GROUND = SOURCES.index("roof"), SOURCES.index("ground")
KINDS = [
    "gable",
    "hip",
    "pyramid",
    "mansard",
    "monopitch",
    "L",
    "T",
    "U",
    "row",
    "two_level",
    "dormered",
]


def scan_building(kind, density, seed=0, origin=(0.0, 0.0, 0.0)):
    rng = np.random.default_rng(seed)
    building = (
        random_compound(rng, kind, origin)
        if kind in KINDS[5:]
        else random_building(rng, kind, origin)
    )
    return scan(building, rng, ScanSettings(density=density, defects=Defects.none(), margin_m=4.0))


@pytest.mark.parametrize("density", [1.5, 5.0, 20.0])
@pytest.mark.parametrize("kind", KINDS)
def test_a_roof_with_its_walls_or_without_is_cut_out_and_one_on_its_ground_is_not(kind, density):
    cloud = scan_building(kind, density)
    assert is_cut_out(cloud.points[cloud.source != GROUND]) is not False
    assert is_cut_out(cloud.points[cloud.source == ROOF]) is not False
    assert is_cut_out(cloud.points) is False


@pytest.mark.parametrize("type", ["gable", "flat"])
def test_a_house_from_a_drone_is_told_from_its_lawn_and_is_one_building_without(type):
    cloud, _ = drone(np.random.default_rng(1), type)
    cut = cloud.points[cloud.source != GROUND]
    assert is_cut_out(cloud.points) is False and len(cut) > 50_000
    (building,) = split_buildings(PointCloud(cut))
    assert building.is_cut_out and len(building.index) == len(cut)


@pytest.mark.parametrize("kind", KINDS[:5])
def test_the_answer_is_that_of_the_points_turned_moved_and_in_another_order(kind):
    cloud = scan_building(kind, 5.0)
    for points, expected in ((cloud.points, False), (cloud.points[cloud.source == ROOF], True)):
        turned = points[:, [1, 0, 2]] * (-1, 1, 1) + (85000.0, 446000.0, 30.0)
        assert (is_cut_out(turned[::-1]) is not False) == expected


def test_a_surface_without_anything_high_may_be_a_roof_or_bare_ground():
    xy = np.random.default_rng(0).uniform(0, 20, (2000, 2))
    assert is_cut_out(np.column_stack([xy, 5 + 0.05 * xy[:, 0]])) is None


def test_woods_are_no_roofs():
    cloud = forest(np.random.default_rng(0), 40.0, 5.0)
    assert is_cut_out(cloud.points) is False


def test_the_next_cell_with_points_is_that_of_a_plain_search():
    rng = np.random.default_rng(0)
    height = np.where(rng.random((9, 7)) < 0.5, -np.inf, rng.normal(size=(9, 7)))
    for axis, way in ((0, 1), (0, -1), (1, 1), (1, -1)):
        result = find_next_heights(height, axis, way)
        for cell in np.ndindex(height.shape):
            outer = [np.add(cell, -way * step * np.eye(2, dtype=int)[axis]) for step in (1, 2)]
            inside_values = [
                height[tuple(c)] for c in outer if (c >= 0).all() and (c < height.shape).all()
            ]
            assert result[cell] == next((z for z in inside_values if np.isfinite(z)), -np.inf)


def test_several_roofs_cut_out_are_a_building_each_with_all_of_their_points():
    clouds = [
        scan_building(kind, 5.0, 3, (40.0 * k, 0.0, 0.0))
        for k, kind in enumerate(("gable", "L", "T"))
    ]
    points = np.concatenate([cloud.points[cloud.source == ROOF] for cloud in clouds])
    result = split_buildings(PointCloud(points))
    assert len(result) == 3 and all(building.is_cut_out for building in result)
    assert sum(len(building.index) for building in result) == len(points)


def test_patches_of_bare_ground_are_no_roofs():
    xy = np.random.default_rng(0).uniform(0, 20, (2000, 2))
    patch = np.column_stack([xy, 0.05 * xy[:, 0]])
    with pytest.raises(InputError, match="none of which lies on a smooth surface"):
        split_buildings(PointCloud(np.concatenate([patch, patch + (70.0, 0.0, 0.0)])))
