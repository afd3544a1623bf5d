"""The verdict: good where the points lie on the model, no better than fair where they speak against
it, whatever hides that.
"""

import dataclasses
import json
import re

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import hiproof
from hiproof import Grade
from hiproof.city.folder.ledger import Ledger
from hiproof.cli.running import graded_words
from hiproof.cli.status import describe, read_state
from hiproof.compose import compose
from hiproof.evaluate.layers import REACH, find_second_surface, unseen_share
from hiproof.evaluate.metrics import FACADE_M
from hiproof.evaluate.verdict import FEWEST_ON_PART, judge_model
from hiproof.model import Model
from hiproof.model.heights import find_highest
from hiproof.settings import Settings
from hiproof.simulate import random_compound
from points_of_roofs import sample_heights
from run_records import run_points
from tiny_town import make_town

OUTLINE = shapely.box(0.0, 0.0, 12.0, 9.0)
WALLS = [((12, 0.1, 6), 300), ((0.1, 9, 6), 200)]  # their far corner and how many points


def build_blocks(size, *blocks):
    """Flat roofs side by side from x to x (m) at a height, over a plan of that size."""
    ring = shapely.get_coordinates(shapely.box(0, 0, *size).exterior)[:-1].tolist()
    parts = [
        {
            "type": "flat",
            "parameters": {"width": size[1], "length": east - west},
            "position": [(west + east) / 2, size[1] / 2, height],
        }
        for west, east, height in blocks
    ]
    record = {"id": "a", "origin": [0, 0, 0], "z_ground": 0, "outline": [ring], "parts": parts}
    return hiproof.build(record).model


def block(height=6.0, size=(12.0, 9.0)):
    """A flat block over a plan, as a person would write it."""
    return build_blocks(size, (0.0, size[0], height))


def on_block(count=600, height=6.0, seed=0):
    rng = np.random.default_rng(seed)
    xy = rng.uniform((0, 0), (12, 9), (count, 2))
    return np.column_stack([xy, height + rng.normal(0.0, 0.03, count)])


def judge(*points):
    """The verdict on the block by points (n, 3) of several kinds."""
    return judge_model(block(), np.concatenate(points))


def cluster(count, height, centre=(6.0, 5.0), width=2.5):
    rng = np.random.default_rng(1)
    xy = np.array(centre) + rng.uniform(-width / 2, width / 2, (count, 2))
    return np.column_stack([xy, np.linspace(6.0 + 0.9 * height, 6.0 + height, count)])


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(2.0, 20.0))
def test_the_true_roof_is_good(seed, density):
    roof = random_compound(np.random.default_rng(seed)).roof
    points = sample_heights(
        lambda x, y: roof.height_at(np.column_stack([x, y])), roof.outline, density, 0.03, seed
    )
    model = Model(roof, compose(roof, 0.0).move(roof.frame.origin))
    on_parts = np.bincount(find_highest(roof.parts, points[:, :2])[1], minlength=len(roof.parts))
    assume((on_parts >= FEWEST_ON_PART).all())  # by chance a dormer has fewer at 2 points/m2
    assert judge_model(model, points).grade is Grade.GOOD


@settings(max_examples=10, deadline=None)
@given(st.floats(0.4, 20.0), st.sampled_from([-1.0, 1.0]))
def test_a_roof_with_three_fifths_of_all_its_points_off_is_poor(off_m, side):
    """Those off lie near the outline of a narrow building, where a share of inner points does not
    see them.
    """
    points = np.random.default_rng(2).uniform((0, 0), (12, 1.4), (400, 2))
    deviation = (np.arange(400) % 5 < 3) * side * off_m
    narrow = block(36.0, (12.0, 1.4))
    verdict = judge_model(narrow, np.column_stack([points, 36.0 + deviation]))
    assert verdict.grade is Grade.POOR
    assert any("% of its points lie within 0.2 m" in reason for reason in verdict.reasons)


