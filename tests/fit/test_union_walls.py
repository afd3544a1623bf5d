"""Check that what a scanner sees of walls makes no roof in sparse clouds."""

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from hiproof.fit.layout.plan import FACADE_BORDER_M, find_roof_points, measure_depth, ring_edges
from hiproof.fit.walls import STEEPEST_ROOF, WALL_REACH_SPACINGS
from hiproof.fit.walls import on_walls as found_on_walls
from points_of_roofs import scatter
from union_scenes import OUTLINES


def scan_hip(rng, outline, density, pitch):
    """Return points (n, 3) of a roof that rises from all of the `outline`.

    It has one `pitch`, and eaves 5 m high. Also returns the points' depth (n,).
    """
    xy = scatter(outline, rng, density)
    depth = measure_depth(xy[:, 0].copy(), xy[:, 1].copy(), *ring_edges(outline))
    return np.column_stack([xy, 5.0 + pitch * depth]), depth


def scan_walls(rng, outline, count):
    """Return points (count, 3) of walls, up to 5 cm inside of the outline.

    They are more than a metre below the eaves. Also returns their depth.
    """
    ring = outline.exterior
    positions = shapely.line_interpolate_point(ring, rng.uniform(0.0, ring.length, count))
    xy = shapely.get_coordinates(positions) * 0.995
    depth = measure_depth(xy[:, 0].copy(), xy[:, 1].copy(), *ring_edges(outline))
    return np.column_stack([xy, rng.uniform(0.0, 3.0, count)]), depth


@pytest.mark.parametrize("outline", OUTLINES)
@pytest.mark.parametrize("seed", range(3))
def test_sparse_roofs_keep_every_point_and_lose_those_of_their_walls(outline, seed):
    rng = np.random.default_rng(seed)
    roof, depth = scan_hip(rng, outline, 2.0, rng.uniform(0.0, STEEPEST_ROOF))
    walls, wall_depth = scan_walls(rng, outline, 20)
    assert wall_depth.max() < FACADE_BORDER_M
    nearby = np.abs(walls[:, None, :2] - roof[None, depth >= FACADE_BORDER_M, :2])
    reach = WALL_REACH_SPACINGS * np.sqrt(outline.area / (len(roof) + len(walls)))
    # Far from any roof point a steep roof may be.
    visible = np.hypot(nearby[..., 0], nearby[..., 1]).min(axis=1) < reach

    all_rows = np.vstack([roof, walls])
    n_kept = all_rows[find_roof_points(all_rows, np.concatenate([depth, wall_depth]), outline.area)]
    assert set(map(tuple, roof)) <= set(map(tuple, n_kept))
    assert not set(map(tuple, walls[visible])) & set(map(tuple, n_kept))


def test_walls_are_told_by_what_stands_high_nearby():
    """Against scipy's tree of points."""
    rng = np.random.default_rng(8)
    roof, points = (rng.uniform((0, 0, 5), (9, 7, 9), (n, 3)) for n in (120, 60))
    nearby = cKDTree(roof[:, :2]).query_ball_point(points[:, :2], WALL_REACH_SPACINGS * 0.7)
    drop = STEEPEST_ROOF * WALL_REACH_SPACINGS * 0.7
    is_given = [
        any(roof[k, 2] > point[2] + drop for k in item)
        for point, item in zip(points, nearby, strict=True)
    ]
    assert 0 < sum(is_given) < len(is_given)
    assert found_on_walls(points, roof, 0.7).tolist() == is_given


def test_dense_clouds_lose_all_points_next_to_the_border():
    roof, depth = scan_hip(np.random.default_rng(1), OUTLINES[0], 10.0, 0.5)
    assert np.array_equal(find_roof_points(roof, depth, OUTLINES[0].area), depth >= FACADE_BORDER_M)


def test_too_few_points_lose_none():
    points = np.array([[5.95, 0.0, 3.0], [0.0, 3.95, 0.0], [0.0, 0.0, 5.0]])
    depth = np.array([0.05, 0.05, 4.0])
    assert find_roof_points(points, depth, 96.0).all()
