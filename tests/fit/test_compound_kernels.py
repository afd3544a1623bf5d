"""The compiled kernels against slow oracles in plain Python."""

import numpy as np
import pytest

from hiproof.fit.compound.kernels import (
    NEIGHBOUR_RADIUS_M,
    Cloud,
    Ghosts,
    Grid,
    best_rectangle,
    distinct,
    gain_by_point,
    neighbours_of,
    reach_of_rows,
    truncated,
)
from hiproof.fit.compound.layout import (
    add_holder,
    complexity,
    empty_layout,
    evaluate,
    known_objective,
    objective,
    single_plane_layout,
)
from hiproof.fit.compound.partition import grow_tree, may_pay, partition_costs
from hiproof.fit.compound.plan import grid_lines, signed_depth
from hiproof.fit.compound.polish import polish


def brute_rectangle(gain):
    nu, nv = gain.shape
    return max(
        gain[a:b, c:d].sum()
        for a in range(nu)
        for b in range(a + 1, nu + 1)
        for c in range(nv)
        for d in range(c + 1, nv + 1)
    )


def found_rectangle(gain, least):
    reach = np.empty(len(gain) + 1)
    reach_of_rows(gain, reach)
    return best_rectangle(gain, least, reach, np.empty(gain.shape[1]))


@pytest.mark.parametrize("seed", range(8))
def test_best_rectangle_is_that_of_brute_force(seed):
    gain = np.random.default_rng(seed).normal(-0.1, 1.0, (1 + seed % 5, 6))
    score, i0, i1, j0, j1 = found_rectangle(gain, -np.inf)
    assert score == pytest.approx(brute_rectangle(gain))
    assert gain[i0:i1, j0:j1].sum() == pytest.approx(score)


@pytest.mark.parametrize("seed", range(8))
def test_a_rectangle_is_found_only_above_what_is_asked(seed):
    gain = np.random.default_rng(seed).normal(-0.1, 1.0, (5, 6))
    best = brute_rectangle(gain)
    assert found_rectangle(gain, best - 1e-9)[0] == pytest.approx(best)
    score, i0, i1, j0, j1 = found_rectangle(gain, best + 1e-9)
    assert score == best + 1e-9
    assert (i1 - i0) * (j1 - j0) == 0


@pytest.mark.parametrize("seed", range(4))
def test_no_rectangle_reaches_beyond_its_rows(seed):
    gain = np.random.default_rng(seed).normal(-0.3, 1.0, (4, 5))
    reach = np.empty(5)
    reach_of_rows(gain, reach)
    for first in range(4):
        assert brute_rectangle(gain[first:]) <= reach[first] + 1e-12


