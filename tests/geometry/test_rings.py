"""Rings: which way they face, and what lies in them."""

import numpy as np
import pytest
import shapely

from hiproof.geometry.point_in_polygon import find_inside, flips
from hiproof.geometry.rings import ring_normal, ring_normals


@pytest.mark.parametrize("seed", range(20))
def test_a_point_is_inside_where_an_odd_number_of_edges_flips(seed):
    """Whatever the rings: also where they cross themselves, as shapely's repair by the even-odd
    rule sees them.
    """
    rng = np.random.default_rng(seed)
    ring = rng.uniform(-5.0, 5.0, (7, 2))
    area = shapely.make_valid(shapely.Polygon(ring))
    for x, y in rng.uniform(-6.0, 6.0, (200, 2)):
        flipped = sum(
            flips(*a, *b, x, y) for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)
        )
        assert bool(flipped % 2) == shapely.contains_xy(area, x, y)


@pytest.mark.parametrize("seed", range(20))
def test_places_inside_an_area_and_on_its_border_are_found(seed):
    """Also with holes, in several polygons, and in none."""
    rng = np.random.default_rng(seed)
    boxes = shapely.box(*rng.integers(0, 4, (2, 3)), *rng.integers(4, 9, (2, 3)))
    area = shapely.difference(shapely.union_all(boxes), shapely.box(3, 3, 5, 5 + seed % 3))
    nodes = np.reshape(np.meshgrid(np.arange(0, 9, 0.5), np.arange(0, 9, 0.5)), (2, -1))
    turned, chance = shapely.affinity.rotate(area, 10.0 * seed), rng.uniform(0, 9, (2, 300))
    many = shapely.segmentize(turned, 0.05)
    cases = (area, nodes), (turned, chance), (many, chance), (shapely.Polygon(), nodes)
    for polygon, (x, y) in cases:
        expected = shapely.intersects_xy(polygon, x, y)
        assert find_inside(polygon, x, y).tolist() == expected.tolist()


def test_a_normal_is_as_long_as_its_ring_is_large_and_turns_with_it():
    rng = np.random.default_rng(0)
    ring = np.column_stack(
        [shapely.get_coordinates(shapely.box(3.0, 4.0, 8.0, 6.0))[:-1], np.full(4, 7.0)]
    )
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    assert ring_normal(ring[::-1]) == pytest.approx(-ring_normal(ring))
    assert ring_normal(ring + 1e6) == pytest.approx(ring_normal(ring), abs=1e-6)
    assert ring_normal(ring @ turn.T) == pytest.approx(turn @ ring_normal(ring))
    assert np.linalg.norm(ring_normal(ring)) == pytest.approx(10.0)


def test_many_normals_are_each_rings_own():
    rng = np.random.default_rng(1)
    rings = [rng.normal(size=(count, 3)) for count in (3, 4, 7, 3)]
    np.testing.assert_allclose(
        ring_normals(rings), [ring_normal(ring) for ring in rings], atol=1e-12
    )
