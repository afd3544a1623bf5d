"""Buildings judged by the points of two surveys: what changed is found and named, and what only
hides a roof is no change.
"""

import dataclasses

import numpy as np
import pytest
import shapely
from benchmarks.building_changes import CHANGES, change_building

from hiproof.frames import turn_points
from hiproof.settings import ReadSettings
from hiproof.simulate import random_building
from hiproof.simulate.roofs import assemble, make_part
from hiproof.status import Change, ChangeKind
from hiproof.update.clusters import compute_chance
from hiproof.update.ground import Ground
from hiproof.update.judge import judge_building
from hiproof.update.kinds import name_differences
from hiproof.update.register import SampledRoof, SurveyShift, register_surveys
from points_of_roofs import scan_roof as scan

SHIFT, GROUND = SurveyShift(sigma=(0.4, 0.4, 0.01)), Ground(np.zeros(3), 0.0, 0.0)
FLAT = {"length": 16.0, "width": 10.0}
GABLE = {"length": 14.0, "width": 9.0, "height": 3.5}


def make_roof(kind="gable", parameters=None, eave=6.0, place=(0.0, 0.0)):
    parameters = parameters or (FLAT if kind == "flat" else GABLE)
    part = make_part(kind, parameters, 0.3, np.array([*place, eave]))
    return assemble((part,), "single", (0.0, 0.0, 0.0))


def judge(old, new, significance=0.001, **options):
    roof, points = old
    return judge_building(roof, points, new, GROUND, SHIFT, significance, **options)


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.mark.parametrize("density", [3.0, 8.0, 20.0])
def test_of_120_unchanged_roofs_none_is_called_changed(rng, density):
    classes = []
    for _ in range(40):
        roof = random_building(rng).roof
        classes.append(judge((roof, scan(rng, roof, density)), scan(rng, roof, 8.0)).change)
    assert set(classes) == {Change.UNCHANGED}


@pytest.mark.parametrize("densities", [(1.0, 1.0), (8.0, 1.0), (1.0, 8.0)])
def test_a_dormer_in_sparse_points_is_hardly_ever_unchanged(densities):
    """It fills hardly any cell of 2 m, so smaller ones are compared, too: of 3 m by 3 m."""
    roof, classes = make_roof().roof, {"dormer": [], "none": []}
    for seed in range(24):
        rng = np.random.default_rng(seed)
        old, new, other = (scan(rng, roof, d) for d in (*densities, densities[1]))
        corner = rng.uniform((-6.0, 0.8), (3.0, 1.2))
        local = turn_points(new[:, :2], -0.3) - corner
        inside = ((local > 0) & (local < 3.0)).all(axis=1)
        new[inside, 2] = 6.0 + GABLE["height"] + rng.normal(0, 0.03, inside.sum())
        for name, points in (("dormer", new), ("none", other)):
            classes[name].append(judge((roof, old), points).change)
    assert classes["none"].count(Change.UNCHANGED) == 24
    assert classes["dormer"].count(Change.UNCHANGED) <= 6, classes["dormer"]


@pytest.mark.parametrize("density", [2.0, 4.0, 8.0])
def test_a_place_lowered_beside_one_that_the_model_leaves_out_is_not_unchanged(density):
    """Its height is between those around it, as that of a wall, but it is no strip."""
    roof, lowered, untouched = make_roof("flat", {"length": 14.0, "width": 9.0}).roof, [], []
    for seed in range(24):
        rng = np.random.default_rng(seed)
        old, new, other = (scan(rng, roof, density) for _ in range(3))
        x, y = rng.uniform((-5.0, -3.0), (1.0, 0.0))
        for points, length, depth in ((old, 2.0, 3.0), (other, 2.0, 3.0), (new, 4.4, 2.4)):
            local = turn_points(points[:, :2], -0.3) - (x, y)
            inside = ((local > 0) & (local < (length, 3.0))).all(axis=1)
            points[inside, 2] -= depth
        lowered.append(judge((roof, old), new).change)
        untouched.append(judge((roof, old), other).change)
    assert untouched.count(Change.UNCHANGED) >= 23
    assert lowered.count(Change.UNCHANGED) <= 4, lowered


def list_changes(kind, count=6):
    """Buildings that allow a change of some kind, before and after it."""
    rng, pairs = np.random.default_rng(11), []
    while len(pairs) < count:
        names = ("two_level", "extension") if kind.startswith("part_") else None
        building = make_building(rng, names, kind)
        after = change_building(rng, building, kind)
        if after is not None:
            pairs.append((building, after))
    return pairs


def make_building(rng, names, kind):
    from hiproof.simulate import random_compound

    if kind == "part_added":
        return make_roof("flat")
    if kind == "small_object":
        return make_roof()
    return random_building(rng) if names is None else random_compound(rng, str(rng.choice(names)))


