"""Buildings among trees, at any density; and clouds that hold none."""

import numpy as np
import pytest
import shapely

from hiproof.classify import BUILDING, GROUND_CLASS, UNKNOWN, classify, roof_points
from leafy_scenes import GROUND as GROUND_SOURCE
from leafy_scenes import TREE, drone, forest, make_house_under_tree, town


def f1(prediction, truth):
    return 2 * (prediction & truth).sum() / (prediction.sum() + truth.sum())


@pytest.mark.parametrize(
    ("density", "least_f1"), [(0.5, 0.9), (1.0, 0.93), (5.0, 0.97), (20.0, 0.98)]
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


@pytest.mark.parametrize("seed", range(3))
def test_a_forest_holds_no_building(seed):
    cloud = forest(np.random.default_rng(seed))
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
