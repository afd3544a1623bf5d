"""Sampling and arrangement: the compiled paths equal plain NumPy, and the input follows the points."""

import numpy as np
import pytest

from hiproof.segment.arrange import Layout, arrange, canonical_direction, local_surface, rotated
from hiproof.segment.sampling import ball_neighbours, farthest_point_order, thin_to_grid
from hiproof.simulate import training_sample

LAYOUT = Layout(points=64, levels=(32, 16, 8), neighbours=8)


def some_cloud(seed=0):
    return training_sample(np.random.default_rng(seed))[0]


def slow_farthest_points(xyz, count):
    chosen = [int(np.argmax(((xyz - xyz.mean(axis=0)) ** 2).sum(axis=1)))]
    while len(chosen) < count:
        distance = ((xyz[:, None] - xyz[chosen]) ** 2).sum(axis=2).min(axis=1)
        chosen.append(int(np.argmax(distance)))
    return chosen


def test_farthest_points_equal_the_slow_oracle():
    xyz = some_cloud()[:200]
    order, radius = farthest_point_order(xyz, 50)
    assert order.tolist() == slow_farthest_points(xyz, 50)
    covered = np.sqrt(((xyz[:, None] - xyz[order]) ** 2).sum(axis=2).min(axis=1).max())
    assert radius[-1] == pytest.approx(covered)


def test_farthest_points_of_few_points_are_all_of_them():
    order, _ = farthest_point_order(some_cloud()[:20], 64)
    assert sorted(order.tolist()) == list(range(20))


def test_ball_neighbours_equal_the_slow_oracle():
    xyz = some_cloud(1)[:150]
    centres, radius = xyz[:30], 1.5
    index, distance = ball_neighbours(centres, xyz, 8, radius)
    for s, centre in enumerate(centres):
        true = np.sqrt(((xyz - centre) ** 2).sum(axis=1))
        expected = np.sort(true)[:8]
        np.testing.assert_allclose(distance[s], np.where(expected <= radius, expected, expected[0]), atol=1e-12)
        np.testing.assert_allclose(true[index[s]], distance[s], atol=1e-12)


def test_missing_neighbours_repeat_the_nearest():
    sources = np.array([[0.0, 0, 0], [1, 0, 0]])
    index, _ = ball_neighbours(np.array([[5.0, 0, 0]]), sources, 4, 0.1)
    assert index.tolist() == [[1, 1, 1, 1]]


def test_thinning_to_a_grid_keeps_the_extent_and_bounds_the_count():
    xyz = np.random.default_rng(0).uniform(0, (40.0, 20.0, 6.0), (20_000, 3))
    kept = thin_to_grid(xyz, 1000, chunk=3000)
    assert 200 < len(kept) <= 1000
    assert len(np.unique(kept)) == len(kept)
    assert (np.ptp(xyz[kept], axis=0) > 0.85 * np.ptp(xyz, axis=0)).all()


def test_thinning_does_not_depend_on_the_chunk():
    xyz = np.random.default_rng(1).uniform(0, (40.0, 20.0, 6.0), (5_000, 3))
    assert thin_to_grid(xyz, 500, chunk=700).tolist() == thin_to_grid(xyz, 500).tolist()


@pytest.mark.parametrize("shape", [(9, 3), (25, 3), (70, 3), (3000, 3)])
def test_arrangement_has_the_layouts_shapes(shape):
    arranged = arrange(np.random.default_rng(2).uniform(0, 10, shape), LAYOUT)
    assert arranged.features.shape == (64, 11) and np.isfinite(arranged.features).all()
    assert [group.shape for group in arranged.groups] == [(32, 8), (16, 8), (8, 8)]
    assert [group.max() < size for group, size in zip(arranged.groups, (64, 32, 16), strict=True)] == [True] * 3
    assert [index.shape for index in arranged.up_indices] == [(32, 3), (64, 3)]
    np.testing.assert_allclose(arranged.up_weights[0].sum(axis=1), 1.0, rtol=1e-5)


def test_normals_of_a_plane_are_its_normal():
    xy = np.random.default_rng(3).uniform(0, 10, (200, 2))
    surface = local_surface(np.column_stack([xy, xy @ (0.5, -0.2)]))
    normal = np.array([-0.5, 0.2, 1.0]) / np.linalg.norm([-0.5, 0.2, 1.0])
    np.testing.assert_allclose(surface.normals, np.tile(normal, (200, 1)), atol=1e-6)
    assert surface.roughness.max() < 1e-6


@pytest.mark.parametrize("angle", [0.3, 1.9, -2.5])
def test_canonical_direction_turns_with_the_points_modulo_a_quarter(angle):
    xyz = some_cloud(4)
    before = canonical_direction(local_surface(xyz))
    after = canonical_direction(local_surface(rotated(xyz, angle)))
    assert np.exp(4j * (after - before - angle)) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("bad", ["same", "line", "duplicates"])
def test_degenerate_clouds_give_finite_features(bad):
    xyz = np.zeros((40, 3))
    if bad == "line":
        xyz[:, 0] = np.arange(40)
    if bad == "duplicates":
        xyz = np.repeat(np.random.default_rng(5).uniform(0, 5, (4, 3)), 10, axis=0)
    assert np.isfinite(arrange(xyz, LAYOUT).features).all()
