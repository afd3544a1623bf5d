"""Check roofs regrown, unseen places, and volumes that skewed walls keep apart."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from hiproof.fit.layout.plan import Cloud, measure_emptiness
from hiproof.fit.roof import fit_building
from hiproof.model import Roof
from points_of_roofs import scatter
from roof_zoo import FRAME

L_SHAPE = shapely.Polygon([(0, 0), (14, 0), (14, 7), (7, 7), (7, 15), (0, 15)])
U_SHAPE = shapely.Polygon([(0, 0), (20, 0), (20, 14), (14, 14), (14, 6), (6, 6), (6, 14), (0, 14)])


def test_two_hips_that_share_a_corner_are_two_hips():
    """Alike hips over the wings of an L: each plane of one goes on in the other."""
    xy = scatter_points(L_SHAPE, 6.0)
    arms = [(0, 14, 0, 7), (0, 7, 0, 15)]
    z = np.max(
        [
            np.min([xy[:, 0] - a, b - xy[:, 0], xy[:, 1] - c, d - xy[:, 1]], axis=0)
            for a, b, c, d in arms
        ],
        axis=0,
    )
    fit = fit_building(np.column_stack([xy, 5.0 + 0.7 * z]), L_SHAPE)
    assert len(fit.roof_parts) == 2
    assert {part.type for part in fit.roof_parts} <= {"hip", "side_hip"}


def scatter_points(outline, density):
    return scatter(outline, np.random.default_rng(1), density)


def test_a_gable_over_walls_that_are_not_parallel_is_one_part():
    outline = shapely.Polygon([(0, 0), (14, 0.9), (14, 8.2), (0, 8)])
    xy = scatter_points(outline, 6.0)
    lower, upper = 0.9 / 14.0, 0.2 / 14.0
    z = 6.0 + 0.7 * np.minimum((xy[:, 1] - lower * xy[:, 0]), (8.0 + upper * xy[:, 0] - xy[:, 1]))
    fit = fit_building(np.column_stack([xy, z]), outline)
    assert [part.type for part in fit.roof_parts] == ["gable"] or len(fit.roof_parts) == 1
    assert np.abs(Roof(fit.roof_parts, fit.outline, FRAME).height_at(xy) - z).mean() < 0.05


def test_what_a_wall_hides_is_the_lower_roof():
    """A strip beside a high wall without points, but for some along its far side."""
    outline = shapely.box(0, 0, 12, 8)
    xy = scatter_points(outline, 6.0)
    upper = xy[:, 0] < 9.5
    visible = upper | (xy[:, 0] > 11.4)
    fit = fit_building(np.column_stack([xy, np.where(upper, 9.0, 3.0)])[visible], outline)
    roof = Roof(fit.roof_parts, fit.outline, FRAME)
    strip = np.column_stack([np.full(7, 11.0), np.linspace(1.0, 7.0, 7)])
    assert np.abs(roof.height_at(strip) - 3.0).max() < 0.1


@given(st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_cells_are_as_empty_as_a_plain_count_says(seed):
    rng = np.random.default_rng(seed)
    nu, nv = rng.integers(1, 7, 2)
    i, j = rng.integers(0, nu, 9), rng.integers(0, nv, 9)
    expected = rng.uniform(0.1, 2.0, (nu, nv))
    result = measure_emptiness(Cloud(i + 0.5, j + 0.5, np.zeros(9), i, j), expected)
    for a in range(nu):
        for b in range(nv):
            count = ((np.abs(i - a) <= 1) & (np.abs(j - b) <= 1)).sum()
            usual = expected[max(a - 1, 0) : a + 2, max(b - 1, 0) : b + 2].sum()
            assert result[a, b] == pytest.approx(min(max(1.0 - 2.0 * count / usual, 0.0), 1.0))


def test_houses_beside_a_higher_one_are_told_apart():
    """Three gables in a row under one direction, the first and the last alike."""
    outline = shapely.box(0, 0, 18, 8)
    xy = scatter_points(outline, 8.0)
    middle = (xy[:, 0] > 6) & (xy[:, 0] < 12)
    z = 6.0 + 1.2 * middle - 0.7 * np.abs(xy[:, 1] - 4.0)
    fit = fit_building(np.column_stack([xy, z]), outline)
    assert [part.type for part in fit.roof_parts] == ["gable"] * 3
    lengths = sorted(part.parameters["length"] for part in fit.roof_parts)
    assert lengths == pytest.approx([6.0, 6.0, 6.0], abs=0.35)  # how far points lie apart


def test_gables_at_both_walls_below_a_ridge_are_two():
    """One gable under the roof from wall to wall would explain them as well.

    It does not stand out of the roof as a wing does.
    """
    outline = shapely.box(0, 0, 14, 10)
    xy = scatter_points(outline, 8.0)
    roof = 4.0 + 1.0 * (5.0 - np.abs(xy[:, 1] - 5.0))
    gable = 6.5 - 0.6 * np.abs(xy[:, 0] - 7.0)
    z = np.where(np.abs(xy[:, 0] - 7.0) < 2.0, np.maximum(roof, gable), roof)
    fit = fit_building(np.column_stack([xy, z]), outline)
    assert [part.type for part in fit.roof_parts] == ["gable"] * 3
    assert sorted(part.area for part in fit.roof_parts)[1] < 15.0


@pytest.mark.parametrize("wide", [5.0, 6.0, 7.0])
def test_a_level_roof_ends_where_a_gable_begins_whose_eaves_are_lower(wide):
    """Along the eaves only the points show that the level roof ends there."""
    outline = shapely.box(0, 0, 6.0 + wide, 10.7)
    xy = scatter_points(outline, 5.0)
    gable = 6.75 + 0.65 * (5.35 - np.abs(xy[:, 1] - 5.35))
    parts = fit_building(
        np.column_stack([xy, np.where(xy[:, 0] < 6.0, gable, 7.1)]), outline
    ).roof_parts
    areas = {part.type: part.area / 10.7 for part in parts}
    assert areas == {"gable": pytest.approx(6.0, abs=0.2), "flat": pytest.approx(wide, abs=0.2)}


def test_a_wing_that_crosses_the_roof_stays_one():
    outline = shapely.union(shapely.box(0, 0, 20, 8), shapely.box(7, -5, 13, 13))
    xy = scatter_points(outline, 8.0)
    main = np.where((xy[:, 1] > 0) & (xy[:, 1] < 8), 8.0 - 0.7 * np.abs(xy[:, 1] - 4.0), 0.0)
    wing = np.where((xy[:, 0] > 7) & (xy[:, 0] < 13), 7.0 - 0.7 * np.abs(xy[:, 0] - 10.0), 0.0)
    fit = fit_building(np.column_stack([xy, np.maximum(main, wing)]), outline)
    assert [part.type for part in fit.roof_parts] == ["gable"] * 2


def test_what_a_scanner_saw_of_a_wall_makes_no_plane():
    """A monopitch with returns of the wall under its upper edge."""
    outline = shapely.box(0, 0, 10, 6)
    rng = np.random.default_rng(2)
    xy = scatter_points(outline, 6.0)
    wall = np.column_stack(
        [rng.uniform(0, 10, 14), rng.uniform(5.7, 5.84, 14), rng.uniform(6.5, 8.0, 14)]
    )
    fit = fit_building(np.vstack([np.column_stack([xy, 5.0 + 0.55 * xy[:, 1]]), wall]), outline)
    assert [part.type for part in fit.roof_parts] == ["monopitch"]


def test_a_level_roof_is_one_part_however_long():
    """Longer than the raster's nodes lie close: its steps are no gaps."""
    outline = shapely.box(0, 0, 130, 14)
    xy = scatter_points(outline, 1.5)
    tower = (xy[:, 0] > 60) & (xy[:, 0] < 75)
    fit = fit_building(np.column_stack([xy, np.where(tower, 12.0, 6.0)]), outline)
    assert len(fit.roof_parts) <= 3