@pytest.mark.parametrize("kind", sorted(CHANGES))
def test_every_kind_of_change_is_found_and_most_are_named(kind):
    rng, named = np.random.default_rng(2), []
    pairs = list_changes(kind)
    for before, after in pairs:
        new = scan(rng, after.roof)
        if kind == "part_removed":  # bare ground lies where the part stood
            ground = dataclasses.replace(before.roof, parts=(level_part(before.roof.outline),))
            yard = scan(rng, ground)
            bare = ~shapely.intersects_xy(after.roof.outline, *yard[:, :2].T)
            new = np.concatenate([new, yard[bare]])
        verdict = judge((before.roof, scan(rng, before.roof)), new)
        assert verdict.change is Change.CHANGED
        found = name_differences(verdict, before.roof, after.roof, 0.01)
        named.append(found[0].kind.code)
    assert named.count(kind) >= 5, named


def level_part(outline):
    """A level surface on the ground."""
    x0, y0, x1, y1 = outline.bounds
    middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2, 0.0])
    return make_part("flat", {"length": x1 - x0 + 9, "width": y1 - y0 + 9}, 0.0, middle)


def test_an_added_storey_is_measured_within_two_centimetres(rng):
    roof = make_roof()
    new = scan(rng, roof.roof) + (0.0, 0.0, 2.8)
    verdict = judge((roof.roof, scan(rng, roof.roof)), new)
    (place,) = name_differences(verdict, roof.roof, None, 0.01)
    assert place.kind is ChangeKind.ROOF_RAISED
    assert place.difference_m == pytest.approx(2.8, abs=0.02)
    assert place.sigma_m < 0.03


@pytest.mark.parametrize("up, kind", [(2.8, "roof_raised"), (-1.5, "roof_lowered")])
@pytest.mark.parametrize("place", [(-0.15, 0.48), (0.15, -0.48)])
def test_a_roof_that_lies_higher_and_aside_keeps_its_slope(up, kind, place, rng):
    """As where a single house is raised and its survey lies aside, by an unknown shift."""
    before, after = make_roof(), make_roof(eave=6.0 + up, place=place)
    verdict = judge((before.roof, scan(rng, before.roof)), scan(rng, after.roof))
    (found,) = name_differences(verdict, before.roof, after.roof, 0.01)
    assert found.kind.code == kind
    assert found.difference_m == pytest.approx(up, abs=0.05)


def test_bare_ground_inside_the_outline_makes_a_building_gone(rng):
    roof = make_roof().roof
    old = scan(rng, roof)
    ground = old * (1, 1, 0)
    assert judge((roof, old), ground).change is Change.GONE
    assert judge((roof, old), ground[:0]).change is Change.NOT_COVERED


def make_small_house(rng):
    """Return a roof of 20 to 40 m2, turned at random."""
    kind, width = str(rng.choice(["flat", "gable", "monopitch"])), rng.uniform(3.5, 4.4)
    parameters = {"length": rng.uniform(20, 40) / width, "width": width}
    parameters |= {} if kind == "flat" else {"height": rng.uniform(0.5, 2.0)}
    place = np.array([0.0, 0.0, rng.uniform(2.5, 6.0)])
    part = make_part(kind, parameters, rng.uniform(0, np.pi), place)
    return assemble((part,), "single", (0.0, 0.0, 0.0)).roof


def lose_side(rng, roof, least_m2):
    """Return a side of a roof that lies bare, in a direction that the cells do not know."""
    while True:
        angle = rng.uniform(0, 2 * np.pi)
        out, along = np.array([(np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))])
        reach = shapely.get_coordinates(roof.outline) @ out
        start = reach.min() + np.ptp(reach) * rng.uniform(0.45, 0.9)
        corners = [start * out - 20 * along, start * out + 20 * along]
        side = shapely.Polygon([*corners, corners[1] + 20 * out, corners[0] + 20 * out])
        if roof.outline.intersection(side).area > least_m2:
            return side


@pytest.mark.parametrize("seed", [41, 42, 43])
@pytest.mark.parametrize("density", [4.0, 8.0, 16.0])
def test_a_small_house_that_lost_a_side_is_never_unchanged(density, seed):
    """A corner of 3 m2 off a house of 27 m2 was: half of it lies along walls, aslant to cells."""
    rng, lost, untouched = np.random.default_rng(seed), [], []
    for _ in range(40):
        roof = make_small_house(rng)
        old, new = scan(rng, roof, density), scan(rng, roof, density)
        aside = [*rng.normal(0, 0.03, 2), 0]
        untouched.append(judge((roof, old), new + aside).change)
        bare = let_pass(rng, new, 1.0, lose_side(rng, roof, 4.0))
        lost.append(judge((roof, old), bare + aside).change)
    assert lost.count(Change.UNCHANGED) <= (1 if density < 8 else 0)
    assert sum(change in (Change.CHANGED, Change.GONE) for change in lost) >= 32
    assert set(untouched) == {Change.UNCHANGED}


def let_pass(rng, points, share, inside=None):
    """Let a share of the pulses through to the ground, in all of a roof or `inside` a polygon."""
    passes = rng.random(len(points)) < share
    if inside is not None:
        passes &= shapely.intersects_xy(inside, *points[:, :2].T)
    return np.where(passes[:, None], points * (1, 1, 0), points)


