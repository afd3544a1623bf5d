"""Distances to bounded polygons, against plain Python over each polygon, edge and point."""

import numpy as np
import pytest
import shapely

from hiproof.errors import InputError
from hiproof.evaluate.distance import point_surface_distances, vertical_distances


def plane_basis(ring):
    """Origin and two unit vectors in the plane of a ring (m, 3)."""
    origin = ring.mean(axis=0)
    _, _, rows = np.linalg.svd(ring - origin)
    return origin, rows[0], rows[1], rows[2]


def slow_distance(point, rings):
    """Distance to one polygon: shapely decides about inside in the plane's own coordinates."""
    origin, u, v, normal = plane_basis(rings[0])
    flat = [np.column_stack([(ring - origin) @ u, (ring - origin) @ v]) for ring in rings]
    foot = shapely.Point((point - origin) @ u, (point - origin) @ v)
    in_plane = shapely.Polygon(flat[0], flat[1:]).distance(foot)
    return np.hypot(in_plane, (point - origin) @ normal)


def random_polygon(rng):
    """A star-shaped polygon with a hole in a random plane."""
    angle = np.sort(rng.uniform(0, 2 * np.pi, 7))
    if np.diff(np.append(angle, angle[0] + 2 * np.pi)).max() > np.pi:
        angle = np.linspace(0, 2 * np.pi, 7, endpoint=False)
    radius = rng.uniform(2, 4, 7)
    outer = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    hole = 0.3 * np.array([[1, 0], [0, -1], [-1, 0], [0, 1]])
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    centre = rng.normal(size=3) * 3
    return [np.pad(ring, ((0, 0), (0, 1))) @ q.T + centre for ring in (outer, hole)]


@pytest.mark.parametrize("seed", range(20))
def test_equals_the_slow_oracle(seed):
    rng = np.random.default_rng(seed)
    polygons = [random_polygon(rng) for _ in range(3)]
    points = rng.normal(size=(40, 3)) * 4
    expected = [min(slow_distance(p, rings) for rings in polygons) for p in points]
    np.testing.assert_allclose(point_surface_distances(points, polygons), expected, atol=1e-9)


def test_a_hole_is_outside():
    outer = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]])
    hole = np.array([[4.0, 4, 0], [4, 6, 0], [6, 6, 0], [6, 4, 0]])
    point = np.array([[5.0, 5, 2]])
    assert point_surface_distances(point, [[outer, hole]]) == pytest.approx(np.hypot(1, 2))
    assert vertical_distances(point, [[outer, hole]]) == np.inf
    assert vertical_distances(point, [outer]) == 2


def test_points_on_a_shared_edge_are_covered_once():
    left = np.array([[0.0, 0, 0], [1, 0, 1], [1, 2, 1], [0, 2, 0]])
    right = np.array([[1.0, 0, 1], [2, 0, 0], [2, 2, 0], [1, 2, 1]])
    assert vertical_distances(np.array([[1.0, 1, 1.5]]), [left, right]) == pytest.approx(0.5)


def test_vertical_takes_the_nearest_of_stacked_surfaces_and_no_walls():
    lower_ring = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    wall = np.array([[1.0, 0, 0], [1, 2, 0], [1, 2, 9], [1, 0, 9]])
    points = np.array([[1.0, 1, 1], [1, 1, 4]])
    assert vertical_distances(points, [lower_ring, lower_ring + [0, 0, 5], wall]).tolist() == [1, 1]


def test_without_polygons_nothing_is_near():
    assert point_surface_distances(np.zeros((2, 3)), []).tolist() == [np.inf, np.inf]
    assert point_surface_distances(np.zeros((0, 3)), []).shape == (0,)


def test_a_collapsed_polygon_counts_as_its_edges():
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    assert point_surface_distances(np.array([[1.0, 3, 4]]), [line]) == pytest.approx(5)


@pytest.mark.parametrize("points", [np.zeros((3, 2)), np.zeros(3)])
def test_refuses_points_without_three_columns(points):
    with pytest.raises(InputError, match="shape"):
        point_surface_distances(points, [])


def test_refuses_rings_of_two_vertices():
    with pytest.raises(InputError, match="at least 3 vertices"):
        point_surface_distances(np.zeros((1, 3)), [np.zeros((2, 3))])
