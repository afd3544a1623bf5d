"""Check the compiled search for planes and the plan's grid against slow oracles."""

import numpy as np
import pytest

from hiproof.fit.candidates.listing import (
    fill_gains,
    find_best_rectangles,
    group_planes,
    turn_to_walls,
)
from hiproof.fit.candidates.planes import (
    NEIGHBOUR_RADIUS_M,
    Grid,
    bound_rows,
    fill_point_gains,
    find_best_rectangle,
    find_neighbours,
    select_distinct,
    truncate_cost,
)
from hiproof.fit.candidates.volumes import DIRECTION, U0, V1, price_volume
from hiproof.fit.layout.plan import Cloud, lay_lines, measure_depth
from hiproof.fit.misfit import compute_costs
from union_scenes import (
    compute_heights,
    draw_scene,
    draw_volume,
    draw_volumes,
    search_all_rectangles,
)


def find_rectangle(gain, least_sum):
    reach = np.empty(len(gain) + 1)
    bound_rows(gain, reach)
    return find_best_rectangle(gain, least_sum, reach, np.empty(gain.shape[1]))


@pytest.mark.parametrize("seed", range(8))
def test_best_rectangle_is_that_of_brute_force(seed):
    gain = np.random.default_rng(seed).normal(-0.1, 1.0, (1 + seed % 5, 6))
    score, i0, i1, j0, j1 = find_rectangle(gain, -np.inf)
    assert score == pytest.approx(search_all_rectangles(gain))
    assert gain[i0:i1, j0:j1].sum() == pytest.approx(score)


@pytest.mark.parametrize("seed", range(8))
def test_a_rectangle_is_found_only_above_what_is_asked(seed):
    gain = np.random.default_rng(seed).normal(-0.1, 1.0, (5, 6))
    best = search_all_rectangles(gain)
    assert find_rectangle(gain, best - 1e-9)[0] == pytest.approx(best)
    score, i0, i1, j0, j1 = find_rectangle(gain, best + 1e-9)
    assert score == best + 1e-9
    assert (i1 - i0) * (j1 - j0) == 0