@pytest.mark.parametrize("n", [1, 6, 200])
def test_neighbours_are_those_of_sorting_all_distances(n):
    u, v = np.random.default_rng(n).uniform(0.0, 8.0, (2, n))
    cell = np.zeros(n, np.int64)
    near, nearest = np.empty(n, np.int64), np.empty(17, np.int64)
    count, kept = neighbours_of(Cloud(u, v, u, cell, cell), n // 2, near, np.empty(17), nearest)
    distance = np.hypot(u - u[n // 2], v - v[n // 2])
    assert near[:count].tolist() == np.nonzero(distance < NEIGHBOUR_RADIUS_M)[0].tolist()
    assert kept == min(count, 17)
    assert nearest[:kept].tolist() == np.argsort(distance)[:kept].tolist()


@pytest.mark.parametrize("count", [1, 2, 4])
def test_the_gain_of_a_min_of_planes_is_the_drop_of_truncated_cost(count):
    rng = np.random.default_rng(count)
    u, v, z = rng.uniform(-3.0, 3.0, (3, 60))
    cell = np.zeros(60, np.int64)
    planes, current, gain = rng.normal(0.0, 0.5, (5, 3)), rng.random(60), np.empty(60)
    total = gain_by_point(Cloud(u, v, z, cell, cell), planes, count, current, 0.2, gain)
    roof = (planes[:count, :1] * u + planes[:count, 1:2] * v + planes[:count, 2:]).min(axis=0)
    expected = current - np.array([truncated(dz, 0.2) for dz in z - roof])
    assert gain == pytest.approx(expected)
    assert total == pytest.approx(expected[expected > 0.0].sum())


def brute_partition(box, leaf, cut_u, cut_v):
    a, b, c, d = box
    best = leaf[a, b, c, d]
    for k in range(a + 1, b):
        best = min(
            best,
            cut_u[k]
            + brute_partition((a, k, c, d), leaf, cut_u, cut_v)
            + brute_partition((k, b, c, d), leaf, cut_u, cut_v),
        )
    for k in range(c + 1, d):
        best = min(
            best,
            cut_v[k]
            + brute_partition((a, b, c, k), leaf, cut_u, cut_v)
            + brute_partition((a, b, k, d), leaf, cut_u, cut_v),
        )
    return best


@pytest.mark.parametrize("seed", range(4))
def test_dynamic_programming_finds_the_cheapest_partition(seed):
    rng = np.random.default_rng(seed)
    grid = Grid(np.arange(4.0), np.arange(4.0), np.ones(4, bool), np.ones(4, bool))
    cells = rng.exponential(1.0, (5, 3, 3))
    sums = np.zeros((5, 4, 4))
    sums[:, 1:, 1:] = cells.cumsum(axis=1).cumsum(axis=2)
    penalty, cut_u, cut_v = rng.uniform(0.1, 0.6, 5), rng.uniform(0.0, 0.3, 4), rng.uniform(0.0, 0.3, 4)
    whole = np.full((4, 4, 4, 4), np.nan)
    for a, b, c, d in np.ndindex(whole.shape):
        if a < b and c < d:
            whole[a, b, c, d] = (cells[:, a:b, c:d].sum(axis=(1, 2)) + penalty).min()
    cost = partition_costs(sums, penalty, grid, cut_u, cut_v)
    for a, b, c, d in np.argwhere(np.isfinite(whole)):
        assert cost[a, b, c, d] == pytest.approx(brute_partition((a, b, c, d), whole, cut_u, cut_v), rel=1e-5)
    layout = empty_layout()
    planes, counts = rng.normal(0.0, 1.0, (5, 5, 3)), np.ones(5, np.int64)
    grow_tree(layout, cost, sums, penalty, planes, counts, grid, cut_u, cut_v)
    assert cost_of_tree(layout, whole, cut_u, cut_v) == pytest.approx(cost[0, 3, 0, 3], rel=1e-5)


def cost_of_tree(layout, whole, cut_u, cut_v, node=0, box=(0, 3, 0, 3)):
    """What the leaves and cuts of a grown tree cost together; its grid lines are at whole metres."""
    if layout.axis[node] < 0:
        return whole[box]
    a, b, c, d = box
    k = int(layout.at[node])
    low, high = ((a, k, c, d), (k, b, c, d)) if layout.axis[node] == 0 else ((a, b, c, k), (a, b, k, d))
    price = cut_u[k] if layout.axis[node] == 0 else cut_v[k]
    below, above = layout.child[node]
    return (
        price
        + cost_of_tree(layout, whole, cut_u, cut_v, below, low)
        + cost_of_tree(layout, whole, cut_u, cut_v, above, high)
    )


@pytest.mark.parametrize("seed", range(6))
def test_a_pair_left_out_never_beats_its_planes(seed):
    rng = np.random.default_rng(seed)
    costs, others = rng.random((2, 40))
    heights, other_heights = rng.normal(0.0, 1.0, (2, 40))
    price, other_price = rng.uniform(0.0, 8.0, 2)
    if may_pay(heights, other_heights, costs, others, 40, price, other_price):
        return
    together = np.where(heights < other_heights, costs, others)
    if not 0.06 * 40 <= (heights < other_heights).sum() <= 0.94 * 40:
        return
    for _ in range(200):
        some = rng.random(40) < rng.random()
        pair = together[some].sum() + price + other_price
        assert pair >= min(costs[some].sum() + price, others[some].sum() + other_price) - 1e-12


def two_leaves_and_an_overlay():
    """A cut at u = 1 between a gable and a level plane, and an overlay over [0, 1.5) x [0, 1)."""
    layout = empty_layout()
    layout.count[0] = 3
    layout.axis[0], layout.at[0], layout.child[0] = 0, 1.0, (1, 2)
    gable, level, dormer = (
        np.array([[0.0, 0.5, 1.0], [0.0, -0.5, 2.0]]),
        np.array([[0.0, 0.0, 3.0]]),
        np.array([[0.1, 0.2, 4.0]]),
    )
    layout.holder[1], layout.holder[2] = add_holder(layout, gable, 2), add_holder(layout, level, 1)
    h = add_holder(layout, dormer, 1)
    layout.rect[h] = (0.0, 1.5, 0.0, 1.0)
    layout.overlays[0], layout.count[3] = h, 1
    return layout, gable, level, dormer


def test_the_objective_is_ten_lines_of_numpy():
    layout, *_ = two_leaves_and_an_overlay()
    rng = np.random.default_rng(1)
    u, v, z = rng.uniform(-1.0, 3.0, (3, 80))
    cell = np.zeros(80, np.int64)
    cloud, ghosts = Cloud(u, v, z, cell, cell), Ghosts(v, u, rng.random(80), cell, cell, 0.5, 2.5)
    roof, ghost_roof = evaluate(layout, u, v)[0], evaluate(layout, v, u)[0]
    expected = np.minimum(((z - roof) / 0.2) ** 2, 1.0).sum() + 1.3 * complexity(layout)
    expected += ghosts.weight[(ghost_roof < 0.5) | (ghost_roof > 2.5)].sum()
    assert objective(layout, cloud, ghosts, 0.2, 1.3) == pytest.approx(expected)
    holders = evaluate(layout, u, v)[1], evaluate(layout, v, u)[1]
    assert known_objective(layout, *holders, cloud, ghosts, 0.2, 1.3) == pytest.approx(expected)


def test_hypotheses_of_one_bin_become_one():
    planes = np.array([[0.5, 0.0, 1.0], [0.501, 0.0, 1.001], [0.0, 0.0, 1.0], [0.5, 0.0, 2.0]])
    assert distinct(planes, 0.0, 0.0).tolist() == planes[[0, 2, 3]].tolist()


def test_the_height_of_a_layout_is_ten_lines_of_numpy():
    layout, gable, level, dormer = two_leaves_and_an_overlay()
    u, v = np.random.default_rng(0).uniform(-1.0, 3.0, (2, 500))
    of = [(planes[:, :1] * u + planes[:, 1:2] * v + planes[:, 2:]).min(axis=0) for planes in (gable, level, dormer)]
    expected = np.where(u < 1.0, of[0], of[1])
    expected = np.where((u >= 0.0) & (u < 1.5) & (v >= 0.0) & (v < 1.0), of[2], expected)
    assert evaluate(layout, u, v)[0] == pytest.approx(expected)


def test_complexity_counts_planes_cuts_and_overlays():
    layout, *_ = two_leaves_and_an_overlay()
    gable, level, dormer, cut, overlay = 1.4 + 0.5, 1.0, 1.9, 1.0, 1.0
    assert complexity(layout) == pytest.approx(gable + level + dormer + cut + overlay)


def test_polish_takes_away_what_changes_nothing():
    rng = np.random.default_rng(0)
    u, v = rng.uniform(0.0, 4.0, (2, 200))
    cloud = Cloud(u, v, 0.3 * u, np.zeros(200, np.int64), np.zeros(200, np.int64))
    none = np.zeros(0)
    ghosts = Ghosts(none, none, none, none.astype(np.int64), none.astype(np.int64), -10.0, 10.0)
    layout = empty_layout()
    layout.count[0] = 3
    layout.axis[0], layout.at[0], layout.child[0] = 0, 2.0, (1, 2)
    plane = np.array([[0.3, 0.0, 0.0]])
    layout.holder[1], layout.holder[2] = add_holder(layout, plane, 1), add_holder(layout, plane, 1)
    h = add_holder(layout, plane, 1)
    layout.rect[h] = (1.0, 3.0, 1.0, 3.0)
    layout.overlays[0], layout.count[3] = h, 1
    polish(layout, cloud, ghosts, 0.2, 1.2)
    assert complexity(layout) == pytest.approx(complexity(single_plane_layout(plane[0])))
    assert evaluate(layout, u, v)[0] == pytest.approx(0.3 * u)


def test_depth_is_the_distance_to_the_border_negative_outside_and_in_holes():
    ring, hole = (
        np.array([(0, 0), (10, 0), (10, 10), (0, 10)], float),
        np.array([(4, 4), (6, 4), (6, 6), (4, 6)], float),
    )
    starts = np.concatenate([ring, hole])
    ends = np.concatenate([np.roll(ring, -1, axis=0), np.roll(hole, -1, axis=0)])
    x, y = np.array([1.0, 5.0, -2.0, 5.0]), np.array([5.0, 5.0, 5.0, 3.5])
    assert signed_depth(x, y, starts, ends) == pytest.approx([1.0, -1.0, -2.0, 0.5])


@pytest.mark.parametrize("vertices", [0, 3, 40, 500])
def test_grid_lines_are_few_whatever_the_outline(vertices):
    at = np.random.default_rng(0).uniform(0.0, 30.0, vertices)
    lines, at_vertex = grid_lines(0.0, 30.0, at, 0.5)
    assert len(lines) <= 29 and len(lines) == len(at_vertex)
    assert (np.diff(lines) > 0).all() and lines[0] == 0.0 and lines[-1] == 30.0
