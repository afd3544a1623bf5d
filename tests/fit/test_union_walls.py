"""Laws of what a scanner sees of walls, in clouds of few points: it makes no roof."""

import numpy as np
import pytest
import shapely
from scipy.spatial import cKDTree

from hiproof.fit.union.plan import BORDER_M, off_facades, ring_edges, signed_depth
from hiproof.fit.union.slivers import FEWEST_SEEN, without_specks
from hiproof.fit.union.volumes import V1, roof_heights
from hiproof.fit.walls import STEEPEST_ROOF, WALL_REACH_SPACINGS
from hiproof.fit.walls import on_walls as found_on_walls
from union_scenes import OUTLINES, random_scene, random_volumes


def hip(rng, outline, density, pitch):
    """Points (n, 3) of a roof that rises from all of the `outline` with the same `pitch`, eaves 5 m high; and their depth (n,)."""
    x0, y0, x1, y1 = outline.bounds
    xy = rng.uniform((x0, y0), (x1, y1), (int(density * (x1 - x0) * (y1 - y0)), 2))
    depth = signed_depth(xy[:, 0].copy(), xy[:, 1].copy(), *ring_edges(outline))
    xy, depth = xy[depth >= 0.0], depth[depth >= 0.0]
    return np.column_stack([xy, 5.0 + pitch * depth]), depth


def on_walls(rng, outline, count):
    """Points (count, 3) of walls, up to 5 cm inside of the outline, more than a metre below the eaves; and their depth."""
    ring = outline.exterior
    at = shapely.line_interpolate_point(ring, rng.uniform(0.0, ring.length, count))
    xy = shapely.get_coordinates(at) * 0.995
    depth = signed_depth(xy[:, 0].copy(), xy[:, 1].copy(), *ring_edges(outline))
    return np.column_stack([xy, rng.uniform(0.0, 3.0, count)]), depth


@pytest.mark.parametrize("outline", OUTLINES)
@pytest.mark.parametrize("seed", range(3))
def test_sparse_roofs_keep_every_point_and_lose_those_of_their_walls(outline, seed):
    rng = np.random.default_rng(seed)
    roof, depth = hip(rng, outline, 2.0, rng.uniform(0.0, STEEPEST_ROOF))
    walls, wall_depth = on_walls(rng, outline, 20)
    assert wall_depth.max() < BORDER_M
    near = np.abs(walls[:, None, :2] - roof[None, depth >= BORDER_M, :2])
    reach = WALL_REACH_SPACINGS * np.sqrt(outline.area / (len(roof) + len(walls)))
    seen = np.hypot(near[..., 0], near[..., 1]).min(axis=1) < reach  # far from any roof point a steep roof may be

    every = np.vstack([roof, walls])
    kept = every[off_facades(every, np.concatenate([depth, wall_depth]), outline.area)]
    assert set(map(tuple, roof)) <= set(map(tuple, kept))
    assert not set(map(tuple, walls[seen])) & set(map(tuple, kept))


def test_walls_are_told_by_what_stands_high_nearby():
    """Against scipy's tree of points."""
    rng = np.random.default_rng(8)
    roof, points = (rng.uniform((0, 0, 5), (9, 7, 9), (n, 3)) for n in (120, 60))
    near = cKDTree(roof[:, :2]).query_ball_point(points[:, :2], WALL_REACH_SPACINGS * 0.7)
    drop = STEEPEST_ROOF * WALL_REACH_SPACINGS * 0.7
    told = [any(roof[k, 2] > point[2] + drop for k in own) for point, own in zip(points, near, strict=True)]
    assert 0 < sum(told) < len(told)
    assert found_on_walls(points, roof, 0.7).tolist() == told


def test_dense_clouds_lose_all_points_next_to_the_border():
    roof, depth = hip(np.random.default_rng(1), OUTLINES[0], 10.0, 0.5)
    assert np.array_equal(off_facades(roof, depth, OUTLINES[0].area), depth >= BORDER_M)


def test_too_few_points_lose_none():
    points = np.array([[5.95, 0.0, 3.0], [0.0, 3.95, 0.0], [0.0, 0.0, 5.0]])
    depth = np.array([0.05, 0.05, 4.0])
    assert off_facades(points, depth, 96.0).all()


@pytest.mark.parametrize("seed", range(10))
def test_no_volume_of_several_is_a_speck(seed):
    rng = np.random.default_rng(seed)
    volumes, scene = random_volumes(rng), random_scene(rng)
    left = without_specks(volumes.copy(), scene)
    seen, before = (
        np.bincount(roof_heights(rows, scene.U, scene.V)[1][: scene.n], minlength=len(rows))[1:]
        for rows in (left, volumes)
    )
    assert len(left) == 2 or seen.min() >= FEWEST_SEEN
    if before.min() >= FEWEST_SEEN:
        assert (left == volumes).all()
    else:
        assert len(left) < len(volumes) or len(volumes) == 2
    assert (left[1:, V1] <= volumes[:, V1].max()).all()
