"""Points found through the grid are exactly those a point-by-point test finds."""

import numpy as np
import pytest
import shapely

from hiproof.geometry.point_grid import PointGrid
from hiproof.model import Footprint


def some_footprints(seed, count=12):
    rng = np.random.default_rng(seed)
    hulls = [
        shapely.MultiPoint(rng.uniform(0, 9, (7, 2)) + rng.uniform(-10, 80, 2)).convex_hull
        for _ in range(count)
    ]
    holed = shapely.difference(shapely.box(20, 20, 50, 45), shapely.box(30, 30, 40, 40))
    return [
        Footprint(str(i), polygon) for i, polygon in enumerate([*hulls, holed, shapely.Polygon()])
    ]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("offset", [0.0, 1e7])
def test_the_grid_finds_what_a_plain_test_of_every_point_finds(seed, offset):
    footprints = some_footprints(seed)
    xyz = np.random.default_rng(seed).uniform([0, 0, 0], [70, 60, 9], (3000, 3)) + [
        offset,
        offset,
        0,
    ]
    footprints = [
        Footprint(f.id, shapely.transform(f.polygon, lambda xy: xy + offset)) for f in footprints
    ]
    grid = PointGrid(xyz)
    for footprint in footprints:
        assert np.array_equal(
            grid.inside(footprint.polygon),
            np.flatnonzero(shapely.intersects_xy(footprint.polygon, xyz[:, 0], xyz[:, 1])),
        )
    for footprint in footprints:
        result = grid.find_within(footprint.polygon, 3.0)
        distance = shapely.distance(footprint.polygon, shapely.points(xyz[:, :2]))
        is_near = np.zeros(len(xyz), bool)
        is_near[result] = True
        assert is_near[distance < 2.9].all() and not is_near[distance > 3.0].any()


def test_neighbours_do_not_take_points_from_each_other():
    xy = np.array([[0.5, 0.5], [1.5, 0.5]])
    grid = PointGrid(xy)
    assert grid.inside(shapely.box(0, 0, 2, 1)).tolist() == [0, 1]
    assert grid.inside(shapely.box(1, 0, 3, 1)).tolist() == [1]


def test_no_points_and_no_polygon_find_nothing():
    square, nothing = shapely.box(0, 0, 1, 1), shapely.Polygon()
    for xyz, counts in ((np.empty((0, 3)), [0, 0]), (np.ones((4, 3)) * 0.5, [4, 0])):
        assert [len(PointGrid(xyz).inside(polygon)) for polygon in (square, nothing)] == counts
    assert len(PointGrid(np.ones((4, 2))).inside(shapely.box(1e6, 1e6, 1e6 + 1, 1e6 + 1))) == 0
