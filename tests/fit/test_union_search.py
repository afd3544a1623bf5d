"""Check the compiled search: heights, the cost of a roof, and moves that keep it."""

import numpy as np
import pytest

from hiproof.fit.prices import (
    BASE_COST,
    LOOSE_COST,
    PART_COST,
    REPLACING_COST,
    SKEW_UNITS,
    UNKNOWN_UNITS,
)
from hiproof.fit.union.add import NOTHING_LEFT, add_candidates, find_best_addition
from hiproof.fit.union.around import (
    compute_roof_everywhere,
    compute_roof_with,
    is_visible_at,
    measure_context,
)
from hiproof.fit.union.candidates import (
    MOST_PLANES,
    fill_gains,
    find_best_rectangles,
    list_candidates,
)
from hiproof.fit.union.edges import move_edges
from hiproof.fit.union.grow import prepare_growth
from hiproof.fit.union.improve import improve
from hiproof.fit.union.moves import (
    FEWEST_SEEDS,
    count_seeds,
    find_best_plane,
    place_outside,
    refit_volume,
)
from hiproof.fit.union.objective import (
    BASE_SHARE,
    BORDER_M,
    SAME_LINE_M,
    compute_costs,
    compute_objective,
    compute_objective_with,
)
from hiproof.fit.union.refit import refit
from hiproof.fit.union.volumes import (
    DIRECTION,
    FREE,
    LEAN0,
    LEVEL,
    N_PLANES,
    N_SIDES,
    OFFSET0,
    OPPOSITE,
    REPLACES,
    SLOPE0,
    SLOPE_LOW,
    TIE,
    U0,
    V0,
    V1,
    compute_roof_heights,
    equalise_slopes,
    find_lowest,
    find_lowest_plane,
    is_allowed,
    make_base,
    price_volume,
    read_coefficients,
)
from union_scenes import (
    compute_heights,
    draw_scene,
    draw_volume,
    draw_volumes,
    search_all_rectangles,
)

SLOPES = np.array([0.3, 0.7, 1.0])
SEEDS = range(12)


def draw_case(seed, **options):
    """Return a generator, random volumes, and a scene of points near other volumes."""
    rng = np.random.default_rng(seed)
    volumes = draw_volumes(rng)
    return rng, volumes, draw_scene(rng, draw_volumes(rng), **options)


def compute_both_roofs(volumes, scene, k):
    """Return the heights of the roof with volume k everywhere, and without it."""
    context = measure_context(volumes, scene.U, scene.V, k)
    return compute_roof_everywhere(volumes, scene.U, scene.V, k, context), context.roof_without


def is_true(volumes, scene, value):
    return value == pytest.approx(compute_objective(volumes, scene), rel=1e-9, abs=1e-6)


# --- heights --------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
def test_the_height_of_a_roof_is_a_few_lines_of_numpy(seed):
    _, volumes, scene = draw_case(seed)
    z, top = compute_roof_heights(volumes, scene.U, scene.V)
    expected, expected_top = compute_heights(volumes, scene.U, scene.V)
    np.testing.assert_allclose(z, expected, atol=1e-12)
    assert (top == expected_top).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_roof_with_and_without_a_volume_is_a_few_lines_of_numpy(seed):
    _, volumes, scene = draw_case(seed)
    for k in range(1, len(volumes)):
        wide = volumes.copy()
        wide[k, U0 : V1 + 1] = -1e3, 1e3, -1e3, 1e3
        everywhere, roof_without = compute_both_roofs(volumes, scene, k)
        np.testing.assert_allclose(
            everywhere, compute_heights(wide, scene.U, scene.V)[0], atol=1e-12
        )
        np.testing.assert_allclose(
            roof_without,
            compute_heights(np.delete(volumes, k, axis=0), scene.U, scene.V)[0],
            atol=1e-12,
        )


