"""Clouds without footprints: as many buildings as were put there, each with all its points and
about its plan.
"""

from pathlib import Path

import numpy as np
import pytest
import shapely

import hiproof.read
from hiproof.classify import buildings
from hiproof.classify.buildings import SquareSearch
from hiproof.classify.cells import plan_density
from hiproof.classify.houses import separate_houses
from hiproof.classify.split import split_buildings
from hiproof.errors import InputError, InputWarning
from hiproof.model import PointCloud
from hiproof.settings import Settings
from leafy_scenes import GROUND, TREE, town

CTVIEW = Path(__file__).parents[3] / "shared" / "data" / "ctview"
L_SHAPE = shapely.Polygon([(0, 0), (20, 0), (20, 8), (9, 8), (9, 18), (0, 18)])


BLOCKS = Settings.from_dict({"read": {"split_houses": False}})


def turn_polygon(polygon, degrees, origin=(85000.0, 446000.0)):
    return shapely.affinity.translate(
        shapely.affinity.rotate(polygon, degrees, origin=(0, 0)), *origin
    )


def points_in(polygon, density, seed=0, z=8.0):
    rng = np.random.default_rng(seed)
    xmin, ymin, xmax, ymax = polygon.bounds
    xy = rng.uniform([xmin, ymin], [xmax, ymax], (int(density * (xmax - xmin) * (ymax - ymin)), 2))
    xy = xy[shapely.contains_xy(polygon, *xy.T)]
    return np.column_stack([xy, np.full(len(xy), z)])


def iou(a, b):
    return a.intersection(b).area / a.union(b).area


def street(density=8.0):
    """Five houses, the second and third sharing a wall, with ground of class 2 around them."""
    houses = [
        turn_polygon(shapely.box(x, 0, x + w, 9), 20)
        for x, w in ((0, 8), (11, 8), (19, 8), (30, 8), (41, 8))
    ]
    roofs = [points_in(house, density, seed, 8.0 + seed) for seed, house in enumerate(houses)]
    ground = points_in(
        turn_polygon(shapely.box(-5, -15, 55, 20), 20) - shapely.union_all(houses), 4, 9, 1.0
    )
    xyz = np.concatenate([*roofs, ground])
    return PointCloud(
        xyz, np.repeat([6, 2], [len(xyz) - len(ground), len(ground)]).astype(np.uint8)
    ), houses


@pytest.mark.parametrize("density", [4.0, 8.0, 25.0])
def test_houses_apart_are_told_apart_and_blocks_stay_together_where_asked(density):
    cloud, houses = street(density)
    results = sorted(split_buildings(cloud, BLOCKS), key=lambda building: building.index[0])
    expected = [houses[0], houses[1].union(houses[2]), houses[3], houses[4]]
    assert len(results) == 4
    for building, house in zip(results, expected, strict=True):
        assert iou(building.area.convex_hull, house.convex_hull) > 0.75
        assert shapely.intersects_xy(building.area, *cloud.xyz[building.index, :2].T).all()
    assert np.array_equal(
        np.sort(np.concatenate([b.index for b in results])),
        np.flatnonzero(cloud.classification == 6),
    )


def test_ids_and_areas_depend_neither_on_order_nor_on_the_other_houses():
    cloud, _ = street()
    order = np.random.default_rng(5).permutation(len(cloud))
    settings = Settings.from_dict({"read": {"split_gap_m": 1.0}})
    whole = {b.id: b.area for b in split_buildings(cloud, settings)}
    shuffled = split_buildings(PointCloud(cloud.xyz[order], cloud.classification[order]), settings)
    assert {b.id for b in shuffled} == set(whole)
    assert all(b.area.equals(whole[b.id]) for b in shuffled)
    east = cloud.xyz[:, 0] > cloud.xyz[:, 0].min() + 28
    part = {
        b.id
        for b in split_buildings(PointCloud(cloud.xyz[east], cloud.classification[east]), settings)
    }
    assert len(part & set(whole)) >= 2


@pytest.mark.parametrize("roofs", ["class", "shape"])
def test_a_box_gives_the_buildings_of_the_whole_cloud_and_searches_no_more(roofs, monkeypatch):
    """Squares as small as a house, so that buildings and rows go over their borders."""
    monkeypatch.setattr(buildings, "WORK_M", 20.0)
    monkeypatch.setattr(buildings, "SQUARE_BORDER_M", 6.0)
    scan, _ = town()
    classes = np.select([scan.source == GROUND, scan.source == TREE], [2, 5], 6).astype(np.uint8)
    cloud = PointCloud(scan.points, classes if roofs == "class" else np.ones_like(classes))
    settings, searched = Settings.from_dict({"read": {"roofs": roofs, "split_gap_m": 1.5}}), set()
    classify_square = SquareSearch.classify_square
    monkeypatch.setattr(
        SquareSearch,
        "classify_square",
        lambda self, square: (searched.add(square), classify_square(self, square))[1],
    )
    whole = {building.id: building for building in split_buildings(cloud, settings)}
    n_squares = len(searched)
    assert len(whole) >= 6
    for middle in [building.area.centroid for building in list(whole.values())[:2]]:
        searched.clear()
        box = middle.buffer(2.0).bounds
        part = {b.id: b for b in split_buildings(cloud, settings, box)}
        inside = {id for id, b in whole.items() if b.area.intersects(shapely.box(*box))}
        assert inside and inside <= set(part) and len(part) < len(whole)
        assert all(np.array_equal(part[id].index, whole[id].index) for id in inside)
        assert all(part[id].area.equals(whole[id].area) for id in inside)
        assert roofs == "class" or len(searched) < n_squares


