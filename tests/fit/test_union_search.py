"""Laws of the union's compiled search: heights, what a roof costs, and moves that keep the books of that cost."""

import numpy as np
import pytest

from hiproof.fit.union.add import COME_BACK, ENOUGH, add_volumes, best_addition
from hiproof.fit.union.around import look_around, roof_everywhere, roof_with, shows_at
from hiproof.fit.union.candidates import HOUSE, best_rectangles, candidates_of, gains_at_places
from hiproof.fit.union.edges import MIN_SIDE_M, move_edges
from hiproof.fit.union.grow import ground_of
from hiproof.fit.union.improve import improve, simplify, surroundings
from hiproof.fit.union.joins import join_neighbours, merge_volumes, settled_anew, take_in
from hiproof.fit.union.moves import best_plane, refit_each
from hiproof.fit.union.objective import BASE_SHARE, costs, edges_cost, objective, objective_with
from hiproof.fit.union.prices import (
    BASE_COST,
    LEANING_COST,
    PARAMETER_COST,
    PART_COST,
    REPLACING_COST,
    SLACK_UNITS,
)
from hiproof.fit.union.refit import refit
from hiproof.fit.union.scene import nodes
from hiproof.fit.union.steps import (
    AT_CORNER_M,
    END_AT_CORNER_M,
    INSIDE_M,
    STEP_M,
    TOUCH_M,
    WHOLE_STEP_M,
    edge_cost,
    walls_of,
)
from hiproof.fit.union.trim import (
    NEAR_EDGE_M,
    NEAR_VERTEX_M,
    drawn_in,
    drawn_out,
    trim,
)
from hiproof.fit.union.volumes import (
    DIRECTION,
    FREE,
    LEAN,
    LEVEL,
    OFFSET,
    OPPOSITE,
    PLANES,
    REPLACES,
    SIDES,
    SLOPE,
    SLOPE_LOW,
    TIE,
    U0,
    U1,
    V0,
    V1,
    base_only,
    coefficients,
    equalise_slopes,
    is_allowed,
    lowest,
    lowest_plane,
    roof_heights,
    volume_cost,
)
from union_scenes import brute_rectangle, heights, random_scene, random_volume, random_volumes

SLOPES = np.array([0.3, 0.7, 1.0])
SEEDS = range(12)


def drawn(seed, **options):
    """A generator, random volumes, and a scene of points near the roof of some others."""
    rng = np.random.default_rng(seed)
    volumes = random_volumes(rng)
    return rng, volumes, random_scene(rng, random_volumes(rng), **options)


def around_of(volumes, scene, k):
    """The heights of the roof were volume k everywhere, and without it."""
    around = look_around(volumes, scene.U, scene.V, k)
    return roof_everywhere(volumes, scene.U, scene.V, k, around), around.without


def is_true(volumes, scene, value):
    return value == pytest.approx(objective(volumes, scene, np.inf), rel=1e-9, abs=1e-6)


