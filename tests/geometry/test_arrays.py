"""Sorting, copying, cells, components, rings and points found by place, against NumPy's own
functions and plain loops.
"""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hiproof.geometry.arrays import (
    compute_median,
    copy_row,
    copy_rows,
    list_distinct,
    sort_order,
    sort_values,
)
from hiproof.geometry.components import label_components
from hiproof.geometry.grid import cell_range, count_cells, number_cells
from hiproof.geometry.point_grid import PointGrid
from hiproof.geometry.point_in_polygon import flips
from hiproof.geometry.rings import ring_normal, ring_normals
from hiproof.geometry.thin import thin_to_grid, without_repeats
from hiproof.model import Footprint

# few numbers, so that many are equal
NUMBERS = st.sampled_from([-np.inf, -2.5, -1.0, 0.0, 0.5, 1.0, 3.0, np.inf])


@given(values=arrays(float, st.integers(0, 70), elements=NUMBERS))
def test_equal_values_keep_their_order(values):
    assert np.array_equal(sort_order(values), np.argsort(values, kind="stable"))
    assert np.array_equal(sort_values(values), np.sort(values))
    assert np.array_equal(list_distinct(values), np.unique(values))


@given(values=arrays(float, st.integers(1, 70), elements=st.floats(-1e6, 1e6)))
def test_the_median_is_numpys(values):
    assert compute_median(values) == np.median(values)


@pytest.mark.parametrize("n", [0, 1, 3])
def test_rows_beyond_the_copied_ones_stay(n):
    rows, target = np.arange(2.0 * n).reshape(n, 2), np.full((4, 2), 9.0)
    copy_rows(target, rows)
    assert np.array_equal(target[:n], rows) and (target[n:] == 9.0).all()
    row = np.full(4, 9.0)
    copy_row(row, np.arange(float(n)))
    assert np.array_equal(row[:n], np.arange(n)) and (row[n:] == 9.0).all()


WHOLE = st.integers(-(10**8), 10**8).map(float) | st.integers(-2, 2).map(float)


@given(arrays(float, st.tuples(st.integers(0, 30), st.just(2)), elements=WHOLE))
def test_cells_are_numbered_as_numpy_numbers_rows(cells):
    expected, number = np.unique(cells, axis=0, return_inverse=True)
    result, found_number = number_cells(cells)
    assert np.array_equal(result, expected) and np.array_equal(found_number, number.ravel())
    assert count_cells(cells) == len(expected)


def test_the_range_of_cells_holds_all_points():
    xy = np.array([[-0.5, 3.9], [8.0, 4.0]])
    assert cell_range(xy, 4.0) == ((-1, 0), (4, 2))


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
    for point in xyz:
        slow.setdefault((np.floor(point[1] / cell_m), np.floor(point[0] / cell_m)), []).append(
            point
        )
    expected = [
        [*np.mean(members, axis=0)[:2], np.sort([p[2] for p in members])[(len(members) - 1) // 2]]
        for _, members in sorted(slow.items())
    ]
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
            ends = {
                link_start + other - node
                for link_start, other in links
                if node in (link_start, other)
            }
            front |= {end for end in ends if expected[end] < 0}
    assert result.tolist() == expected.tolist()


def test_a_long_chain_in_any_order_is_one_component():
    chain = np.random.default_rng(0).permutation(5000)
    assert not label_components(5000, np.stack([chain[:-1], chain[1:]])).any()


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