def test_facade_points_say_nothing_of_a_roof():
    along, height = np.random.default_rng(3).uniform((0, 0.5), (12, 5.9), (900, 2)).T
    walls = np.column_stack([along, np.full(900, 0.05), height])
    assert judge(on_block(), walls) == (Grade.GOOD, ())


@pytest.mark.parametrize("with_footprint", [True, False])
def test_a_building_with_points_on_two_walls_alone_is_poor(with_footprint):
    rng = np.random.default_rng(4)
    south, west = (rng.uniform((0, 0, 0), to, (n, 3)) for to, n in WALLS)
    building = hiproof.reconstruct(np.vstack([south, west]), OUTLINE if with_footprint else None)
    assert building.grade is Grade.POOR
    assert "follows" not in building.detail and "% of its" in building.detail


@pytest.mark.parametrize("count", [5, 41, 296])
@pytest.mark.parametrize("height", [4.0, 30.0])
def test_points_far_above_a_model_are_named(count, height):
    verdict = judge(on_block(3000), cluster(count, height, width=1.5))
    assert verdict.grade is not Grade.GOOD
    high = f"{height:.{1 if height < 10 else 0}f}"
    assert f"{count} points up to {high} m above the model" in verdict.reasons


def test_birds_and_a_chimney_do_not_count():
    birds = np.column_stack([np.linspace(1, 11, 6), np.linspace(1, 8, 6), np.full(6, 30.0)])
    assert judge(on_block(3000), birds, cluster(20, 1.2, width=0.9)).grade is Grade.GOOD


def test_points_of_a_courtyard_that_the_outline_lacks_are_named():
    points = on_block(1500)
    yard = (abs(points[:, 0] - 6) < 1.5) & (abs(points[:, 1] - 4.5) < 1.5)
    points[yard, 2] -= 4.0
    verdict = judge_model(block(), points)
    assert verdict.grade is not Grade.GOOD
    assert any(reason.endswith("m below the model") for reason in verdict.reasons)


@pytest.mark.parametrize(
    ("side_m", "off_m"), [(10.0, -2.0), (10.0, 1.0), (30.0, 2.5), (80.0, -2.0), (80.0, 1.0)]
)
def test_a_place_of_several_square_metres_off_the_roof_is_never_good(side_m, off_m):
    """However large the building is."""
    model, good = block(6.0, (side_m, side_m)), []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        xy = rng.uniform(0, side_m, (int(4 * side_m**2), 2))
        middle = rng.uniform(3.0, side_m - 3.0, 2)
        is_off = (abs(xy - middle) < 1.75).all(axis=1)
        points = np.column_stack([xy, 6.0 + is_off * off_m + rng.normal(0, 0.05, len(xy))])
        good.append(judge_model(model, points).grade is Grade.GOOD)
    assert not any(good)


@pytest.mark.parametrize("count", [10, 60, 150])
@pytest.mark.parametrize("height", [1.0, 4.0, 12.0])
def test_the_wall_of_a_taller_neighbour_says_nothing_of_a_roof(count, height):
    """Its points lie over the outline, or a little to either side."""
    rng = np.random.default_rng(8)
    wall = rng.uniform((0, -0.2, 6), (12, 0.2, 6 + height), (count, 3))
    assert judge(on_block(), wall) == (Grade.GOOD, ())


def test_points_outside_the_outline_say_nothing_of_a_roof():
    assert judge(on_block(), on_block() + [13.0, 0.0, 5.0]) == (Grade.GOOD, ())


def test_points_over_a_place_that_no_part_covers_lie_above_the_ground_there():
    """A part that could not become a valid solid was left out."""
    left = dataclasses.replace(block().roof, parts=block(6.0, (7.0, 9.0)).roof.parts)
    model = Model(left, compose(left, 0.0).move(left.frame.origin))
    verdict = judge_model(model, on_block())
    assert verdict.grade is Grade.POOR
    assert any(reason.endswith("up to 6.1 m above the model") for reason in verdict.reasons)