@pytest.mark.parametrize("classes", [None, 0, 1])
def test_a_small_cloud_without_classes_is_one_building(classes):
    points = points_in(turn_polygon(L_SHAPE, 30), 5)
    classification = None if classes is None else np.full(len(points), classes, np.uint8)
    (building,) = split_buildings(PointCloud(points, classification))
    assert building.is_cut_out and len(building.index) == len(points) and building.area.area > 200


def test_noise_is_no_part_of_the_one_building():
    points = points_in(L_SHAPE, 5)
    classification = np.where(np.arange(len(points)) < 7, 7, 1).astype(np.uint8)
    (building,) = split_buildings(PointCloud(points, classification))
    assert building.index.tolist() == list(range(7, len(points)))


@pytest.mark.parametrize("defect", ["two houses", "wide", "many", "without classes"])
def test_larger_clouds_without_building_class_are_refused(defect):
    box = shapely.box(0, 0, 90, 20) if defect == "wide" else shapely.box(0, 0, 14, 9)
    points = points_in(box, 2000 if defect == "many" else 6)
    if defect == "two houses":
        points = np.concatenate([points, points + [30, 0, 0]])
    classification = None if defect == "without classes" else np.ones(len(points), np.uint8)
    if defect == "without classes":
        points = np.concatenate([points, points + [30, 0, 0]])
    by_class = Settings.from_dict({"read": {"roofs": "class"}})
    sentence = "without classes" if classification is None else r"got classes 1 \([\d,]+ points\)"
    with pytest.raises(InputError, match=sentence):
        split_buildings(PointCloud(points, classification), by_class)


def test_roofs_are_found_by_shape_where_no_class_tells_them():
    cloud, _ = street()
    with pytest.warns(InputWarning, match="no building class"):
        result = split_buildings(PointCloud(cloud.xyz, np.ones(len(cloud), np.uint8)), BLOCKS)
    assert len(result) == 4
    roofs = np.sort(np.concatenate([building.index for building in result]))
    assert np.isin(roofs, np.flatnonzero(cloud.classification == 6)).mean() > 0.99
    only_ground = cloud.xyz[cloud.classification == 2]
    with pytest.raises(InputError, match="none of which lies on a smooth surface"):
        split_buildings(PointCloud(np.concatenate([only_ground, only_ground + [0, 70, 0]])))


def test_the_classes_there_are_named_and_another_may_be_chosen():
    cloud, _ = street()
    other = PointCloud(cloud.xyz, np.where(cloud.classification == 6, 67, 2).astype(np.uint8))
    sentence = r"class 6 .*got classes 2 \([\d,]+ points\), 67 \([\d,]+ points\).*--building-class"
    with pytest.raises(InputError, match=sentence):
        split_buildings(other, Settings.from_dict({"read": {"roofs": "class"}}))
    settings = Settings.from_dict({"read": {"building_classes": [67], "split_houses": False}})
    assert len(split_buildings(other, settings)) == 4


def test_groups_too_small_are_left_out_with_a_warning():
    cloud, _ = street()
    crumbs = np.array([[86000.0, 446000.0, 5.0], [86000.1, 446000.0, 5.0]])
    cloud = PointCloud(
        np.concatenate([cloud.xyz, crumbs]),
        np.append(cloud.classification, [6, 6]).astype(np.uint8),
    )
    with pytest.warns(InputWarning, match="1 group of building points left out"):
        assert len(split_buildings(cloud, BLOCKS)) == 4


def test_density_is_that_of_the_roof_not_of_its_box():
    assert plan_density(points_in(turn_polygon(L_SHAPE, 45), 12.0)) == pytest.approx(12, rel=0.15)
    assert plan_density(points_in(turn_polygon(L_SHAPE, 45), 1.0)) == pytest.approx(1, rel=0.3)


@pytest.mark.skipif(not CTVIEW.is_dir(), reason="needs the shared data folder ctview")
def test_the_ign_tiles_split_into_their_buildings():
    cloud = hiproof.read.read_points(CTVIEW)
    result = split_buildings(cloud, BLOCKS)
    assert cloud.crs.to_epsg() == 2154 and 9 <= len(result) <= 12
    large = [b for b in result if b.area.area > 300]
    assert len(large) == 5 and all(b.area.is_valid for b in result)


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
