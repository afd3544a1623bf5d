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
from hiproof.classify.split import connected_groups, split_buildings
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


@pytest.mark.parametrize("seed", range(6))
def test_groups_are_those_of_a_plain_search_over_all_pairs(seed):
    xy = np.random.default_rng(seed).uniform(0, 30, (120, 2))
    groups = connected_groups(xy, 2.0)
    assert np.array_equal(np.sort(np.concatenate(groups)), np.arange(120))
    group_of = np.empty(120, int)
    for number, group in enumerate(groups):
        group_of[group] = number
    distance = np.hypot(*(xy[:, None] - xy[None]).transpose(2, 0, 1))
    assert (group_of[:, None] == group_of[None])[distance < 0.5].all()  # surely within two cells
    for group in groups:
        remainder = np.setdiff1d(np.arange(120), group)
        assert not len(remainder) or distance[np.ix_(group, remainder)].min() > 0.5


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
    with pytest.raises(
        InputError,
        match="without classes" if classification is None else r"got classes 1 \([\d,]+ points\)",
    ):
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
    with pytest.raises(
        InputError,
        match=r"class 6 .*got classes 2 \([\d,]+ points\), 67 \([\d,]+ points\).*--building-class",
    ):
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


def test_every_exported_name_exists():
    for name in hiproof.read.__all__:
        assert getattr(hiproof.read, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'read_minds'"):
        hiproof.read.read_minds  # noqa: B018


@pytest.mark.skipif(not CTVIEW.is_dir(), reason="needs the shared data folder ctview")
def test_the_ign_tiles_split_into_their_buildings():
    cloud = hiproof.read.read_points(CTVIEW)
    result = split_buildings(cloud, BLOCKS)
    assert cloud.crs.to_epsg() == 2154 and 9 <= len(result) <= 12
    large = [b for b in result if b.area.area > 300]
    assert len(large) == 5 and all(b.area.is_valid for b in result)
