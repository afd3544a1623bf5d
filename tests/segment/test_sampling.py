"""Sampling and arrangement equal slow ones, and the input follows the points."""

import numpy as np
import pytest
from benchmarks.samples import draw_sample

from hiproof.segment.arrange import Layout, arrange
from hiproof.segment.sampling import (
    BALL_FACTOR,
    POINT_FEATURES,
    SURFACE_NEIGHBOURS,
    arrange_cloud,
    thin_to_grid,
)

COUNT, LEVELS, GROUP = 64, (32, 16, 8), 8
LAYOUT = Layout(points=COUNT, levels=LEVELS, neighbours=GROUP)


def some_cloud(seed=0, count=200):
    return centre(draw_sample(np.random.default_rng(seed)).xyz[:count])


def centre(xyz):
    return np.ascontiguousarray(xyz - xyz.mean(axis=0))


def turn(xyz, angle):
    c, s = np.cos(angle), np.sin(angle)
    return xyz @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def compute_distances(a, b):
    return np.sqrt(((a[:, None] - b) ** 2).sum(axis=2))


def slow_farthest_points(xyz, count):
    indices = [int(np.argmax(((xyz - xyz.mean(axis=0)) ** 2).sum(axis=1)))]
    while len(indices) < count:
        indices.append(int(np.argmax(compute_distances(xyz, xyz[indices]).min(axis=1))))
    return indices


def slow_surface(xyz, i):
    """Normal, roughness, convexity and offset over reach of point `i`, by the eigenvectors of its
    neighbours.
    """
    distance = compute_distances(xyz[i : i + 1], xyz)[0]
    nearest = np.argsort(distance)[:SURFACE_NEIGHBOURS]
    mean = xyz[nearest].mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov(xyz[nearest].T, bias=True))
    normal = vectors[:, 0] * (-1 if vectors[2, 0] < 0 else 1)
    return (
        normal,
        np.sqrt(max(values[0], 0)),
        (xyz[i] - mean) @ normal,
        (mean - xyz[i])[:2] / distance[nearest[-1]],
    )


@pytest.mark.parametrize("seed", range(3))
def test_choice_and_surfaces_equal_the_slow_oracle(seed):
    xyz = some_cloud(seed)
    order, features, *_ = arrange_cloud(xyz, COUNT, *LEVELS, GROUP)
    assert order.tolist() == slow_farthest_points(xyz, COUNT)
    for row, i in enumerate(order):
        normal, roughness, convexity, offset = slow_surface(xyz, i)
        features_by_name = dict(zip(POINT_FEATURES, features[row], strict=True))
        assert features_by_name["normal_z"] == pytest.approx(normal[2], abs=1e-5)
        assert features_by_name["roughness"] == pytest.approx(min(roughness / 0.2, 5), abs=1e-4)
        if normal[2] > 1e-6:
            assert features_by_name["convexity"] == pytest.approx(
                np.clip(convexity / 0.2, -5, 5), abs=1e-4
            )
        assert np.hypot(
            features_by_name["offset_x"], features_by_name["offset_y"]
        ) == pytest.approx(np.hypot(*offset), abs=1e-5)


def slow_groups(xyz, centres, sources, count, radius):
    """Sorted distances of the nearest `count` within `radius`, the nearest repeated where there are
    fewer.
    """
    distance = np.sort(
        compute_distances(xyz[np.arange(centres) % len(xyz)], xyz[:sources]), axis=1
    )[:, :count]
    distance = np.pad(distance, ((0, 0), (0, count - distance.shape[1])), constant_values=np.inf)
    return np.where(distance <= radius, distance, distance[:, :1])


@pytest.mark.parametrize("count", [200, 40, 12])
def test_neighbourhoods_equal_the_slow_oracle(count):
    xyz = some_cloud(1, count)
    order, _, groups, radii, ups, weights = arrange_cloud(xyz, COUNT, *LEVELS, GROUP)
    n_points, ordered = len(order), xyz[order]
    for upper_part, level, index, radius in zip(
        (COUNT, *LEVELS), LEVELS, groups, radii, strict=False
    ):
        cover = compute_distances(xyz, ordered[:level]).min(axis=1).max()
        assert radius == pytest.approx(BALL_FACTOR * max(cover, 1e-3), rel=1e-5)
        centres = ordered[np.arange(level) % n_points]
        message = np.sqrt(((ordered[index] - centres[:, None]) ** 2).sum(axis=2))
        expected = slow_groups(
            ordered, level, min(upper_part, n_points), GROUP, BALL_FACTOR * max(cover, 1e-3)
        )
        np.testing.assert_allclose(message, expected, atol=1e-9)
    for target, source, index, weight in (
        (LEVELS[0], LEVELS[2], ups[0], weights[0]),
        (COUNT, LEVELS[0], *ups[1:], weights[1]),
    ):
        distance = slow_groups(ordered, target, min(source, n_points), 3, np.inf)
        np.testing.assert_allclose(
            weight,
            (1 / (distance + 1e-3)) / (1 / (distance + 1e-3)).sum(axis=1)[:, None],
            rtol=1e-4,
        )
        assert index.max() < source