@pytest.mark.parametrize("n", [1, 6, 200])
def test_neighbours_are_those_of_sorting_all_distances(n):
    u, v = np.random.default_rng(n).uniform(0.0, 8.0, (2, n))
    cell = np.zeros(n, np.int64)
    nearby, nearest = np.empty(n, np.int64), np.empty(17, np.int64)
    count, n_kept = find_neighbours(
        Cloud(u, v, u, cell, cell), n // 2, np.empty(n), nearby, np.empty(17), nearest
    )
    distance = np.hypot(u - u[n // 2], v - v[n // 2])
    assert nearby[:count].tolist() == np.nonzero(distance < NEIGHBOUR_RADIUS_M)[0].tolist()
    assert n_kept == min(count, 17)
    assert nearest[:n_kept].tolist() == np.argsort(distance)[:n_kept].tolist()


@pytest.mark.parametrize("count", [1, 2, 4])
def test_the_gain_of_a_min_of_planes_is_the_drop_of_truncated_cost(count):
    rng = np.random.default_rng(count)
    u, v, z = rng.uniform(-3.0, 3.0, (3, 60))
    cell = np.zeros(60, np.int64)
    planes, current, gain = rng.normal(0.0, 0.5, (5, 3)), rng.random(60), np.empty(60)
    total = fill_point_gains(Cloud(u, v, z, cell, cell), planes, count, current, 0.2, gain)
    roof = (planes[:count, :1] * u + planes[:count, 1:2] * v + planes[:count, 2:]).min(axis=0)
    expected = current - np.array([truncate_cost(dz, 0.2) for dz in z - roof])
    assert gain == pytest.approx(expected)
    assert total == pytest.approx(expected[expected > 0.0].sum())


def test_hypotheses_of_one_bin_become_one():
    planes = np.array([[0.5, 0.0, 1.0], [0.501, 0.0, 1.001], [0.0, 0.0, 1.0], [0.5, 0.0, 2.0]])
    assert select_distinct(planes, 0.0, 0.0).tolist() == planes[[0, 2, 3]].tolist()


def test_depth_is_the_distance_to_the_border_negative_outside_and_in_holes():
    ring, hole = (
        np.array([(0, 0), (10, 0), (10, 10), (0, 10)], float),
        np.array([(4, 4), (6, 4), (6, 6), (4, 6)], float),
    )
    starts = np.concatenate([ring, hole])
    ends = np.concatenate([np.roll(ring, -1, axis=0), np.roll(hole, -1, axis=0)])
    x, y = np.array([1.0, 5.0, -2.0, 5.0]), np.array([5.0, 5.0, 5.0, 3.5])
    assert measure_depth(x, y, starts, ends) == pytest.approx([1.0, -1.0, -2.0, 0.5])


@pytest.mark.parametrize("vertices", [0, 3, 40, 500])
def test_grid_lines_are_few_whatever_the_outline(vertices):
    positions = np.random.default_rng(0).uniform(0.0, 30.0, vertices)
    lines = lay_lines(0.0, 30.0, positions, 0.5, 22)
    assert len(lines) <= 29
    assert (np.diff(lines) > 0).all() and lines[0] == 0.0 and lines[-1] == 30.0


def test_groups_of_planes_are_all_pairs_with_a_ridge_and_few_larger_ones():
    """Two facing slopes, two across them and a top make known groups.

    These are each plane, three pairs, a hip, and all of these with the top.
    """
    grid = Grid(np.arange(0.0, 12.5, 0.5), np.arange(0.0, 8.5, 0.5))
    slopes = [(0.7, 0.0, 3.0), (-0.7, 0.0, 11.4), (0.0, 0.7, 3.0), (0.0, -0.7, 8.6)]
    planes = np.array([*slopes, (0.0, 0.0, 5.0)])
    groups, sizes = group_planes(planes, np.zeros((0, 5, 3)), np.zeros(0, np.int64), grid)
    result = {
        frozenset(map(tuple, group[:size].tolist()))
        for group, size in zip(groups, sizes, strict=True)
    }
    along, across, top = set(slopes[:2]), set(slopes[2:]), {(0.0, 0.0, 5.0)}
    larger = [along, across, along | across]
    expected = [{p} for p in (*slopes, *top)] + larger + [group | top for group in larger]
    assert result == {frozenset(group) for group in expected}
    assert len(groups) == len(expected)


def test_a_plane_faces_the_walls_that_it_very_nearly_faces():
    pool = np.array([(0.7, 0.02, 3.0), (0.0, 0.0, 5.0), (0.5, 0.3, 4.0)])
    leans, middle = np.array([(-0.06, np.inf), (np.inf, np.inf)]), np.array([5.0, 4.0])
    result = turn_to_walls(pool, middle, leans)
    at_middle = result[:, :2] @ middle + result[:, 2]
    assert result[:, 1].tolist() == pytest.approx([0.0, 0.042, 0.0, 0.3])
    assert result[:, 0].tolist() == [0.7, 0.7, 0.0, 0.5]
    assert at_middle == pytest.approx((pool[:, :2] @ middle + pool[:, 2])[[0, 0, 1, 2]])


def draw_case(seed):
    """Return a generator, random volumes, and a scene of points near other volumes."""
    rng = np.random.default_rng(seed)
    volumes = draw_volumes(rng)
    return rng, volumes, draw_scene(rng, draw_volumes(rng))


@pytest.mark.parametrize("replacing", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_the_best_candidate_has_the_best_of_all_rectangles(seed, replacing):
    rng, volumes, scene = draw_case(seed)
    candidates = np.array([draw_volume(rng, 0.0) for _ in range(6)])
    cell_u, cell_v = rng.integers(0, 6, (2, *scene.U.shape))
    scene = scene._replace(lines=np.tile(np.arange(7.0), (2, 2, 1)), cell_u=cell_u, cell_v=cell_v)
    z_now, _ = compute_heights(volumes, scene.U, scene.V)
    cost_now = compute_costs(z_now, scene)
    gains, cells = find_best_rectangles(scene, candidates, cost_now, z_now, replacing)
    brute, result = np.empty(6), np.empty(6)
    for m, (i0, i1, j0, j1) in enumerate(cells):
        gain = np.zeros((6, 6))
        fill_cell_gains(scene, candidates, m, (cell_u, cell_v), cost_now, z_now, replacing, gain)
        price = scene.unit * price_volume(candidates[m])
        brute[m], result[m] = search_all_rectangles(gain) - price, gain[i0:i1, j0:j1].sum() - price
    assert (
        gains.max() == pytest.approx(brute.max())
        if brute.max() > 1e-6
        else not np.isfinite(gains).any()
    )
    is_given = np.isfinite(gains)
    assert gains[is_given] == pytest.approx(brute[is_given])
    assert gains[is_given] == pytest.approx(result[is_given])
    assert (brute[~is_given] <= max(0.5 * brute.max(), 1e-6) + 1e-9).all()


def fill_cell_gains(scene, candidates, m, cells, cost_now, z_now, replacing, gain):
    """Fill `gain` with all that candidate m gains, by cell."""
    by_place = np.empty(len(z_now))
    floor = np.full(len(z_now), -np.inf) if replacing else z_now + 1e-9
    total = fill_gains(scene, candidates, m, cost_now, floor, by_place)
    assert total == pytest.approx(by_place[by_place > 0.0].sum())
    np.add.at(gain, tuple(cell[int(candidates[m, DIRECTION])] for cell in cells), by_place)


@pytest.mark.parametrize("seed", range(6))
def test_what_a_candidate_gains_in_a_cell_is_the_drop_of_its_points_cost(seed):
    rng, volumes, scene = draw_case(seed)
    candidate = draw_volume(rng, 0.0)[None]
    cell = np.zeros(scene.U.shape, int)
    z_now, _ = compute_heights(volumes, scene.U, scene.V)
    cost_now, gain = compute_costs(z_now, scene), np.zeros((1, 1))
    fill_cell_gains(scene, candidate, 0, (cell, cell), cost_now, z_now, False, gain)
    wide = candidate.copy()
    wide[0, U0 : V1 + 1] = -1e3, 1e3, -1e3, 1e3
    h = compute_heights(wide, scene.U, scene.V)[0]
    cost = compute_costs(h, scene)
    cost[: scene.n][cost[: scene.n] >= 1.0] += 0.02  # what covers a point without explaining it
    assert gain[0, 0] == pytest.approx((cost_now - cost)[h > z_now + 1e-9].sum())