@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_around_a_volume_tells_the_roof_with_any_other_in_its_place(seed):
    rng, volumes, scene = draw_case(seed)
    for k in range(len(volumes)):
        context = measure_context(volumes, scene.U, scene.V, k)
        for replacing in (0.0, 1.0):
            trial = volumes.copy()
            trial[k] = draw_volume(rng, replacing) if k > 0 else make_base(rng.uniform(0, 9))
            z, top = compute_roof_heights(trial, scene.U, scene.V)
            assert (compute_roof_with(trial, scene.U, scene.V, k, context) == z).all()
            places = zip(z, scene.U[int(trial[k, 0])], scene.V[int(trial[k, 0])], strict=True)
            item = [
                is_visible_at(
                    trial, k, context, i, find_lowest(read_coefficients(trial, k), u, v), u, v
                )
                for i, (_, u, v) in enumerate(places)
            ]
            assert item == (top == k).tolist()
            value = compute_objective(trial, scene)
            assert compute_objective_with(trial, scene, k, context) == value
    new = np.vstack([volumes, draw_volume(rng, 0.0)])
    context = measure_context(volumes, scene.U, scene.V, len(volumes))
    z, _ = compute_roof_heights(new, scene.U, scene.V)
    assert (compute_roof_with(new, scene.U, scene.V, len(volumes), context) == z).all()