def test_few_points_are_all_chosen_and_repeated():
    xyz = some_cloud(0, 20)
    arrangement = arrange(xyz, LAYOUT)
    assert sorted(arrangement.select[:20].tolist()) == list(range(20)) and arrangement.sampled == 20
    np.testing.assert_array_equal(arrangement.select[20:40], arrangement.select[:20])
    np.testing.assert_array_equal(arrangement.features[20:40], arrangement.features[:20])


def test_thinning_to_a_grid_keeps_the_extent_and_bounds_the_count():
    xyz = np.random.default_rng(0).uniform(0, (40.0, 20.0, 6.0), (20_000, 3))
    thinned = thin_to_grid(xyz, 1000, chunk=3000)
    assert 200 < len(thinned) <= 1000
    assert len(np.unique(thinned)) == len(thinned)
    assert (np.ptp(xyz[thinned], axis=0) > 0.85 * np.ptp(xyz, axis=0)).all()


@pytest.mark.parametrize("shape", [(1, 3), (9, 3), (25, 3), (70, 3), (3000, 3)])
def test_arrangement_has_the_layouts_shapes(shape):
    arranged = arrange(np.random.default_rng(2).uniform(0, 10, shape), LAYOUT)
    assert arranged.features.shape == (64, 11) and np.isfinite(arranged.features).all()
    assert [group.shape for group in arranged.groups] == [(32, 8), (16, 8), (8, 8)]
    assert [
        group.max() < size for group, size in zip(arranged.groups, (64, 32, 16), strict=True)
    ] == [True] * 3
    assert [index.shape for index in arranged.up_indices] == [(32, 3), (64, 3)]
    np.testing.assert_allclose(arranged.up_weights[0].sum(axis=1), 1.0, rtol=1e-5)


def test_a_tilted_plane_has_its_normal_everywhere_and_falls_along_an_axis():
    xy = np.random.default_rng(3).uniform(0, 10, (200, 2))
    features = arrange(np.column_stack([xy, xy @ (0.5, -0.2)]), LAYOUT).features
    level, steep = 1 / np.sqrt(1.29), np.sqrt(0.29 / 1.29)
    np.testing.assert_allclose(features[:, 5], level, atol=1e-6)
    np.testing.assert_allclose(np.abs(features[:, 3:5]).max(axis=1), steep, atol=1e-6)
    np.testing.assert_allclose(np.abs(features[:, 3:5]).min(axis=1), 0.0, atol=1e-6)
    assert features[:, 3:5].sum() > 0 and features[:, 6].max() < 1e-4


@pytest.mark.parametrize("angle", [0.3, 1.9, -2.5, np.pi / 2, np.pi])
def test_features_do_not_change_when_the_points_turn(angle):
    xyz = some_cloud(4, 400)
    old, new = arrange(xyz, LAYOUT), arrange(turn(xyz, angle), LAYOUT)
    np.testing.assert_array_equal(old.select, new.select)
    np.testing.assert_allclose(old.features, new.features, atol=1e-4)


def test_the_first_axis_is_the_long_one():
    rng = np.random.default_rng(6)
    xy = rng.uniform((0, 0), (14, 6), (300, 2))
    gable = np.column_stack([xy, 3 - 0.6 * abs(xy[:, 1] - 3)])
    for angle in (0.0, 0.7, 2.0):
        spread = arrange(turn(gable, angle), LAYOUT).features[:, :2].std(axis=0)
        assert spread[0] > 1.5 * spread[1]


@pytest.mark.parametrize("bad", ["same", "line", "upright", "duplicates"])
def test_degenerate_clouds_give_finite_features(bad):
    xyz = np.zeros((40, 3))
    if bad == "line":
        xyz[:, 0] = np.arange(40)
    if bad == "upright":
        xyz[:, 2] = np.arange(40)
    if bad == "duplicates":
        xyz = np.repeat(np.random.default_rng(5).uniform(0, 5, (4, 3)), 10, axis=0)
    assert np.isfinite(arrange(xyz, LAYOUT).features).all()
