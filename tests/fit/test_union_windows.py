"""Check that large roofs are searched block by block, and far parts do not matter."""

import numpy as np
import pytest
import shapely

from hiproof import reconstruct
from hiproof.compose import check_solid
from hiproof.fit.layout.blocks import BLOCK_M2, HeightRaster, find_cheapest_cut, find_step
from hiproof.fit.layout.plan import lay_out_plan
from hiproof.fit.layout.whole import lay_out_whole
from hiproof.fit.roof import fit_building
from hiproof.fit.roof.draft import Draft
from hiproof.fit.roof.tables import VOLUME_COUNT
from hiproof.settings import Settings
from hiproof.status import Status
from points_of_roofs import sample_heights

HALL = shapely.box(0, 0, 35, 22)
BOXES = [(x, y, x + 4.0, y + 3.0) for x in (3.0, 15.0, 27.0) for y in (3.0, 15.0)]


def compute_hall(x, y):
    """Return the heights of a level roof of 770 m2 with six boxes of 12 m2.

    The boxes stand 3 m above it.
    """
    z = np.full(np.shape(x), 8.0)
    for x0, y0, x1, y1 in BOXES:
        z = np.where((x > x0) & (x < x1) & (y > y0) & (y < y1), 11.0, z)
    return z


def measure_heights(fit, xy):
    return np.max([part.height_at(xy) for part in fit.roof_parts], axis=0)


def make_whole(height, outline, density=5.0):
    plan = lay_out_plan(sample_heights(height, outline, density, 0.02), outline)
    return lay_out_whole(plan, outline, Settings().compound)


def test_boxes_on_a_large_level_roof_are_found():
    fit = fit_building(sample_heights(compute_hall, HALL, 5.0, 0.02), HALL)
    xy = np.array([[0.5 * (x0 + x1), 0.5 * (y0 + y1)] for x0, y0, x1, y1 in BOXES])
    assert measure_heights(fit, xy) == pytest.approx(11.0, abs=0.03)
    assert measure_heights(fit, xy + [5.0, 0.0]) == pytest.approx(8.0, abs=0.03)
    assert len(fit.roof_parts) == 7


def test_the_roof_does_not_depend_on_the_order_of_its_points():
    points = sample_heights(compute_hall, HALL, 3.0, 0.02)
    first = fit_building(points, HALL)
    other = fit_building(points[np.random.default_rng(1).permutation(len(points))], HALL)
    assert len(first.roof_parts) == len(other.roof_parts)
    for own_piece, theirs in zip(first.roof_parts, other.roof_parts, strict=True):
        for piece, twin in zip(own_piece.pieces, theirs.pieces, strict=True):
            assert piece.outline.equals(twin.outline)
            assert np.array_equal(piece.planes, twin.planes)


def test_halves_far_apart_have_the_roofs_that_each_has_alone():
    left, right = shapely.box(0, 0, 26, 12), shapely.box(90, 0, 116, 12)
    joint = shapely.union_all([left, right, shapely.box(25, 5, 91, 7)])

    def gables(x, y):
        return np.where((x < 26) | (x > 90), 9.0 - 0.7 * np.abs(y - 6.0), 4.0) + np.where(
            x > 90, 1.0, 0.0
        )

    together = fit_building(sample_heights(gables, joint, 4.0, 0.02), joint)
    for half in (left, right):
        separate = fit_building(sample_heights(gables, half, 4.0, 0.02), half)
        inside = shapely.buffer(half, -0.5)
        x, y = np.meshgrid(np.arange(0.5, 116.0), np.arange(0.5, 12.0))
        xy = np.column_stack([x.ravel(), y.ravel()])
        xy = xy[shapely.contains_xy(inside, xy[:, 0], xy[:, 1])]
        assert measure_heights(together, xy) == pytest.approx(
            measure_heights(separate, xy), abs=0.03
        )
    assert sorted(part.type for part in together.roof_parts) == ["flat", "gable", "gable"]


def test_a_large_roof_is_a_valid_solid():
    model = reconstruct(sample_heights(compute_hall, HALL, 3.0, 0.02), HALL)
    assert model.status is Status.MODELLED
    assert not check_solid(model.built.solid)


def test_moves_make_no_one_roof_of_too_many_volumes(monkeypatch):
    """Moves over a whole town as one footprint held a run for a quarter of an hour."""
    improved, improve = [], Draft.improve

    def count_and_improve(draft, *arguments):
        improved.append(draft.roof.counts[VOLUME_COUNT])
        improve(draft, *arguments)

    monkeypatch.setattr(Draft, "improve", count_and_improve)
    monkeypatch.setattr("hiproof.fit.roof.grow.MOST_JOINED", 6)
    model = reconstruct(sample_heights(compute_hall, HALL, 3.0, 0.02), HALL)
    assert max(improved) < 7 <= len(model.parts)
    assert model.status is Status.MODELLED and not check_solid(model.built.solid)


def test_edges_of_a_long_roof_stay_where_its_steps_are():
    outline = shapely.box(0, 0, 200, 12)
    points = sample_heights(
        lambda x, y: 6.0 + 1.5 * (7 * (x // 10.0) % 4) + 0.0 * y, outline, 4.0, 0.02
    )
    assert fit_building(points, outline).unexplained < 0.001


def test_a_cut_falls_on_a_step_and_blocks_are_small():
    outline = shapely.box(-30, 0, 30, 15)
    whole = make_whole(lambda x, y: np.where(x < 8.0, 6.0, 9.0), outline)
    raster = HeightRaster(whole)
    axis, positions = find_cheapest_cut(raster, whole.box)
    step = whole.plan.frame.to_plan(np.array([[8.0, 7.5, 6.0]]))[0]
    assert outline.area > BLOCK_M2
    assert positions == pytest.approx(step[axis], abs=2 * raster.pitch)


def test_a_cut_stays_in_its_box():
    """A step beside the box drew the cut out of it, and the whole building failed."""
    outline = shapely.box(0, 0, 40, 20)
    whole = make_whole(lambda x, y: 6.0 + 9.0 * (x > 20.5) + 0.0 * y, outline, density=1.0)
    axis = int(np.argmax(np.ptp(whole.plan.uvz[:2], axis=1)))
    middle = float(np.mean(whole.box[2 * axis : 2 * axis + 2]))
    for half in whole.box.split(axis, middle):
        first, last = half[2 * axis : 2 * axis + 2]
        for place in (first + 0.5, last - 0.5):
            assert first < find_step(whole, half, axis, place, 1.2) < last


def test_equal_levels_of_a_long_row_are_equal_everywhere():
    """They were equal within groups of eight volumes, and off by millimetres between these."""
    outline = shapely.box(0, 0, 160, 6)
    points = sample_heights(lambda x, y: 6.0 + 3.0 * (x // 5.0 % 2) + 0.0 * y, outline, 4.0, 0.02)
    model = reconstruct(points, outline)
    levels = np.array([part.translation[2] for part in model.parts])
    assert len(levels) == 32
    assert len(set(np.round(levels, 6))) == 2
    assert not check_solid(model.built.solid)
