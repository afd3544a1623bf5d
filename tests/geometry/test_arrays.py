"""Sorting, copying, cells, components, rings and points found by place, against NumPy's own
functions and plain loops.
"""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hiproof.errors import FitError
from hiproof.geometry.alpha_shape import alpha_shape
from hiproof.geometry.arrays import list_distinct, sort_order, sort_values
from hiproof.geometry.components import label_components
from hiproof.geometry.grid import count_cells, number_cells
from hiproof.geometry.point_grid import PointGrid
from hiproof.geometry.point_in_polygon import flips
from hiproof.geometry.rings import ring_normal
from hiproof.geometry.thin import thin_to_grid, without_repeats

# few numbers, so that many are equal
NUMBERS = st.sampled_from([-np.inf, -2.5, -1.0, 0.0, 0.5, 1.0, 3.0, np.inf])


@given(values=arrays(float, st.integers(0, 70), elements=NUMBERS))
def test_equal_values_keep_their_order(values):
    assert np.array_equal(sort_order(values), np.argsort(values, kind="stable"))
    assert np.array_equal(sort_values(values), np.sort(values))
    assert np.array_equal(list_distinct(values), np.unique(values))


WHOLE = st.integers(-(10**8), 10**8).map(float) | st.integers(-2, 2).map(float)


@given(arrays(float, st.tuples(st.integers(0, 30), st.just(2)), elements=WHOLE))
def test_cells_are_numbered_as_numpy_numbers_rows(cells):
    expected, number = np.unique(cells, axis=0, return_inverse=True)
    result, found_number = number_cells(cells)
    assert np.array_equal(result, expected) and np.array_equal(found_number, number.ravel())
    assert count_cells(cells) == len(expected)