@pytest.mark.parametrize("seed", SEEDS)
def test_a_hidden_volume_changes_no_height_and_no_misfit(seed):
    rng, volumes, scene = draw_case(seed)
    hidden = draw_volume(rng, replacing=0.0)
    floor = compute_heights(volumes, scene.U, scene.V)[0].min() - 0.1
    hidden[OFFSET0 + LEVEL] = min(hidden[OFFSET0 + LEVEL], floor)
    place = rng.integers(1, len(volumes) + 1)
    extended = np.insert(volumes, place, hidden, axis=0)
    assert (
        compute_roof_heights(extended, scene.U, scene.V)[0]
        == compute_roof_heights(volumes, scene.U, scene.V)[0]
    ).all()
    paid = compute_objective(extended, scene) - compute_objective(volumes, scene)
    loose = count_loose_edges(extended, scene) - count_loose_edges(volumes, scene)
    units = price_volume(hidden) + LOOSE_COST * loose
    assert paid == pytest.approx(scene.unit * units, rel=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_order_of_volumes_that_join_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    volumes = draw_volumes(rng, replacing=0.0)
    scene = draw_scene(rng, volumes)
    other = np.vstack([volumes[:1], rng.permutation(volumes[1:])])
    assert (
        compute_roof_heights(other, scene.U, scene.V)[0]
        == compute_roof_heights(volumes, scene.U, scene.V)[0]
    ).all()
    assert compute_objective(other, scene) == pytest.approx(compute_objective(volumes, scene))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_roof_united_with_itself_moved_under_it_is_itself(seed):
    rng = np.random.default_rng(seed)
    volumes = draw_volumes(rng, replacing=0.0)
    scene = draw_scene(rng, volumes)
    lowered = volumes.copy()
    lowered[:, OFFSET0 : OFFSET0 + N_PLANES] -= rng.uniform(0.01, 2.0)
    united = np.vstack([volumes, lowered])
    z, top = compute_roof_heights(united, scene.U, scene.V)
    assert (z == compute_roof_heights(volumes, scene.U, scene.V)[0]).all()
    assert top.max() < len(volumes)


# --- what a roof costs ----------------------------------------------------------------------------


def count_units(row):
    """Count the units of a volume: offsets, slopes, leans, and whether it replaces."""
    is_present = np.isfinite(row[OFFSET0 : OFFSET0 + N_PLANES])
    along, across = is_present[:2].sum(), is_present[2:N_SIDES].sum()
    slopes = {FREE: along + across, OPPOSITE: min(along, 1) + min(across, 1)}.get(
        row[TIE], min(along + across, 1)
    )
    leaning = (is_present[:N_SIDES] & (row[LEAN0 : LEAN0 + N_SIDES] != 0)).sum()
    units = PART_COST + UNKNOWN_UNITS * (is_present.sum() + slopes) + SKEW_UNITS * leaning
    return units + REPLACING_COST * (row[REPLACES] > 0)


def count_loose_edges(volumes, scene):
    """Count the edges inside the outline's bounds, in line with no corner and no other edge."""
    count = 0
    for k, row in enumerate(volumes):
        same_way = (volumes[:, DIRECTION] == row[DIRECTION]) & (np.arange(len(volumes)) != k)
        same_way[0] = False
        for edge in range(4 if k else 0):
            first = U0 + edge // 2 * 2
            corners = scene.vertices[int(row[DIRECTION]), edge // 2]
            corners = corners[np.isfinite(corners)]
            lines = np.append(corners, volumes[same_way, first : first + 2])
            place = row[U0 + edge]
            is_inside = corners.min() + BORDER_M <= place <= corners.max() - BORDER_M
            count += is_inside and np.abs(lines - place).min() >= SAME_LINE_M
    return count


@pytest.mark.parametrize("seed", SEEDS)
def test_heights_of_narrow_volumes_are_those_of_the_slow_oracle(seed):
    rng, volumes, scene = draw_case(seed)
    for _ in range(4):
        narrow = volumes.copy()
        for low in (U0, V0):
            ends = np.sort(rng.uniform(narrow[1:, low], narrow[1:, low + 1], (2, len(narrow) - 1)))
            narrow[1:, [low, low + 1]] = np.sort(ends, axis=0).T
        z, top = compute_roof_heights(narrow, scene.U, scene.V)
        slow_z, slow_top = compute_heights(narrow, scene.U, scene.V)
        np.testing.assert_allclose(z, slow_z, atol=1e-12)
        assert np.array_equal(top, slow_top)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_objective_is_misfit_and_complexity_counted_plainly(seed):
    _, volumes, scene = draw_case(seed)
    z, top = compute_heights(volumes, scene.U, scene.V)
    residual = np.clip(np.abs(scene.z - z)[: scene.n] - scene.dead, 0.0, None) / scene.width
    ghosts, weight = z[scene.n :], scene.weight[scene.n :]
    is_away = (ghosts < scene.low) | (ghosts > scene.high)
    shaded = scene.shade[scene.n :] * (ghosts - scene.low) / (scene.high - scene.low)
    misfit = np.minimum(residual**2, 1.0).sum() + np.where(is_away, weight, shaded).sum()
    units = sum(count_units(row) for row in volumes[1:])
    units += LOOSE_COST * count_loose_edges(volumes, scene)
    units += BASE_COST * (weight[top[scene.n :] == 0].sum() > BASE_SHARE * scene.n)
    assert compute_objective(volumes, scene) == pytest.approx(misfit + scene.unit * units, rel=1e-9)


def test_shapes_that_are_not_allowed_cost_infinitely_much():
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        volumes = draw_volumes(rng)
        scene = draw_scene(rng, types=("gable", "flat"))
        all_rows = all(is_allowed(row, scene.allowed) for row in volumes[1:])
        assert np.isfinite(compute_objective(volumes, scene)) == all_rows


# --- moves ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(40))
def test_moving_edges_keeps_the_books_and_never_costs(seed):
    _, volumes, scene = draw_case(seed)
    value = compute_objective(volumes, scene)
    for k in range(1, len(volumes)):
        original, remainder = value, np.delete(volumes, k, axis=0)
        context = measure_context(volumes, scene.U, scene.V, k)
        value = move_edges(volumes, scene, k, value, context)
        assert value <= original + 1e-9
        assert is_true(volumes, scene, value)
        assert (np.delete(volumes, k, axis=0) == remainder).all()


@pytest.mark.parametrize("seed", range(20))
def test_moved_edges_leave_a_rectangle(seed):
    _, volumes, scene = draw_case(seed)
    value = compute_objective(volumes, scene)
    for k in range(1, len(volumes)):
        original = volumes[k].copy()
        context = measure_context(volumes, scene.U, scene.V, k)
        move_edges(volumes, scene, k, value, context)
        for lower in (U0, U0 + 2):
            moved = (volumes[k, lower : lower + 2] != original[lower : lower + 2]).any()
            assert not moved or volumes[k, lower + 1] > volumes[k, lower]


MOVES = {
    "refit": lambda volumes, scene, value: refit_volume(
        volumes, scene, value, 1, measure_context(volumes, scene.U, scene.V, 1)
    ),
    "improve": lambda volumes, scene, value: improve(volumes, scene, value, SLOPES, 2),
}


@pytest.mark.parametrize("move", MOVES)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_move_gives_the_true_objective_and_never_a_higher_one(move, seed):
    _, volumes, scene = draw_case(seed)
    value = compute_objective(volumes, scene)
    moved, result = MOVES[move](volumes.copy(), scene, value)
    assert result <= value + 1e-9
    assert is_true(moved, scene, result)


# --- planes and candidates ------------------------------------------------------------------------


def draw_tied_volume(rng):
    """Draw a volume over all of the scene with one to four slopes.

    It has a level top now and then.
    """
    row = make_base(np.inf)[0]
    row[U0 : V1 + 1] = -8.0, 8.0, -8.0, 8.0
    for k in rng.permutation(N_SIDES)[: rng.integers(1, N_SIDES + 1)]:
        row[SLOPE0 + k], row[OFFSET0 + k] = rng.uniform(0.3, 1.0), rng.uniform(4.5, 5.5)
    row[OFFSET0 + LEVEL] = np.inf if rng.random() < 0.5 else 4.0
    row[TIE] = rng.integers(3)
    equalise_slopes(row)
    return row


def find_visible_planes(volumes, scene):
    """Return which plane (n,) of the second volume is the lowest at each point."""
    c = read_coefficients(volumes, 1)
    return [
        find_lowest_plane(c, u, v)[1]
        for u, v in zip(scene.U[0, : scene.n], scene.V[0, : scene.n], strict=True)
    ]


@pytest.mark.parametrize("seed", SEEDS)
def test_refitting_finds_the_planes_of_points_without_noise(seed):
    rng = np.random.default_rng(seed)
    scene = draw_scene(rng)
    shares = np.zeros(1)
    while shares.min() < 0.1:  # every plane shows over a tenth of the points
        true = np.vstack([make_base(-50.0), draw_tied_volume(rng)])
        is_present = np.isfinite(true[1, OFFSET0 : OFFSET0 + N_PLANES])
        shares = (
            np.bincount(find_visible_planes(true, scene), minlength=N_PLANES)[is_present] / scene.n
        )
    scene = scene._replace(z=compute_heights(true, scene.U, scene.V)[0])
    nearby = true.copy()
    nearby[1, OFFSET0 : OFFSET0 + N_PLANES][is_present] += rng.uniform(
        -0.05, 0.05, is_present.sum()
    )
    context = measure_context(nearby, scene.U, scene.V, 1)
    for _ in range(25):
        refit(nearby, scene, 1, context)
    z, _ = compute_roof_heights(nearby, scene.U, scene.V)
    np.testing.assert_allclose(z[: scene.n], scene.z[: scene.n], atol=1e-3)


def test_a_plane_without_points_stays_where_it_is():
    rng = np.random.default_rng(0)
    scene = draw_scene(rng)
    volumes = np.vstack([make_base(-50.0), draw_tied_volume(rng)])
    volumes[1, OFFSET0 + LEVEL] = 1.0  # far below the slopes: only this one shows
    volumes[1, OFFSET0 : OFFSET0 + N_SIDES][
        np.isfinite(volumes[1, OFFSET0 : OFFSET0 + N_SIDES])
    ] = 60.0
    original = volumes.copy()
    context = measure_context(volumes, scene.U, scene.V, 1)
    refit(volumes, scene._replace(z=np.full(len(scene.z), 1.1)), 1, context)
    assert volumes[1, OFFSET0 + LEVEL] == pytest.approx(1.1)
    assert (
        volumes[1, OFFSET0 : OFFSET0 + N_SIDES] == original[1, OFFSET0 : OFFSET0 + N_SIDES]
    ).all()
    assert (
        volumes[1, SLOPE0 : SLOPE0 + N_SIDES][original[1, SLOPE0 : SLOPE0 + N_SIDES] > 0]
        >= SLOPE_LOW
    ).all()


@pytest.mark.parametrize("replacing", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_the_best_candidate_has_the_best_of_all_rectangles(seed, replacing):
    rng, volumes, scene = draw_case(seed)
    candidates = np.array([draw_volume(rng, 0.0) for _ in range(6)])
    cell_u, cell_v = rng.integers(0, 6, (2, *scene.U.shape))
    scene = scene._replace(lines=np.tile(np.arange(7.0), (2, 2, 1)))
    z_now, _ = compute_roof_heights(volumes, scene.U, scene.V)
    cost_now = compute_costs(z_now, scene)
    gains, cells = find_best_rectangles(
        scene, candidates, cell_u, cell_v, cost_now, z_now, replacing
    )
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
    z_now, _ = compute_roof_heights(volumes, scene.U, scene.V)
    cost_now, gain = compute_costs(z_now, scene), np.zeros((1, 1))
    fill_cell_gains(scene, candidate, 0, (cell, cell), cost_now, z_now, False, gain)
    wide = candidate.copy()
    wide[0, U0 : V1 + 1] = -1e3, 1e3, -1e3, 1e3
    h = compute_heights(wide, scene.U, scene.V)[0]
    cost = compute_costs(h, scene)
    cost[: scene.n][cost[: scene.n] >= 1.0] += 0.02  # what covers a point without explaining it
    assert gain[0, 0] == pytest.approx((cost_now - cost)[h > z_now + 1e-9].sum())


def prepare_grid(scene):
    candidates = list_candidates(scene, np.arange(scene.n), MOST_PLANES)
    return prepare_growth(scene, candidates), candidates


@pytest.mark.parametrize("seed", range(8))
def test_an_addition_is_one_volume_more_for_less(seed):
    _, volumes, scene = draw_case(seed)
    ground, candidates = prepare_grid(scene)
    for start in (make_base(float(scene.z.min())), volumes):
        value = compute_objective(start, scene)
        extended, result = find_best_addition(start, value, ground, candidates)
        if result == np.inf:
            continue
        assert len(extended) == len(start) + 1
        assert result < value
        assert is_true(extended, scene, result)
        end = add_candidates(start, value, ground, candidates, 1)
        assert end[1] <= result + 1e-9
        assert end[2:] == (NOTHING_LEFT, 0)
    assert find_best_addition(volumes, value, ground, candidates[:0])[1] == np.inf


@pytest.mark.parametrize("seed", SEEDS)
def test_a_further_plane_gains_what_the_points_then_cost_less(seed):
    rng, _, scene = draw_case(seed)
    volumes = draw_volumes(rng)
    volumes[1:, REPLACES] = 0.0
    z_now, _ = compute_roof_heights(volumes, scene.U, scene.V)
    for k in range(1, len(volumes)):
        everywhere, beneath = compute_both_roofs(volumes, scene, k)
        for plane in np.nonzero(volumes[k, OFFSET0 : OFFSET0 + N_PLANES] == np.inf)[0]:
            slopes = SLOPES if plane < LEVEL else np.zeros(1)
            gain, slope, offset = find_best_plane(
                volumes, scene, k, plane, slopes, z_now, everywhere, beneath, 0.0
            )
            assert gain > 0.0 or (slope, offset) == (0.0, 0.0)
            trial = volumes.copy()
            if gain > 0.0:
                trial[k, OFFSET0 + plane] = offset
            if plane < LEVEL:
                trial[k, SLOPE0 + plane] = slope
            z_then, _ = compute_roof_heights(trial, scene.U, scene.V)
            saving = (
                compute_costs(z_now, scene)[: scene.n].sum()
                - compute_costs(z_then, scene)[: scene.n].sum()
            )
            assert gain == pytest.approx(saving, abs=1e-9)


def test_planes_with_too_few_seeds_gain_nothing_wherever_their_edge_lies():
    few = many = 0
    for seed in SEEDS:
        rng, _, scene = draw_case(seed)
        volumes = draw_volumes(rng)
        z_now, _ = compute_roof_heights(volumes, scene.U, scene.V)
        for k in range(1, len(volumes)):
            roofs = compute_both_roofs(volumes, scene, k)
            seeds = count_seeds(volumes, scene, k, z_now, *roofs)
            for plane in range(N_PLANES):
                wide = volumes.copy()
                if plane < LEVEL:
                    wide[k, U0 + plane] = place_outside(scene, int(volumes[k, DIRECTION]), plane)
                slopes = SLOPES if plane < LEVEL else np.zeros(1)
                gains = [
                    find_best_plane(rows, scene, k, plane, slopes, z_now, *roofs, 0.0)[0]
                    for rows in (volumes, wide)
                ]
                few += seeds[plane] < FEWEST_SEEDS
                many += max(gains) > 0.0
                assert seeds[plane] >= FEWEST_SEEDS or max(gains) == 0.0
    assert few
    assert many