@pytest.mark.parametrize("density", [4.0, 12.0, 24.0])
@pytest.mark.parametrize("before, after", [(0.0, 0.85), (0.3, 0.85), (0.85, 0.85), (0.85, 0.7)])
def test_glass_that_most_pulses_pass_still_stands(density, before, after, rng):
    found = []
    for _ in range(6):
        roof = make_roof(eave=4.0).roof
        old, new = (let_pass(rng, scan(rng, roof, density), share) for share in (before, after))
        found.append(judge((roof, old), new).change)
    allowed = {Change.UNCHANGED, Change.UNCERTAIN}
    assert sum(change in allowed for change in found) >= 5 and Change.GONE not in found


def test_a_conservatory_under_glass_is_not_pulled_down(rng):
    roof = make_roof(eave=4.0).roof
    west = shapely.box(-20, -20, -2, 20)
    glass = let_pass(rng, scan(rng, roof, 12.0), 0.85, west)
    bare = let_pass(rng, scan(rng, roof, 12.0), 1.0, west)
    assert judge((roof, scan(rng, roof, 12.0)), glass).change is Change.UNCERTAIN
    assert judge((roof, scan(rng, roof, 12.0)), bare).change is Change.CHANGED


def cover_with_leaves(rng, points):
    """A crown over a third of the roof, which lets a third of the pulses through."""
    hit = (points[:, 0] > 2.0) & (rng.random(len(points)) < 0.67)
    return points + np.column_stack([np.zeros((len(points), 2)), hit * rng.uniform(1, 5, len(hit))])


def cover_densely(rng, points):
    """A crown through which no pulse passes."""
    hit = points[:, 0] > 2.0
    return points + np.column_stack([np.zeros((len(points), 2)), hit * rng.uniform(1, 5, len(hit))])


def hang_a_jib(rng, points):
    hit = np.abs(points[:, 1]) < 0.4
    return points + np.column_stack(
        [np.zeros((len(points), 2)), hit * rng.uniform(9, 10, len(hit))]
    )


def hide_half(rng, points):
    return points[points[:, 0] < 0.5]


@pytest.mark.parametrize("disturb", [cover_with_leaves, cover_densely, hang_a_jib, hide_half])
@pytest.mark.parametrize("seed", range(5))
def test_what_only_hides_a_roof_is_no_change(disturb, seed):
    rng = np.random.default_rng(seed)
    roof = make_roof().roof
    verdict = judge((roof, scan(rng, roof)), disturb(rng, scan(rng, roof)))
    assert verdict.change in (Change.UNCHANGED, Change.UNCERTAIN)


def test_a_crown_that_hides_a_third_of_the_roof_makes_it_uncertain(rng):
    roof = make_roof().roof
    verdict = judge((roof, scan(rng, roof)), cover_densely(rng, scan(rng, roof)))
    assert verdict.change is Change.UNCERTAIN


def test_what_the_earlier_model_left_out_is_no_change(rng):
    roof = make_roof("flat").roof
    penthouse = change_building(rng, make_roof("flat"), "part_added").roof
    old, new = scan(rng, penthouse), scan(rng, penthouse)
    assert judge((roof, old), new).change is Change.UNCHANGED
    assert judge((roof, None), new).change is Change.CHANGED
    assert judge((roof, None), new, unexplained_m2=60.0).change is not Change.CHANGED


def test_a_stricter_significance_finds_fewer_changes(rng):
    roof = make_roof().roof
    dormer = change_building(rng, make_roof(), "small_object").roof
    points = scan(rng, roof), scan(rng, dormer)
    assert judge((roof, points[0]), points[1]).change is Change.CHANGED
    assert judge((roof, points[0]), points[1], significance=1e-250).change is Change.UNCHANGED


def test_chance_falls_with_size_and_score():
    assert compute_chance(4, 5.0, 100) < compute_chance(3, 5.0, 100) < compute_chance(2, 5.0, 100)
    assert compute_chance(3, 6.0, 100) < compute_chance(3, 5.0, 100)
    assert compute_chance(1, 3.3, 10**6) == 1.0


def test_the_common_shift_is_found_though_one_roof_in_five_changed(rng):
    shift, samples = np.array([0.16, -0.12, 0.05]), []
    for k in range(30):
        roof = random_building(rng).roof
        raised = (0.0, 0.0, 2.0) if k % 5 == 0 else (0.0, 0.0, 0.0)
        samples.append(SampledRoof(roof, scan(rng, roof), scan(rng, roof) + shift + raised))
    found = register_surveys(samples, ReadSettings())
    assert np.abs(np.array(found.xyz) - shift).max() < 0.03
    assert np.abs(found.clear_xyz - shift).max() < 0.03
    assert found.noise.roof < 0.05


def test_without_roofs_no_shift_is_applied():
    assert register_surveys([], ReadSettings()).clear_xyz.tolist() == [0.0, 0.0, 0.0]