@pytest.mark.parametrize("points", [0, 1, 7, 3000])
def test_each_point_is_kept_once_in_its_order(points):
    rng = np.random.default_rng(points)
    xyz = np.round(rng.uniform(-2, 2, (points, 3)), 1)
    xyz = np.concatenate([xyz, xyz[: points // 2], xyz])
    first = np.sort(np.unique(xyz, axis=0, return_index=True)[1]) if points else np.zeros(0, int)
    assert np.array_equal(without_repeats(xyz), xyz[first])


@pytest.mark.parametrize("spread", [3.0, 1e6], ids=["dense", "scattered"])
@pytest.mark.parametrize("cell_m", [1.0, 2.5])
def test_one_point_a_cell_equals_the_plain_loop(spread, cell_m):
    xyz = np.round(np.random.default_rng(3).uniform(-spread, spread, (400, 3)), 2)
    slow = {}
    for x, y, z in xyz:
        slow.setdefault((np.floor(y / cell_m), np.floor(x / cell_m)), []).append((x, y, z))
    cells = [np.array(members) for _, members in sorted(slow.items())]
    expected = [[*c[:, :2].mean(axis=0), np.sort(c[:, 2])[(len(c) - 1) // 2]] for c in cells]
    assert np.allclose(thin_to_grid(xyz, cell_m), expected, atol=1e-9)


MOST = 12


@given(st.lists(st.tuples(st.integers(0, MOST - 1), st.integers(0, MOST - 1)), max_size=20))
def test_components_are_those_of_a_graph_search(links):
    result = label_components(MOST, np.array(links, np.int64).reshape(-1, 2).T)
    expected = np.full(MOST, -1)
    for member in range(MOST):
        if expected[member] >= 0:
            continue
        number, front = expected.max() + 1, {member}
        while front:
            node = front.pop()
            expected[node] = number
            ends = {a + b - node for a, b in links if node in (a, b)}
            front |= {end for end in ends if expected[end] < 0}
    assert result.tolist() == expected.tolist()


def some_footprints(seed, count=12):
    rng = np.random.default_rng(seed)
    places = [rng.uniform(0, 9, (7, 2)) + rng.uniform(-10, 80, 2) for _ in range(count)]
    holed = shapely.difference(shapely.box(20, 20, 50, 45), shapely.box(30, 30, 40, 40))
    return [*(shapely.MultiPoint(xy).convex_hull for xy in places), holed, shapely.Polygon()]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("offset", [0.0, 1e7])
def test_the_grid_finds_what_a_plain_test_of_every_point_finds(seed, offset):
    xyz = np.random.default_rng(seed).uniform([0, 0, 0], [70, 60, 9], (3000, 3))
    xyz[:, :2] += offset
    grid = PointGrid(xyz)
    for footprint in some_footprints(seed):
        polygon = shapely.transform(footprint, lambda xy: xy + offset)
        inside = np.flatnonzero(shapely.intersects_xy(polygon, *xyz[:, :2].T))
        assert np.array_equal(grid.inside(polygon), inside)
        distance = shapely.distance(polygon, shapely.points(xyz[:, :2]))
        is_near = np.zeros(len(xyz), bool)
        is_near[grid.find_within(polygon, 3.0)] = True
        assert is_near[distance < 2.9].all() and not is_near[distance > 3.0].any()


def test_no_points_and_no_polygon_find_nothing():
    square, nothing = shapely.box(0, 0, 1, 1), shapely.Polygon()
    for xyz, counts in ((np.empty((0, 3)), [0, 0]), (np.ones((4, 3)) * 0.5, [4, 0])):
        assert [len(PointGrid(xyz).inside(polygon)) for polygon in (square, nothing)] == counts
    assert len(PointGrid(np.ones((4, 2))).inside(shapely.box(1e6, 1e6, 1e6 + 1, 1e6 + 1))) == 0


@pytest.mark.parametrize("seed", range(20))
def test_a_point_is_inside_where_an_odd_number_of_edges_flips(seed):
    """Whatever the rings: also where they cross themselves, as shapely's repair by the even-odd
    rule sees them.
    """
    rng = np.random.default_rng(seed)
    ring = rng.uniform(-5.0, 5.0, (7, 2))
    area, ends = shapely.make_valid(shapely.Polygon(ring)), np.roll(ring, -1, axis=0)
    for x, y in rng.uniform(-6.0, 6.0, (200, 2)):
        flipped = sum(flips(*a, *b, x, y) for a, b in zip(ring, ends, strict=True))
        assert bool(flipped % 2) == shapely.contains_xy(area, x, y)


def test_a_normal_is_as_long_as_its_ring_is_large_and_turns_with_it():
    corners = shapely.get_coordinates(shapely.box(3.0, 4.0, 8.0, 6.0))[:-1]
    ring = np.column_stack([corners, np.full(4, 7.0)])
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    assert ring_normal(ring[::-1]) == pytest.approx(-ring_normal(ring))
    assert ring_normal(ring + 1e6) == pytest.approx(ring_normal(ring), abs=1e-6)
    assert ring_normal(ring @ turn.T) == pytest.approx(turn @ ring_normal(ring))
    assert np.linalg.norm(ring_normal(ring)) == pytest.approx(10.0)


def slow_alpha_area(xy, radius):
    """Area of the Delaunay triangles whose circumcircle, drawn through their corners, is smaller
    than `radius`.
    """
    area = 0.0
    for triangle in shapely.get_parts(shapely.delaunay_triangles(shapely.MultiPoint(xy))):
        corners = np.array(triangle.exterior.coords)[:3]
        system = 2 * (corners[1:] - corners[0])
        centre = np.linalg.solve(system, (corners[1:] ** 2).sum(1) - (corners[0] ** 2).sum())
        if np.linalg.norm(centre - corners[0]) < radius:
            area += triangle.area
    return area


@pytest.mark.parametrize("seed", range(5))
def test_equals_the_slow_oracle(seed):
    xy = np.random.default_rng(seed).uniform(0, 10, (200, 2))
    shape = alpha_shape(xy, 2.0)
    assert shape.area == pytest.approx(slow_alpha_area(xy, 2.0), rel=1e-9)


def test_the_larger_of_two_houses():
    rng = np.random.default_rng(0)
    xy = np.concatenate([rng.uniform(0, 10, (300, 2)), rng.uniform(20, 24, (80, 2))])
    assert 80 < alpha_shape(xy, 2.0).area < 100


@pytest.mark.parametrize(
    "xy",
    [np.zeros((1, 2)), np.zeros((5, 2)), np.ones((2, 1)) * [[1.0, 2]], np.full((4, 2), np.nan)],
)
def test_points_without_area_are_refused(xy):
    with pytest.raises(FitError, match="span an area"):
        alpha_shape(xy)


def test_a_radius_below_every_spacing_is_refused():
    with pytest.raises(FitError, match="larger"):
        alpha_shape(np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]]), 0.01)


@pytest.mark.parametrize("seed", range(4))
def test_the_shape_is_the_same_far_from_the_origin(seed):
    """At a national grid's coordinates, where doubles have steps of a nanometre."""
    xy = np.random.default_rng(seed).uniform(0.0, 12.0, (600, 2)).round(3)
    distant_origin = np.array([390_123.0, 5_656_789.0])
    first = alpha_shape(xy)
    second = shapely.transform(alpha_shape(xy + distant_origin), lambda c: c - distant_origin)
    assert second.area == pytest.approx(first.area, rel=1e-6)
    assert second.hausdorff_distance(first) < 1e-6


@pytest.mark.parametrize("holes", [True, False])
def test_a_court_is_kept_or_filled(holes):
    axis = np.arange(0, 10.1, 0.5)
    xy = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    shape = alpha_shape(xy[np.abs(xy - 5.0).max(axis=1) > 2.4], 1.0, holes=holes)
    assert len(shape.interiors) == holes
    # corners of the court are rounded off
    assert shape.area == pytest.approx(100 - 25 * holes, abs=2.5)
