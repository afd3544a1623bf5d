"""Points of two surfaces, one over the other, are told from those of one roof, and a roof of which
a part has no points.
"""

import re

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import hiproof
from hiproof.evaluate.layers import REACH, find_second_surface, split_cells, unseen_share
from hiproof.settings import Settings
from hiproof.simulate import random_compound
from points_of_roofs import sample_heights

UNMOVED = Settings.from_dict({"reconstruct": {"align": "off"}})
SEEDS = st.integers(0, 2**32 - 1)


def compound(seed, density=6.0, noise_m=0.03):
    """A compound roof, and points (n, 3) on it in its own frame."""
    roof = random_compound(np.random.default_rng(seed)).roof
    return roof, sample_heights(
        lambda x, y: roof.height_at(np.column_stack([x, y])), roof.outline, density, noise_m, seed
    )


@settings(max_examples=40, deadline=None)
@given(SEEDS, st.floats(2.0, 20.0), st.floats(0.0, 0.3))
def test_points_of_one_roof_are_one_surface_whatever_their_noise(seed, density, noise_m):
    roof, points = compound(seed, density, noise_m)
    assert find_second_surface(points, roof) == (0.0, 0.0)


@settings(max_examples=40, deadline=None)
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


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.floats(0.5, 5.0))
def test_a_part_that_the_model_lacks_is_no_second_surface(seed, height_m):
    roof, points = compound(seed)
    x0, _, x1, _ = roof.outline.bounds
    points[:, 2] += height_m * (points[:, 0] > x0 + 0.6 * (x1 - x0))
    assert find_second_surface(points, roof) == (0.0, 0.0)


def test_the_split_of_a_cell_is_the_best_of_all():
    rng = np.random.default_rng(3)
    xy, values = rng.uniform(0, 4, (60, 2)), rng.normal(size=60)
    counts, smaller, steps, variances = split_cells(xy, values, 100.0)
    ordered = np.sort(values)
    k = min(range(1, 60), key=lambda k: ordered[:k].var() * k + ordered[k:].var() * (60 - k))
    unexplained = (ordered[:k].var() * k + ordered[k:].var() * (60 - k)) / 60 / values.var()
    assert counts.tolist() == [60] and smaller.tolist() == [min(k, 60 - k)]
    assert (steps[0], variances[0]) == pytest.approx(
        (ordered[k:].mean() - ordered[:k].mean(), unexplained)
    )


def test_a_building_says_that_its_points_lie_on_two_surfaces():
    outline = shapely.box(0, 0, 12, 8)
    points = sample_heights(lambda x, y: 8 - 0.5 * abs(y - 4), outline)
    assert "two surfaces" not in hiproof.reconstruct(points, outline).detail
    points[::2, 2] += 0.4
    detail = hiproof.reconstruct(points, outline).detail
    (apart_m,) = re.findall(r"points lie on two surfaces, (\S+) m apart", detail)
    assert float(apart_m) == pytest.approx(0.4, abs=0.03)


@settings(max_examples=40, deadline=None)
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


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.floats(2.0, 12.0), st.floats(20.0, 150.0), st.floats(4.0, 8.0))
def test_a_strip_without_points_shows_however_large_the_outline_is(seed, density, side_m, strip_m):
    points = np.random.default_rng(seed).uniform(0, side_m, (int(density * side_m**2), 2))
    points = points[points[:, 0] < side_m - strip_m]
    found_m = side_m * unseen_share(points, shapely.box(0, 0, side_m, side_m))
    gap_m = side_m / np.sqrt(len(points))  # between points, and between the places that are asked
    assert strip_m - (REACH + 1.0) * gap_m < found_m < strip_m


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.floats(1.0, 6.0))
def test_the_share_without_points_is_that_of_all_distances_to_a_fine_grid(seed, density):
    roof, points = compound(seed, density)
    visible = points[points[:, 1] < np.quantile(points[:, 1], 0.6)]
    assume(len(visible) >= 100)  # as many places are asked
    west, south, east, north = roof.outline.bounds
    grid = np.stack(np.meshgrid(np.linspace(west, east, 101), np.linspace(south, north, 101)), -1)
    grid = grid[shapely.intersects_xy(roof.outline, grid[..., 0], grid[..., 1])]
    gaps = np.array([np.hypot(*(visible[:, :2] - place).T).min() for place in grid])
    share = np.mean(gaps > REACH * np.sqrt(roof.outline.area / len(visible)))
    assert unseen_share(visible, roof.outline) == pytest.approx(share, abs=0.1)


def test_a_score_of_points_in_a_corner_of_a_large_outline_leaves_the_rest_unseen():
    points = sample_heights(
        lambda x, y: np.full(len(x), 5.0), shapely.box(0, 0, 2.5, 2.5), density=3.5
    )
    assert 12 <= len(points) < 30
    assert unseen_share(points, shapely.box(0, 0, 15, 10)) > 0.6
    assert unseen_share(points, shapely.box(0, 0, 2.5, 2.5)) == 0.0


def test_a_building_says_that_half_of_it_has_no_points():
    outline = shapely.box(0, 0, 12, 8)
    points = sample_heights(lambda x, y: 8 - 0.5 * abs(y - 4), outline)
    assert hiproof.reconstruct(points, outline).detail == ""
    detail = hiproof.reconstruct(points[points[:, 0] < 6], outline, settings=UNMOVED).detail
    assert "% of its outline hold no points; the roof there is a guess" in detail
