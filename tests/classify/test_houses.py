"""Touching houses are told apart where their roofs say so, and a single house is never cut."""

import numpy as np
import pytest
import shapely

from hiproof.classify.houses import separate_houses
from hiproof.classify.split import split_buildings
from hiproof.model import PointCloud
from hiproof.settings import Settings

RNG = np.random.default_rng(3)
PLACE = np.array([85000.0, 446000.0])
WIDTH, DEPTH = 16.0, 9.0


def block(height, density=6.0, width=WIDTH, depth=DEPTH, seed=0, turn=0.4):
    """Points of a roof of `height(x, y)` over a rectangle, its area, and what takes its plan into
    the world.
    """
    rng = np.random.default_rng(seed)
    xy = rng.uniform([0, 0], [width, depth], (int(density * width * depth), 2))
    z = height(*xy.T) + rng.normal(0.0, 0.03, len(xy))
    cosine, sine = np.cos(turn), np.sin(turn)

    def world(plan):
        return plan @ np.array([[cosine, sine], [-sine, cosine]]) + PLACE

    return (
        np.column_stack([world(xy), z]),
        shapely.transform(shapely.box(0, 0, width, depth), world),
        world,
    )


def gable(x, y):
    return 8.0 - 0.7 * abs(y - DEPTH / 2)


TWO_HOUSES = {
    "a step": lambda x, y: gable(x, y) + np.where(x < 8.6, 0.0, 0.8),
    "another ridge": lambda x, y: np.where(x < 8.6, gable(x, y), 8.0 - 0.7 * abs(y - 7.0)),
    "another direction": lambda x, y: np.where(x < 8.6, gable(x, y), 12.0 - 0.7 * abs(x - 12.3)),
    "a flat one beside": lambda x, y: np.where(x < 8.6, gable(x, y), 4.0),
}
ONE_HOUSE = {
    "gable": gable,
    "hip": lambda x, y: 8.0 - 0.7 * np.maximum(abs(y - DEPTH / 2), abs(x - 8.0) - 3.5),
    "flat": lambda x, y: np.full_like(x, 5.0),
    "valley": lambda x, y: 6.0 + 0.6 * abs(x - 8.0),
    "a chimney's breadth higher": lambda x, y: (
        gable(x, y) + np.where((abs(x - 8) < 1) & (abs(y - 4) < 1), 1.5, 0.0)
    ),
    "a shallow extension": lambda x, y: np.where(y > 3.0, gable(x, y), 3.0),
    "a row of equal houses": gable,
}


@pytest.mark.parametrize("height", TWO_HOUSES.values(), ids=TWO_HOUSES)
def test_houses_that_differ_are_told_apart_at_their_wall(height):
    points, area, world = block(height)
    houses = separate_houses(points, area, 1.0)
    assert len(houses) == 2
    for members in (shapely.box(0, 0, 8.6, DEPTH), shapely.box(8.6, 0, WIDTH, DEPTH)):
        members = shapely.transform(members, world)
        assert (
            max(
                shapely.intersection(members, h).area / shapely.union(members, h).area
                for h in houses
            )
            > 0.93
        )
    assert sum(house.area for house in houses) == pytest.approx(area.area)


@pytest.mark.parametrize("density", [0.5, 6.0, 300.0])
@pytest.mark.parametrize("height", ONE_HOUSE.values(), ids=ONE_HOUSE)
def test_one_house_stays_one(height, density):
    points, area, _ = block(height, density)
    assert separate_houses(points, area, 1.0) == [area]


def test_houses_with_bushes_between_them_are_told_apart_in_any_order_of_points():
    def height(x, y):
        return np.where(abs(x - 8.0) < 1.5, np.random.default_rng(1).uniform(1.0, 4.0, len(x)), 6.0)

    points, area, _ = block(height, density=15.0)
    houses = separate_houses(points, area, 1.0)
    shuffled = separate_houses(RNG.permutation(points), area, 1.0)
    assert len(houses) == 2
    assert all(any(first.equals_exact(other, 1e-6) for other in shuffled) for first in houses)


def test_every_point_of_a_split_cloud_is_one_house_s():
    points, _, _ = block(TWO_HOUSES["a step"])
    cloud = PointCloud(points, np.full(len(points), 6, np.uint8))
    houses = split_buildings(cloud)
    assert len(houses) == 2
    assert np.array_equal(
        np.sort(np.concatenate([house.index for house in houses])), np.arange(len(points))
    )
    assert all(
        shapely.intersects_xy(house.area, *points[house.index, :2].T).all() for house in houses
    )
    assert len(split_buildings(cloud, Settings.from_dict({"read": {"split_houses": False}}))) == 1


@pytest.mark.parametrize(("width", "count"), [(0.8, 2), (3.0, 1)])
def test_a_neck_of_returns_joins_no_houses_but_a_wing_does(width, count):
    area = shapely.union_all(
        [shapely.box(0, 0, 8, 9), shapely.box(10, 0, 18, 9), shapely.box(8, 4, 10, 4 + width)]
    )
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.2, 18, 0.4), np.arange(0.2, 9, 0.4)))
    xy = np.column_stack([x, y])[shapely.contains_xy(area, x, y)]
    houses = separate_houses(np.column_stack([xy, np.full(len(xy), 6.0)]), area, 1.0)
    assert len(houses) == count
    assert sum(house.area for house in houses) == pytest.approx(area.area)


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize(("width", "depth", "density"), [(16.0, 1.5, 1.5), (8.0, 2.0, 1.0)])
def test_a_narrow_roof_of_few_points_is_one_house(width, depth, density, seed):
    """No line has points on both of its sides, so there is nothing to cut."""
    points, area, _ = block(gable, density, width, depth, seed)
    assert len(separate_houses(points, area, 1.0)) == 1
