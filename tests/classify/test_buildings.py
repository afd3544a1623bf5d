"""Buildings among trees, at any density; and clouds that hold none."""

import numpy as np
import pytest
import shapely

from hiproof.classify import BUILDING, GROUND_CLASS, UNKNOWN, classify, roof_points
from hiproof.classify.cut_out import is_cut_out
from hiproof.classify.ground import bare_points, ground_grid
from hiproof.classify.split import split_buildings
from hiproof.errors import InputError
from hiproof.model import PointCloud
from hiproof.simulate import SOURCES, Defects, ScanSettings, random_building, random_compound, scan
from leafy_scenes import GROUND as GROUND_SOURCE
from leafy_scenes import TREE, drone, forest, make_house_under_tree, town


def f1(prediction, truth):
    return 2 * (prediction & truth).sum() / (prediction.sum() + truth.sum())


@pytest.mark.parametrize(
    ("density", "least_f1"), [(0.5, 0.9), (1.0, 0.93), (5.0, 0.97), (12.0, 0.98)]
)
def test_a_town_is_told_from_its_trees_and_its_ground(density, least_f1):
    cloud, _ = town(density)
    classes, built = classify(cloud.points), ~np.isin(cloud.source, (GROUND_SOURCE, TREE))
    assert f1(classes == BUILDING, built) > least_f1
    assert f1(classes == GROUND_CLASS, cloud.source == GROUND_SOURCE) > 0.99


def test_the_order_of_points_does_not_matter():
    cloud, _ = town(3.0)
    order = np.random.default_rng(0).permutation(len(cloud))
    assert np.array_equal(classify(cloud.points)[order], classify(cloud.points[order]))


def test_a_place_is_the_same_whatever_lies_far_from_it():
    cloud, _ = town(3.0)
    distant_points = cloud.points + (400.0, 0.0, 12.0)
    assert np.array_equal(
        classify(np.concatenate([cloud.points, distant_points]))[: len(cloud)],
        classify(cloud.points),
    )


def test_a_drones_walls_are_the_buildings():
    cloud, _ = drone(np.random.default_rng(0), density=150.0)
    assert f1(classify(cloud.points) == BUILDING, cloud.source != GROUND_SOURCE) > 0.97


def test_a_forest_holds_no_building():
    cloud = forest(np.random.default_rng(0))
    classes = classify(cloud.points)
    assert (classes == BUILDING).sum() < 0.01 * len(cloud)
    assert f1(classes == GROUND_CLASS, cloud.source == GROUND_SOURCE) > 0.98


@pytest.mark.parametrize("slope", [0.0, 1.0, 2.0])
def test_water_and_slopes_steeper_than_roofs_hold_no_building(slope):
    xy = np.random.default_rng(0).uniform(0, 60, (10_000, 2))
    classes = classify(np.column_stack([xy, slope * xy[:, 0]]))
    assert not (classes == BUILDING).any()
    assert (classes == GROUND_CLASS).mean() > 0.9


@pytest.mark.parametrize("count", [0, 1, 2, 3, 5])
def test_a_few_points_are_no_building(count):
    classes = classify(np.random.default_rng(0).random((count, 3)) * 20)
    assert len(classes) == count and np.isin(classes, (GROUND_CLASS, UNKNOWN)).all()


def test_points_in_one_place_are_no_building():
    assert not (classify(np.full((50, 3), 7.0)) == BUILDING).any()


def test_within_an_outline_leaves_are_left_out_and_the_roof_stays():
    cloud, building = make_house_under_tree(np.random.default_rng(2), 0.5)
    is_within = shapely.contains_xy(building.footprint, *cloud.points[:, :2].T)
    points, source = cloud.points[is_within], cloud.source[is_within]
    selection = roof_points(points)
    assert (source == TREE).sum() > 50
    assert selection[source == 0].mean() > 0.95
    assert selection[source == TREE].mean() < 0.15


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