# --- heights ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
def test_the_height_of_a_roof_is_a_few_lines_of_numpy(seed):
    _, volumes, scene = drawn(seed)
    z, top = roof_heights(volumes, scene.U, scene.V)
    expected, expected_top = heights(volumes, scene.U, scene.V)
    np.testing.assert_allclose(z, expected, atol=1e-12)
    assert (top == expected_top).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_roof_with_and_without_a_volume_is_a_few_lines_of_numpy(seed):
    _, volumes, scene = drawn(seed)
    for k in range(1, len(volumes)):
        wide = volumes.copy()
        wide[k, U0 : V1 + 1] = -1e3, 1e3, -1e3, 1e3
        everywhere, without = around_of(volumes, scene, k)
        np.testing.assert_allclose(everywhere, heights(wide, scene.U, scene.V)[0], atol=1e-12)
        np.testing.assert_allclose(without, heights(np.delete(volumes, k, axis=0), scene.U, scene.V)[0], atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_around_a_volume_tells_the_roof_with_any_other_in_its_place(seed):
    rng, volumes, scene = drawn(seed)
    for k in range(len(volumes)):
        around = look_around(volumes, scene.U, scene.V, k)
        for replacing in (0.0, 1.0):
            trial = volumes.copy()
            trial[k] = random_volume(rng, replacing) if k > 0 else base_only(rng.uniform(0, 9))
            z, top = roof_heights(trial, scene.U, scene.V)
            assert (roof_with(trial, scene.U, scene.V, k, around) == z).all()
            places = zip(z, scene.U[int(trial[k, 0])], scene.V[int(trial[k, 0])], strict=True)
            own = [
                shows_at(trial, k, around, i, lowest(coefficients(trial, k), u, v), u, v)
                for i, (_, u, v) in enumerate(places)
            ]
            assert own == (top == k).tolist()
            value = objective(trial, scene, np.inf)
            assert objective_with(trial, scene, k, around, np.inf) == value
    new = np.vstack([volumes, random_volume(rng, 0.0)])
    around = look_around(volumes, scene.U, scene.V, len(volumes))
    z, _ = roof_heights(new, scene.U, scene.V)
    assert (roof_with(new, scene.U, scene.V, len(volumes), around) == z).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_hidden_volume_changes_no_height_and_no_misfit(seed):
    rng, volumes, scene = drawn(seed)
    hidden = random_volume(rng, replacing=0.0)
    below = heights(volumes, scene.U, scene.V)[0].min() - 0.1
    hidden[OFFSET + LEVEL] = min(hidden[OFFSET + LEVEL], below)
    place = rng.integers(1, len(volumes) + 1)
    more = np.insert(volumes, place, hidden, axis=0)
    assert (roof_heights(more, scene.U, scene.V)[0] == roof_heights(volumes, scene.U, scene.V)[0]).all()
    assert sum(edge_cost(more, walls_of(scene), place, edge) for edge in range(4)) == 0.0
    paid = objective(more, scene, np.inf) - objective(volumes, scene, np.inf)
    assert paid == pytest.approx(scene.evidence * volume_cost(hidden), rel=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_order_of_volumes_that_join_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    volumes = random_volumes(rng, replacing=0.0)
    scene = random_scene(rng, volumes)
    other = np.vstack([volumes[:1], rng.permutation(volumes[1:])])
    assert (roof_heights(other, scene.U, scene.V)[0] == roof_heights(volumes, scene.U, scene.V)[0]).all()
    assert objective(other, scene, np.inf) == pytest.approx(objective(volumes, scene, np.inf))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_roof_united_with_itself_moved_under_it_is_itself(seed):
    rng = np.random.default_rng(seed)
    volumes = random_volumes(rng, replacing=0.0)
    scene = random_scene(rng, volumes)
    under = volumes.copy()
    under[:, OFFSET : OFFSET + PLANES] -= rng.uniform(0.01, 2.0)
    united = np.vstack([volumes, under])
    z, top = roof_heights(united, scene.U, scene.V)
    assert (z == roof_heights(volumes, scene.U, scene.V)[0]).all()
    assert top.max() < len(volumes)


# --- what a roof costs -----------------------------------------------------------------------------------------------


def units_of(row):
    """Units of complexity of a volume: itself, its offsets, the slopes that its tie leaves it, its leans, that it replaces."""
    there = np.isfinite(row[OFFSET : OFFSET + PLANES])
    along, across = there[:2].sum(), there[2:SIDES].sum()
    slopes = {FREE: along + across, OPPOSITE: min(along, 1) + min(across, 1)}.get(row[TIE], min(along + across, 1))
    leaning = (there[:SIDES] & (row[LEAN : LEAN + SIDES] != 0)).sum()
    units = PART_COST + PARAMETER_COST * (there.sum() + slopes) + LEANING_COST * leaning
    return units + REPLACING_COST * (row[REPLACES] > 0)


def grown_by_touch(volumes):
    """The volumes, all a touch larger: what meets an edge counts as beside it."""
    wide = volumes.copy()
    wide[:, [U0, U0 + 2]] -= TOUCH_M
    wide[:, [U0 + 1, V1]] += TOUCH_M
    return wide


def beside_edge(volumes, scene, k, edge, t):
    """Heights just inside and just outside volume k at places `t` of one of its edges, and how deep in the outline they lie."""
    row = volumes[k]
    at = np.full(len(t), row[U0 + edge])
    own = np.stack([at, t] if edge < 2 else [t, at])
    c, s = scene.turn[int(row[DIRECTION])]
    first = np.array([[c, -s], [s, c]]) @ own
    UV = np.stack([[[c, s], [-s, c]] @ first for c, s in scene.turn])
    wide = grown_by_touch(volumes)
    inside = heights(wide, UV[:, 0], UV[:, 1])[0]
    outside = heights(np.delete(wide, k, axis=0), UV[:, 0], UV[:, 1])[0]
    i, j = np.rint((first - [[scene.corner_u], [scene.corner_v]]) / scene.pitch).astype(int)
    on = (i >= 0) & (j >= 0) & (i < scene.depth.shape[0]) & (j < scene.depth.shape[1])
    deep = np.full(len(t), -np.inf)
    deep[on] = scene.depth[i[on], j[on]]
    return inside, outside, deep


def slow_edge_cost(volumes, scene, k, edge, spacing):
    """What shows of an edge, from samples `spacing` (m) apart at most."""
    low, high = volumes[k, [U0 + 2, V1]] if edge < 2 else volumes[k, [U0, U0 + 1]]
    count = max(2, int((high - low) / spacing) + 1)
    step = (high - low) / count
    inside, outside, deep = beside_edge(volumes, scene, k, edge, low + (np.arange(count) + 0.5) * step)
    gap = np.abs(inside - outside)[deep >= INSIDE_M]
    prices = scene.edge_prices
    shown, low_steps = step * (gap > STEP_M).sum(), step * ((gap > STEP_M) & (gap < prices.low_step)).sum()
    if shown == 0.0:
        return 0.0
    corner = np.abs(scene.vertices[int(volumes[k, DIRECTION]), edge // 2] - volumes[k, U0 + edge]).min() < 1e-6
    by_length, whole = prices.a_metre * shown + prices.low_a_metre * low_steps, min(shown / WHOLE_STEP_M, 1.0)
    if not corner:
        return (prices.any_step + prices.loose) * whole + by_length
    within = (low + (np.arange(count) + 0.5) * step)[deep >= INSIDE_M]
    axis, vertices = edge // 2, scene.corners[int(volumes[k, DIRECTION])]
    beside = vertices[np.abs(vertices[:, axis] - volumes[k, U0 + edge]) < AT_CORNER_M, 1 - axis]
    ends = sum((np.abs(beside - end) < END_AT_CORNER_M).any() for end in within[[0, -1]])
    return (prices.any_step - prices.at_corner * ends) * whole + by_length


@pytest.mark.parametrize("seed", SEEDS)
def test_an_edge_costs_what_shows_of_it(seed):
    _, volumes, scene = drawn(seed)
    for k in range(1, len(volumes)):
        for edge in range(4):
            cost = edge_cost(volumes, walls_of(scene), k, edge)
            assert cost == pytest.approx(slow_edge_cost(volumes, scene, k, edge, 0.5), abs=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_straight_recess_costs_no_more_than_one_in_steps(seed):
    # a bay of The Hague was drawn as two recesses that overlap, for each of their sides was too short to cost anything
    rng = np.random.default_rng(seed)
    scene = random_scene(rng)
    (u, v), (length, depth) = rng.uniform(-3.0, -1.0, 2), rng.uniform((2.0, 1.0), (4.0, 1.4))
    recess = np.repeat(base_only(-2.0), 2, axis=0)
    recess[:, U0:REPLACES] = [u, u + length, v, v + depth, *recess[0, SLOPE:REPLACES]]
    recess[:, REPLACES] = 1.0
    recess[0, V0] += rng.uniform(0.3, 0.45)
    recess[1, [U0, U1]] += rng.uniform(0.1, 0.5), -rng.uniform(0.1, 0.5)
    straight = np.vstack([base_only(0.0), recess[:1]])
    straight[1, V0] = v
    stepped = np.vstack([base_only(0.0), recess])
    paid = [edges_cost(volumes, scene, np.inf) for volumes in (straight, stepped)]
    assert 0.0 < paid[0] < paid[1]


def test_an_edge_costs_nearly_what_dense_samples_of_it_say():
    differences = []
    for seed in SEEDS:
        _, volumes, scene = drawn(seed)
        for k in range(1, len(volumes)):
            for edge in range(4):
                dense = slow_edge_cost(volumes, scene, k, edge, 0.01)
                differences.append(abs(edge_cost(volumes, walls_of(scene), k, edge) - dense))
    a_sample = 0.5 * (scene.edge_prices.a_metre + scene.edge_prices.low_a_metre)
    assert np.median(differences) < a_sample
    assert np.mean(np.array(differences) < 3 * a_sample) > 0.95


@pytest.mark.parametrize("seed", SEEDS)
def test_the_objective_is_misfit_and_complexity_counted_plainly(seed):
    _, volumes, scene = drawn(seed)
    z, top = heights(volumes, scene.U, scene.V)
    residual = np.clip(np.abs(scene.z - z)[: scene.n] - scene.dead, 0.0, None) / scene.width
    ghosts, weight = z[scene.n :], scene.weight[scene.n :]
    away = (ghosts < scene.low) | (ghosts > scene.high)
    shaded = scene.shade[scene.n :] * (ghosts - scene.low) / (scene.high - scene.low)
    misfit = np.minimum(residual**2, 1.0).sum() + np.where(away, weight, shaded).sum()
    units = sum(units_of(row) for row in volumes[1:])
    units += sum(slow_edge_cost(volumes, scene, k, e, 0.5) for k in range(1, len(volumes)) for e in range(4))
    units += BASE_COST * (weight[top[scene.n :] == 0].sum() > BASE_SHARE * scene.n)
    assert objective(volumes, scene, np.inf) == pytest.approx(misfit + scene.evidence * units, rel=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_limit_only_gives_up_what_is_above_it(seed):
    _, volumes, scene = drawn(seed)
    value = objective(volumes, scene, np.inf)
    assert objective(volumes, scene, value + 1e-9) == value
    assert objective(volumes, scene, value - 1e-6) == np.inf


def test_shapes_that_are_not_allowed_cost_infinitely_much():
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        volumes = random_volumes(rng)
        scene = random_scene(rng, types=("gable", "flat"))
        every = all(is_allowed(row, scene.allowed) for row in volumes[1:])
        assert np.isfinite(objective(volumes, scene, np.inf)) == every


# --- moves -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(40))
def test_moving_edges_keeps_the_books_and_never_costs(seed):
    rng, volumes, scene = drawn(seed)
    value = objective(volumes, scene, np.inf)
    for k in range(1, len(volumes)):
        before, rest = value, np.delete(volumes, k, axis=0)
        reach, around = rng.choice([0.5, 2.0, 60.0]), look_around(volumes, scene.U, scene.V, k)
        value = move_edges(volumes, scene, k, value, reach, around)
        assert value <= before + 1e-9
        assert is_true(volumes, scene, value)
        assert (np.delete(volumes, k, axis=0) == rest).all()


@pytest.mark.parametrize("seed", range(20))
def test_moved_edges_leave_a_rectangle(seed):
    _, volumes, scene = drawn(seed)
    value = objective(volumes, scene, np.inf)
    for k in range(1, len(volumes)):
        before = volumes[k].copy()
        around = look_around(volumes, scene.U, scene.V, k)
        move_edges(volumes, scene, k, value, 60.0, around)
        for low in (U0, U0 + 2):
            moved = (volumes[k, low : low + 2] != before[low : low + 2]).any()
            assert not moved or volumes[k, low + 1] - volumes[k, low] >= MIN_SIDE_M - 1e-9


MOVES = {
    "settle": lambda volumes, scene, value: settled_anew(volumes.copy(), scene, len(volumes) - 1, value),
    "refit": refit_each,
    "improve": lambda volumes, scene, value: improve(volumes, scene, value, SLOPES, 2),
    "simplify": lambda volumes, scene, value: simplify(volumes, scene, value, 0.6),
    "merge": lambda volumes, scene, value: merge_volumes(volumes, scene, value, np.inf),
    "join": lambda volumes, scene, value: join_neighbours(volumes, scene, value, len(volumes) - 1),
}


@pytest.mark.parametrize("move", MOVES)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_move_gives_the_true_objective_and_never_a_higher_one(move, seed):
    _, volumes, scene = drawn(seed)
    value = objective(volumes, scene, np.inf)
    moved, found = MOVES[move](volumes.copy(), scene, value)
    if move == "settle" and found == np.inf:  # it says so where it found nothing better
        return
    assert found <= value + 1e-9
    assert is_true(moved, scene, found)


def volume(u, v, **planes):
    """A row over `u` and `v` with planes by the names of their places: (slope, offset), of the level one the offset."""
    row = base_only(0.0)[0]
    row[U0:SLOPE], row[OFFSET + LEVEL] = (*u, *v), np.inf
    for place, (slope, offset) in planes.items():
        k = ("left", "right", "front", "back").index(place)
        row[SLOPE + k], row[OFFSET + k] = slope, offset
    return row


@pytest.mark.parametrize("seed", SEEDS)
def test_a_steep_end_found_by_itself_becomes_an_end_of_its_neighbour(seed):
    """A gable over u -6 .. 6, v -4 .. 4, its ridge 2.4 m above its eaves, that ends steeply from u = 4.8."""
    gable = volume((-6.0, 6.0), (-4.0, 4.0), front=(0.6, 2.4), back=(0.6, 2.4))
    end = volume((4.8, 6.0), (-4.0, 4.0), right=(2.0, 12.0))
    whole = volume((-6.0, 6.0), (-4.0, 4.0), front=(0.6, 2.4), back=(0.6, 2.4), right=(2.0, 12.0))
    end[REPLACES] = 1.0
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, np.vstack([base_only(-3.0), whole]))
    found = np.vstack([base_only(-3.0), gable, end])
    value = objective(found, scene, np.inf)
    taken, better = take_in(found, scene, value, 1)
    assert len(taken) == 2 and better < value and is_true(taken, scene, better)
    assert np.isfinite(taken[1, OFFSET : OFFSET + LEVEL]).tolist() == [False, True, True, True]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_hidden_edge_is_drawn_in_for_next_to_nothing_or_where_no_height_changes(seed):
    rng, volumes, scene = drawn(seed)
    value, (U, V) = objective(volumes, scene, np.inf), nodes(scene)
    for k in range(1, len(volumes)):
        for edge in (U0, U0 + 1, U0 + 2, V1):
            seen_to = rng.uniform(volumes[k, edge - (edge - U0) % 2], volumes[k, edge - (edge - U0) % 2 + 1])
            trial, found = drawn_in(volumes, scene, value, k, edge, seen_to, U, V)
            assert is_true(trial, scene, found)
            same = (roof_heights(trial, U, V)[0] == roof_heights(volumes, U, V)[0]).all()
            assert same or found <= value + SLACK_UNITS * scene.evidence + 1e-6


@pytest.mark.parametrize("seed", SEEDS)
def test_an_edge_is_drawn_out_to_a_corners_line_for_next_to_nothing_or_stays(seed):
    _, volumes, scene = drawn(seed)
    value = objective(volumes, scene, np.inf)
    outwards, found = drawn_out(volumes, scene, value)
    assert is_true(outwards, scene, found) and found <= value + 4 * len(volumes) * SLACK_UNITS * scene.evidence
    assert np.array_equal(np.delete(outwards, range(U0, V1 + 1), 1), np.delete(volumes, range(U0, V1 + 1), 1))
    further = (outwards[1:, U0 : V1 + 1] - volumes[1:, U0 : V1 + 1]) * [-1.0, 1.0, -1.0, 1.0]
    assert (further >= 0.0).all() and (further < NEAR_VERTEX_M).all()


def test_a_rectangle_just_short_of_the_outline_is_drawn_out_to_it():
    scene = random_scene(np.random.default_rng(0))
    low, *_, high = sorted(x for x in scene.vertices[0, 0] if np.isfinite(x))
    true = np.vstack([base_only(-50.0), tied_volume(np.random.default_rng(0))])
    true[1, U0 : U0 + 2] = low, high
    scene = scene._replace(z=heights(true, scene.U, scene.V)[0])
    short = true.copy()
    short[1, U0 : U0 + 2] += 0.2, -0.1
    found, _ = drawn_out(short, scene, objective(short, scene, np.inf))
    assert found[1, U0 : U0 + 2].tolist() == pytest.approx([low, high])


@pytest.mark.parametrize("seed", SEEDS)
def test_trimming_gives_the_true_objective_and_no_volume_reaches_further_than_before(seed):
    _, volumes, scene = drawn(seed)
    trimmed, found = trim(volumes.copy(), scene, objective(volumes, scene, np.inf))
    assert is_true(trimmed, scene, found)
    planes = {tuple(row[OFFSET : OFFSET + PLANES]): row for row in volumes}
    for row in trimmed:
        before = planes[tuple(row[OFFSET : OFFSET + PLANES])]
        assert (row[[U0, U0 + 2]] >= before[[U0, U0 + 2]] - NEAR_EDGE_M).all()
        assert (row[[U0 + 1, V1]] <= before[[U0 + 1, V1]] + NEAR_EDGE_M).all()


def falling(low, high, slope, at_low):
    """A volume whose one plane is `at_low` high at v = `low` and changes by `slope` along v up to `high`."""
    row = base_only(np.inf)[0]
    row[V0], row[V1] = low, high
    plane = 2 if slope > 0.0 else 3
    row[SLOPE + plane], row[OFFSET + plane] = abs(slope), at_low - slope * low
    return row


@pytest.mark.parametrize("seed", SEEDS)
def test_a_volume_that_shows_again_behind_its_neighbour_is_cut_short(seed):
    scene = random_scene(np.random.default_rng(seed))
    low, *_, high = sorted(x for x in scene.vertices[0, 1] if np.isfinite(x))
    step = low + 0.4 * (high - low)
    annex, house = falling(low, high, 0.26, 0.0), falling(step, high, -0.25, 2.5)
    true = np.vstack([base_only(-50.0), annex, house])
    true[1, V1] = step
    scene = scene._replace(z=heights(true, scene.U, scene.V)[0])
    found = true.copy()
    found[1, V1], found[2, V1] = high, high - 0.2  # the annex runs on under the house, and is higher behind it
    found, _ = trim(found, scene, objective(found, scene, np.inf))
    assert found[1, V1] == pytest.approx(step)
    assert found[2, V1] > high - 0.1


@pytest.mark.parametrize("seed", SEEDS)
def test_a_volume_that_shows_at_one_line_of_nodes_keeps_its_width(seed):
    """Both its edges are near the neighbour's edge; drawn in to it they would leave a line."""
    scene = random_scene(np.random.default_rng(seed))
    _, V = nodes(scene)
    line = float(np.sort(V[0])[V.shape[1] // 2])
    low, high = level(-8.0, line - 0.05, 3.0), level(line + 0.01, 8.0, 3.0)
    between = level(line - 1.0, line + 1.0, 2.0)
    volumes = np.vstack([base_only(-50.0), between, low, high])
    scene = scene._replace(z=heights(volumes, scene.U, scene.V)[0])
    found, _ = trim(volumes, scene, objective(volumes, scene, np.inf))
    assert (found[:, U0] < found[:, U0 + 1]).all()
    assert (found[:, V0] < found[:, V1]).all()


def level(low, high, height):
    """A level volume from v = `low` to v = `high`."""
    row = base_only(height)[0]
    row[U0 : V1 + 1] = -8.0, 8.0, low, high
    return row


# --- planes and candidates -------------------------------------------------------------------------------------------


def tied_volume(rng):
    """A volume over all of the scene with one to four slopes, and a level top now and then."""
    row = base_only(np.inf)[0]
    row[U0 : V1 + 1] = -8.0, 8.0, -8.0, 8.0
    for k in rng.permutation(SIDES)[: rng.integers(1, SIDES + 1)]:
        row[SLOPE + k], row[OFFSET + k] = rng.uniform(0.3, 1.0), rng.uniform(4.5, 5.5)
    row[OFFSET + LEVEL] = np.inf if rng.random() < 0.5 else 4.0
    row[TIE] = rng.integers(3)
    equalise_slopes(row)
    return row


def planes_that_show(volumes, scene):
    """Which plane (n,) of the second volume is the lowest at each point."""
    c = coefficients(volumes, 1)
    return [lowest_plane(c, u, v)[1] for u, v in zip(scene.U[0, : scene.n], scene.V[0, : scene.n], strict=True)]


@pytest.mark.parametrize("seed", SEEDS)
def test_refitting_finds_the_planes_of_points_without_noise(seed):
    rng = np.random.default_rng(seed)
    scene = random_scene(rng)
    shares = np.zeros(1)
    while shares.min() < 0.1:  # every plane shows over a tenth of the points
        true = np.vstack([base_only(-50.0), tied_volume(rng)])
        there = np.isfinite(true[1, OFFSET : OFFSET + PLANES])
        shares = np.bincount(planes_that_show(true, scene), minlength=PLANES)[there] / scene.n
    scene = scene._replace(z=heights(true, scene.U, scene.V)[0])
    near = true.copy()
    near[1, OFFSET : OFFSET + PLANES][there] += rng.uniform(-0.05, 0.05, there.sum())
    around = look_around(near, scene.U, scene.V, 1)
    for _ in range(25):
        refit(near, scene, 1, around)
    z, _ = roof_heights(near, scene.U, scene.V)
    np.testing.assert_allclose(z[: scene.n], scene.z[: scene.n], atol=1e-3)


def test_a_plane_without_points_stays_where_it_is():
    rng = np.random.default_rng(0)
    scene = random_scene(rng)
    volumes = np.vstack([base_only(-50.0), tied_volume(rng)])
    volumes[1, OFFSET + LEVEL] = 1.0  # far below the slopes: only this one shows
    volumes[1, OFFSET : OFFSET + SIDES][np.isfinite(volumes[1, OFFSET : OFFSET + SIDES])] = 60.0
    before = volumes.copy()
    around = look_around(volumes, scene.U, scene.V, 1)
    refit(volumes, scene._replace(z=np.full(len(scene.z), 1.1)), 1, around)
    assert volumes[1, OFFSET + LEVEL] == pytest.approx(1.1)
    assert (volumes[1, OFFSET : OFFSET + SIDES] == before[1, OFFSET : OFFSET + SIDES]).all()
    assert (volumes[1, SLOPE : SLOPE + SIDES][before[1, SLOPE : SLOPE + SIDES] > 0] >= SLOPE_LOW).all()


@pytest.mark.parametrize("replacing", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_the_best_candidate_has_the_best_of_all_rectangles(seed, replacing):
    rng, volumes, scene = drawn(seed)
    candidates = np.array([random_volume(rng, 0.0) for _ in range(6)])
    cell_u, cell_v = rng.integers(0, 6, (2, *scene.U.shape))
    scene = scene._replace(lines=np.tile(np.arange(7.0), (2, 2, 1)))
    z_now, _ = roof_heights(volumes, scene.U, scene.V)
    cost_now = costs(z_now, scene)
    gains, cells = best_rectangles(scene, candidates, cell_u, cell_v, cost_now, z_now, replacing)
    brute, found = np.empty(6), np.empty(6)
    for m, (i0, i1, j0, j1) in enumerate(cells):
        gain = np.zeros((6, 6))
        gains_in(scene, candidates, m, (cell_u, cell_v), cost_now, z_now, replacing, gain)
        price = scene.evidence * (volume_cost(candidates[m]) + 0.5)
        brute[m], found[m] = brute_rectangle(gain) - price, gain[i0:i1, j0:j1].sum() - price
    assert gains.max() == pytest.approx(brute.max()) if brute.max() > 1e-6 else not np.isfinite(gains).any()
    told = np.isfinite(gains)
    assert gains[told] == pytest.approx(brute[told])
    assert gains[told] == pytest.approx(found[told])
    assert (brute[~told] <= max(0.5 * brute.max(), 1e-6) + 1e-9).all()


def gains_in(scene, candidates, m, cells, cost_now, z_now, replacing, gain):
    """All that candidate m gains, by cell."""
    by_place = np.empty(len(z_now))
    above = np.full(len(z_now), -np.inf) if replacing else z_now + 1e-9
    total = gains_at_places(scene, candidates, m, cost_now, above, by_place)
    assert total == pytest.approx(by_place[by_place > 0.0].sum())
    np.add.at(gain, tuple(cell[int(candidates[m, DIRECTION])] for cell in cells), by_place)


@pytest.mark.parametrize("seed", range(6))
def test_what_a_candidate_gains_in_a_cell_is_the_drop_of_its_points_cost(seed):
    rng, volumes, scene = drawn(seed)
    candidate = random_volume(rng, 0.0)[None]
    cell = np.zeros(scene.U.shape, int)
    z_now, _ = roof_heights(volumes, scene.U, scene.V)
    cost_now, gain = costs(z_now, scene), np.zeros((1, 1))
    gains_in(scene, candidate, 0, (cell, cell), cost_now, z_now, False, gain)
    wide = candidate.copy()
    wide[0, U0 : V1 + 1] = -1e3, 1e3, -1e3, 1e3
    h = heights(wide, scene.U, scene.V)[0]
    cost = costs(h, scene)
    cost[: scene.n][cost[: scene.n] >= 1.0] += 0.02  # what covers a point without explaining it
    assert gain[0, 0] == pytest.approx((cost_now - cost)[h > z_now + 1e-9].sum())


def ground_beneath(scene):
    candidates = candidates_of(scene, np.arange(scene.n), HOUSE.planes)
    return ground_of(scene, candidates), candidates


@pytest.mark.parametrize("seed", range(8))
def test_an_addition_is_one_volume_more_for_less(seed):
    _, volumes, scene = drawn(seed)
    ground, candidates = ground_beneath(scene)
    for start in (base_only(float(scene.z.min())), volumes):
        value = objective(start, scene, np.inf)
        more, found = best_addition(start, value, ground, candidates)
        if found == np.inf:
            continue
        assert len(more) == len(start) + 1
        assert found < value
        assert is_true(more, scene, found)
        end = add_volumes(start, value, ground, candidates, 1, 0, 0.0)
        assert end[1] <= found + 1e-9
        assert end[2:] == (ENOUGH, 0)
    assert best_addition(volumes, value, ground, candidates[:0])[1] == np.inf


@pytest.mark.parametrize("seed", range(4))
def test_adding_ends_where_a_known_roof_comes_back(seed):
    _, _, scene = drawn(seed)
    ground, candidates = ground_beneath(scene)
    base = base_only(float(scene.z.min()))
    value = objective(base, scene, np.inf)
    volumes, found, end, left = add_volumes(base, value, ground, candidates, 1, 0, 0.0)
    again = add_volumes(base, value, ground, candidates, 5, len(volumes), found)
    assert len(volumes) > 1
    assert (end, left) == (ENOUGH, 0)
    assert again[2] == COME_BACK
    assert len(again[0]) == len(volumes)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_further_plane_gains_what_the_points_then_cost_less(seed):
    rng, _, scene = drawn(seed)
    volumes = random_volumes(rng)
    volumes[1:, REPLACES] = 0.0
    z_now, _ = roof_heights(volumes, scene.U, scene.V)
    for k in range(1, len(volumes)):
        everywhere, beneath = around_of(volumes, scene, k)
        for plane in np.nonzero(volumes[k, OFFSET : OFFSET + PLANES] == np.inf)[0]:
            slopes = SLOPES if plane < LEVEL else np.zeros(1)
            gain, slope, offset = best_plane(volumes, scene, k, plane, slopes, z_now, everywhere, beneath, 0.0)
            assert gain > 0.0 or (slope, offset) == (0.0, 0.0)
            trial = volumes.copy()
            if gain > 0.0:
                trial[k, OFFSET + plane] = offset
            if plane < LEVEL:
                trial[k, SLOPE + plane] = slope
            z_then, _ = roof_heights(trial, scene.U, scene.V)
            less = costs(z_now, scene)[: scene.n].sum() - costs(z_then, scene)[: scene.n].sum()
            assert gain == pytest.approx(less, abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_the_surroundings_of_a_volume_are_what_is_near_it(seed):
    """Moved, it or a volume that meets it changes the digest; one far away does not until it comes near."""
    rng = np.random.default_rng(seed)
    volumes = np.vstack([base_only(2.0), random_volume(rng, 0.0), random_volume(rng, 0.0)])
    volumes[1:, DIRECTION], volumes[1:, U0 : V1 + 1] = 0.0, [(-3.0, 3.0, -2.0, 2.0), (9.0, 14.0, -2.0, 2.0)]
    digest = surroundings(volumes, 1)
    for row, column, value, same in ((2, V1, 4.0, True), (2, U0, 3.0, False), (1, V1, 2.1, False)):
        moved = volumes.copy()
        moved[row, column] = value
        assert (surroundings(moved, 1) == digest) is same
