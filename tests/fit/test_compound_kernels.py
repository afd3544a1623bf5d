"""The compiled kernels against slow oracles in plain Python."""

import numpy as np
import pytest

from hiproof.fit.compound.kernels import Cloud, Ghosts, Grid, best_rectangle, guillotine, leaf_costs
from hiproof.fit.compound.layout import add_holder, complexity, empty_layout, evaluate, single_plane_layout
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


@pytest.mark.parametrize("seed", range(8))
def test_best_rectangle_is_that_of_brute_force(seed):
    gain = np.random.default_rng(seed).normal(-0.1, 1.0, (1 + seed % 5, 6))
    score, i0, i1, j0, j1 = best_rectangle(gain)
    assert score == pytest.approx(brute_rectangle(gain))
    assert gain[i0:i1, j0:j1].sum() == pytest.approx(score)


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
    cells = rng.exponential(1.0, (3, 3, 5))
    sums = np.zeros((4, 4, 5))
    sums[1:, 1:] = cells.cumsum(axis=0).cumsum(axis=1)
    penalty, cut_u, cut_v = rng.uniform(0.1, 0.6, 5), rng.uniform(0.0, 0.3, 4), rng.uniform(0.0, 0.3, 4)
    cost = leaf_costs(sums, penalty, grid)
    assert cost[0, 2, 1, 3] == pytest.approx((cells[0:2, 1:3].sum(axis=(0, 1)) + penalty).min())
    leaf = cost.copy()
    guillotine(cost, cut_u, cut_v)
    assert cost[0, 3, 0, 3] == pytest.approx(brute_partition((0, 3, 0, 3), leaf, cut_u, cut_v))


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