@pytest.mark.parametrize(
    ("width_m", "too_wide_m", "high"),
    [
        (12.0, 0.0, 9.0),
        (12.0, 4.0, 98.0),
        (12.0, 8.0, 9.0),
        (80.0, 0.0, 98.0),
        (80.0, 4.0, 9.0),
        (80.0, 8.0, 98.0),
    ],
)
def test_a_tower_that_reaches_over_a_place_without_points_is_not_good(width_m, too_wide_m, high):
    """The place beside the tower holds no points, and the model goes on there at its height."""
    good, size, step_x = [], (width_m + 30.0, 30.0), width_m + too_wide_m
    model = build_blocks(size, (0.0, step_x, high), (step_x, size[0], 6.0))
    for seed in range(10):
        rng = np.random.default_rng(seed)
        xy = rng.uniform((0, 0), size, (int(4 * size[0] * size[1]), 2))
        xy = xy[(xy[:, 0] < width_m) | (xy[:, 0] > step_x)]
        z = np.where(xy[:, 0] < width_m, high, 6.0) + rng.normal(0, 0.05, len(xy))
        good.append(judge_model(model, np.column_stack([xy, z])).grade is Grade.GOOD)
    assert sum(good) >= 9 if too_wide_m == 0 else not any(good)


@pytest.mark.parametrize(
    ("off_m", "high", "density"),
    [
        (off_m, high, density)
        for off_m in (-3.0, -1.0, 1.0, 3.0)
        for high, density in ((9.0, 2), (20.0, 5))
    ],
)
def test_a_tall_step_in_a_wrong_place_is_not_good(off_m, high, density):
    rng = np.random.default_rng(1)
    xy = rng.uniform((0, 0), (12, 9), (12 * 9 * density, 2))
    points = np.column_stack([xy, np.where(xy[:, 0] < 7, 6.0, high) + rng.normal(0, 0.03, len(xy))])
    step = 7 + off_m
    assert judge_model(build_blocks((12, 9), (0, step, 6.0), (step, 12, high)), points).reasons
    assert not judge_model(build_blocks((12, 9), (0, 7, 6.0), (7, 12, high)), points).reasons


def test_points_off_along_the_outline_alone_do_not_count():
    """Gutters and what stands beside the walls give a few there, on old houses many."""
    rng = np.random.default_rng(6)
    points = on_block(1200)
    points[(points[:, 1] < 0.5) & (rng.random(1200) < 0.8), 2] -= 1.5
    assert judge_model(block(), points).grade is Grade.GOOD


@pytest.mark.parametrize("side_m", [12.0, 120.0])
def test_a_gentle_slope_under_a_level_roof_is_not_good(side_m):
    xy = np.random.default_rng(7).uniform(0, side_m, (int(4 * side_m**2), 2))
    points = np.column_stack([xy, 6.0 + 0.3 * (xy[:, 0] / side_m - 0.5)])
    verdict = judge_model(block(6.0, (side_m, side_m)), points)
    assert verdict.grade is Grade.FAIR and "rise another way" in verdict.reasons[0]


def test_half_a_building_without_points_is_poor_and_a_tenth_is_not():
    points = on_block(800)
    assert judge_model(block(), points[points[:, 0] < 6.0]).grade is Grade.POOR
    assert judge_model(block(), points[points[:, 0] < 11.0]).grade is not Grade.POOR


def run_over_spire(folder, code, max_points=20_000):
    """What the run writes of a house over whose middle 60 points of class `code` rise to 30 m."""
    town = make_town(1, density=40.0)
    middle = shapely.get_coordinates(town.footprints["house-0"].centroid)[0]
    xy = np.random.default_rng(5).uniform(-0.6, 0.6, (60, 2)) + middle
    xyz = np.concatenate([town.xyz, np.column_stack([xy, np.linspace(15, 32, 60)])])
    classes = np.append(town.classification, np.full(60, code, np.uint8))
    settings = Settings.from_dict({"city": {"max_points_a_building": max_points}})
    rows, summary = run_points(folder, xyz, classes, town.footprints, settings=settings)
    return rows["house-0"], summary


@pytest.mark.parametrize(("code", "max_points"), [(6, 20_000), (6, 1000), (18, 20_000)])
def test_neither_thinning_nor_a_class_of_noise_hides_a_spire(tmp_path, code, max_points):
    row, summary = run_over_spire(tmp_path, code, max_points)
    ledger = Ledger(tmp_path / "out" / ".hiproof" / "ledger.sqlite", read_only=True)
    lines = describe(ledger, read_state(ledger), str(tmp_path / "out"))
    assert f"quality: {graded_words({row['quality']: 1})}" in lines
    assert row["quality"] != "good" and "m above the model" in row["detail"]
    assert summary.by_quality == {row["quality"]: 1}
    assert json.loads((tmp_path / "out" / "run.json").read_text())["by_quality"] == {
        row["quality"]: 1
    }


UNMOVED = Settings.from_dict({"reconstruct": {"align": "off"}})
SEEDS = st.integers(0, 2**32 - 1)


def compound(seed, density=6.0, noise_m=0.03):
    """A compound roof, and points (n, 3) on it in its own frame."""
    roof = random_compound(np.random.default_rng(seed)).roof
    return roof, sample_heights(
        lambda x, y: roof.height_at(np.column_stack([x, y])), roof.outline, density, noise_m, seed
    )


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.floats(2.0, 20.0), st.floats(0.0, 0.3))
def test_points_of_one_roof_are_one_surface_whatever_their_noise(seed, density, noise_m):
    roof, points = compound(seed, density, noise_m)
    assert find_second_surface(points, roof) == (0.0, 0.0)


@settings(max_examples=20, deadline=None)
@given(
    SEEDS,
    st.floats(0.3, 6.0),
    st.floats(0.35, 0.65),
    st.sampled_from([-1.0, 1.0]),
    st.floats(0.0, 1.0),
)
def test_a_second_surface_is_seen_wherever_the_model_lies_between_them(
    seed, apart_m, share, side, model_height
):
    roof, points = compound(seed)
    raised = np.random.default_rng(seed).random(len(points)) < share
    points[:, 2] += side * apart_m * (raised - model_height)
    result, distance_m = find_second_surface(points, roof)
    assert result > 0.4
    assert distance_m == pytest.approx(apart_m, abs=0.05)


@settings(max_examples=10, deadline=None)
@given(SEEDS, st.floats(0.5, 5.0))
def test_a_part_that_the_model_lacks_is_no_second_surface(seed, height_m):
    roof, points = compound(seed)
    x0, _, x1, _ = roof.outline.bounds
    points[:, 2] += height_m * (points[:, 0] > x0 + 0.6 * (x1 - x0))
    assert find_second_surface(points, roof) == (0.0, 0.0)


def test_a_building_says_that_its_points_lie_on_two_surfaces():
    outline = shapely.box(0, 0, 12, 8)
    points = sample_heights(lambda x, y: 8 - 0.5 * abs(y - 4), outline)
    assert "two surfaces" not in hiproof.reconstruct(points, outline).detail
    points[::2, 2] += 0.4
    detail = hiproof.reconstruct(points, outline).detail
    (apart_m,) = re.findall(r"points lie on two surfaces, (\S+) m apart", detail)
    assert float(apart_m) == pytest.approx(0.4, abs=0.03)


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.floats(2.0, 20.0), st.floats(0.5, 0.6))
def test_a_part_without_points_is_told_of_whatever_their_density(seed, density, cut):
    roof, points = compound(seed, density)
    visible = points[points[:, 0] > np.quantile(points[:, 0], cut)]
    assume(len(visible) >= 30)  # fewer may be near all of a small roof
    assert 0.2 < unseen_share(visible, roof.outline) < cut + 0.2


@pytest.mark.parametrize("density", [2.0, 6.0, 20.0])
def test_points_everywhere_leave_next_to_nothing_unseen_whatever_their_density(density):
    roofs = [compound(seed, density) for seed in range(60)]
    shares = [unseen_share(points, roof.outline) for roof, points in roofs]
    assert np.mean(shares) < 0.002  # by chance one place in 15,000, more along the outline
    assert max(shares) < 0.03


@settings(max_examples=10, deadline=None)
@given(SEEDS, st.floats(2.0, 12.0), st.floats(20.0, 150.0), st.floats(4.0, 8.0))
def test_a_strip_without_points_shows_however_large_the_outline_is(seed, density, side_m, strip_m):
    points = np.random.default_rng(seed).uniform(0, side_m, (int(density * side_m**2), 2))
    points = points[points[:, 0] < side_m - strip_m]
    found_m = side_m * unseen_share(points, shapely.box(0, 0, side_m, side_m))
    gap_m = side_m / np.sqrt(len(points))  # between points, and between the places that are asked
    assert strip_m - (REACH + 1.0) * gap_m < found_m < strip_m


@settings(max_examples=10, deadline=None)
@given(SEEDS, st.floats(1.0, 6.0))
def test_the_share_without_points_is_that_of_all_distances_to_a_fine_grid(seed, density):
    roof, points = compound(seed, density)
    visible = points[points[:, 1] < np.quantile(points[:, 1], 0.6)]
    assume(len(visible) >= 100)  # as many places are asked
    west, south, east, north = roof.outline.bounds
    grid = np.stack(np.meshgrid(np.linspace(west, east, 101), np.linspace(south, north, 101)), -1)
    inner = roof.outline.buffer(-FACADE_M)  # walls of neighbours show nothing of a roof
    grid = grid[shapely.intersects_xy(inner, grid[..., 0], grid[..., 1])]
    inside = visible[shapely.intersects_xy(inner, *visible[:, :2].T), :2]
    gaps = np.array([np.hypot(*(inside - place).T).min() for place in grid])
    share = np.mean(gaps > REACH * np.sqrt(roof.outline.area / len(visible)))
    assert unseen_share(visible, roof.outline) == pytest.approx(share, abs=0.1)


def test_a_score_of_points_in_a_corner_of_a_large_outline_leaves_the_rest_unseen():
    points = sample_heights(
        lambda x, y: np.full(len(x), 5.0), shapely.box(0, 0, 2.5, 2.5), density=3.5
    )
    assert 12 <= len(points) < 30
    assert unseen_share(points, shapely.box(0, 0, 15, 10)) > 0.6
    assert unseen_share(points, shapely.box(0, 0, 2.5, 2.5)) == 0.0


@pytest.mark.parametrize("density", [2.0, 6.0, 15.0])
def test_a_rim_of_points_shows_no_roof(density):
    """Two sheds of Delft have points along their outlines alone, and were good."""
    outline = shapely.box(0, 0, 6.0, 3.8)
    points = sample_heights(lambda x, y: np.full(len(x), 2.9), outline, density=density)
    rim = points[~shapely.intersects_xy(outline.buffer(-0.28), *points[:, :2].T)]
    assert len(rim) >= 10 and unseen_share(rim, outline) > 0.6
    building = hiproof.reconstruct(rim, outline)
    assert building.grade is not Grade.GOOD
    assert "of its outline hold no points" in building.detail


def test_a_building_says_that_half_of_it_has_no_points():
    outline = shapely.box(0, 0, 12, 8)
    points = sample_heights(lambda x, y: 8 - 0.5 * abs(y - 4), outline)
    assert hiproof.reconstruct(points, outline).detail == ""
    detail = hiproof.reconstruct(points[points[:, 0] < 6], outline, settings=UNMOVED).detail
    assert "% of its outline hold no points; the roof there is a guess" in detail
