"""Check fitting a building: results, what they do not depend on, and bad input."""

import numpy as np
import pytest
import shapely

from hiproof.errors import FitError, InputError
from hiproof.evaluate.metrics import iou
from hiproof.fit import fit_roof
from hiproof.fit.roof import fit_building
from hiproof.model import Roof
from hiproof.settings import Settings
from points_of_roofs import sample_heights


def gable_with_shed(x, y):
    """A gable of 8 x 7 m with a flat extension behind it, for x beyond 8."""
    return np.where(x < 8.0, 8.0 - 0.9 * np.abs(y - 3.5), 3.0)


STEP_M = 0.1  # how near a step is to where it should be
HOUSE = shapely.box(0, 0, 12, 7)
L_SHAPE = shapely.Polygon([(0, 0), (12, 0), (12, 6), (5, 6), (5, 14), (0, 14)])
COURTYARD = shapely.Polygon(
    shapely.box(0, 0, 14, 14).exterior.coords, [shapely.box(5, 5, 9, 9).exterior.coords]
)
TRIANGLE = shapely.Polygon([(0, 0), (9, 0), (2, 7)])
STAR = shapely.Polygon(
    [
        (6 * r * np.cos(a), 6 * r * np.sin(a))
        for a, r in zip(
            np.linspace(0, 2 * np.pi, 240, endpoint=False),
            np.tile([1.0, 0.9, 1.05], 80),
            strict=True,
        )
    ]
)
SLENDER = shapely.box(0, 0, 30, 0.4)
OUTLINES = {
    "house": HOUSE,
    "l": L_SHAPE,
    "courtyard": COURTYARD,
    "triangle": TRIANGLE,
    "star": STAR,
    "slender": SLENDER,
}


def measure_height(fit, xy):
    return Roof(fit.roof_parts, fit.outline, None).height_at(xy)


def test_a_house_with_a_flat_extension_is_three_planes():
    points = sample_heights(gable_with_shed, HOUSE)
    fit = fit_building(points, HOUSE)
    planes = {
        tuple(np.round(plane, 9))
        for part in fit.roof_parts
        for piece in part.pieces
        for plane in piece.planes
    }
    assert len(planes) == 3
    is_away = np.abs(points[:, 0] - 8.0) > STEP_M
    gap = measure_height(fit, points[:, :2]) - points[:, 2]
    assert np.sqrt(np.mean(gap[is_away] ** 2)) < 0.05
    assert fit.unexplained < 0.005


@pytest.mark.parametrize("name", OUTLINES)
@pytest.mark.parametrize("points_wanted", [1, 2, 3, 4, 7, 30, 400])
def test_pieces_cover_the_outline_and_stay_near_the_points(name, points_wanted):
    outline = OUTLINES[name]
    points = sample_heights(
        lambda x, y: 5.0 + np.where(x + y > 6.0, 2.0, 0.1 * x), outline, density=60.0
    )[:points_wanted]
    fit = fit_building(points, outline)
    outlines = [piece.outline for part in fit.roof_parts for piece in part.pieces]
    assert all(polygon.is_valid and polygon.area > 0.0 for polygon in outlines)
    assert shapely.union_all(outlines).symmetric_difference(outline).area < 1e-6 * outline.area
    corners = np.concatenate([shapely.get_coordinates(polygon) for polygon in outlines])
    inside = points[:, 2]
    heights = measure_height(fit, corners)
    heights = heights[np.isfinite(heights)]
    slope = max(
        np.hypot(*piece.planes[:, :2].T).max() for part in fit.roof_parts for piece in part.pieces
    )
    extra = 0.5 + slope * (0.45 + 0.7 * np.sqrt(outline.area / len(points)))
    assert inside.min() - extra <= heights.min() and heights.max() <= inside.max() + extra


def test_fewer_than_four_points_give_a_flat_roof_at_their_median():
    fit = fit_building(np.array([[1.0, 1.0, 4.0], [2.0, 2.0, 5.0], [3.0, 1.0, 9.0]]), HOUSE)
    assert [part.type for part in fit.roof_parts] == ["flat"]
    assert fit.roof_parts[0].pieces[0].planes[0] == pytest.approx([0.0, 0.0, 5.0])


def test_points_outside_the_outline_do_not_count():
    points = sample_heights(gable_with_shed, HOUSE)
    neighbours = sample_heights(lambda x, y: 20.0 + 0.0 * x, shapely.box(12.5, 0, 20, 7))
    assert (
        fit_building(np.vstack([points, neighbours]), HOUSE).objective
        == fit_building(points, HOUSE).objective
    )


def test_one_unseen_side_of_a_gable_grows_no_spike():
    points = sample_heights(lambda x, y: 8.0 - 0.9 * np.abs(y - 3.5), HOUSE)
    visible = points[points[:, 1] < 3.6]
    fit = fit_building(visible, HOUSE)
    corners = np.concatenate(
        [shapely.get_coordinates(p.outline) for part in fit.roof_parts for p in part.pieces]
    )
    heights = np.concatenate(
        [p.height_at(corners) for part in fit.roof_parts for p in part.pieces[:1]]
    )
    assert np.nanmax(measure_height(fit, corners)) <= visible[:, 2].max() + 0.5
    assert len(heights)


def test_no_points_inside_the_outline_is_an_error_with_a_sentence():
    with pytest.raises(FitError, match="roof points inside the outline"):
        fit_building(np.array([[100.0, 100.0, 3.0]]), HOUSE)


@pytest.mark.parametrize("columns", [[0, 1], [0, 1, 2, 2]])
def test_points_of_another_shape_are_not_taken_for_others(columns):
    points = sample_heights(gable_with_shed, HOUSE)[:, columns]
    with pytest.raises(InputError, match=r"shape \(n, 3\)"):
        fit_building(points, HOUSE)


@pytest.mark.parametrize(
    "outline",
    [shapely.Polygon(), shapely.LineString([(0, 0), (9, 9)]), shapely.box(0, 0, np.inf, 7)],
)
def test_an_outline_without_area_is_an_error_with_a_sentence(outline):
    with pytest.raises(FitError, match="expected an outline with an area"):
        fit_building(sample_heights(gable_with_shed, HOUSE), outline)


def test_points_that_are_not_finite_are_left_out():
    points = sample_heights(gable_with_shed, HOUSE)
    dirty = np.vstack([points, [[1.0, 1.0, np.nan], [np.inf, 2.0, 3.0]]])
    assert fit_building(dirty, HOUSE).objective == fit_building(points, HOUSE).objective


def test_repeated_points_and_points_on_a_line_are_survived():
    line = np.column_stack([np.linspace(0.5, 11.5, 50), np.full(50, 3.0), np.full(50, 4.0)])
    for points in (line, np.repeat(line[:1], 30, axis=0), np.vstack([line, line])):
        fit = fit_building(points, HOUSE)
        assert measure_height(fit, points[:, :2]) == pytest.approx(points[:, 2], abs=0.05)


def test_a_single_gable_comes_out_as_from_the_single_primitive_road():
    points = sample_heights(lambda x, y: 8.0 - 0.9 * np.abs(y - 3.5), HOUSE)
    part = fit_building(points, HOUSE).roof_parts[0]
    separate = fit_roof(points, outline=HOUSE)
    assert part.type == separate.type == "gable"
    for name, value in separate.parameters.items():
        assert part.parameters[name] == pytest.approx(value, abs=max(separate.sigma[name], 1e-9))
    assert part.translation == pytest.approx(
        separate.translation + separate.global_translation, abs=separate.sigma["t_z"]
    )
    assert part.kappa == pytest.approx(separate.kappa)


def test_parts_are_named_by_the_catalogue_with_parameters_and_deviations():
    parts = {
        part.type: part
        for part in fit_building(sample_heights(gable_with_shed, HOUSE), HOUSE).roof_parts
    }
    assert set(parts) == {"gable", "flat"}
    assert parts["gable"].parameters["height"] == pytest.approx(0.9 * 3.5, abs=0.05)
    assert 0.0 < parts["gable"].sigma["height"] < 0.05
    assert parts["flat"].translation[2] == pytest.approx(3.0, abs=0.02)


def tooth_edges(fit):
    """Where the teeth of a hall end along y."""
    bounds = [piece.outline.bounds for part in fit.roof_parts for piece in part.pieces]
    return np.unique(np.round([box[k] for box in bounds for k in (1, 3)], 6))


def test_teeth_are_equally_wide_however_the_points_beside_a_step_lie():
    hall = shapely.box(0, 0, 12, 15)
    points = sample_heights(lambda x, y: 4.0 + 0.5 * (y % 5.0), hall)
    points[:, :2] += np.random.default_rng(1).normal(0.0, 0.05, (len(points), 2))
    fit = fit_building(points, hall)
    assert [part.type for part in fit.roof_parts] == ["shed"]
    assert fit.roof_parts[0].parameters["teeth"] == 3
    assert tooth_edges(fit) == pytest.approx([0.0, 5.0, 10.0, 15.0], abs=1e-3)


def test_uneven_teeth_stay_uneven():
    edges = np.array([0.0, 5.0, 10.4, 15.0])
    hall = shapely.box(0, 0, 12, 15)
    points = sample_heights(
        lambda x, y: 4.0 + 0.5 * (y - edges[np.searchsorted(edges, y, side="right") - 1]), hall
    )
    fit = fit_building(points, hall)
    # A saw-tooth's parameters say one width.
    assert {part.type for part in fit.roof_parts} == {"monopitch"}
    result = np.unique(np.round(tooth_edges(fit), 1))
    assert result == pytest.approx(edges, abs=0.11)


@pytest.mark.parametrize(
    ("half_width", "depth", "top", "parts"),
    [
        (0.9, 2.0, 8.0, {"main": 1, "full": 2, "fine": 2}),
        (0.4, 0.8, 6.8, {"main": 1, "full": 1, "fine": 2}),
    ],
)
def test_detail_says_how_small_a_dormer_may_be(half_width, depth, top, parts):
    def with_dormer(x, y):
        dormer = (abs(x - 6) < half_width) & (y > 1.0) & (y < 1.0 + depth)
        return np.where(dormer, top, 8.0 - 0.9 * np.abs(y - 3.5))

    points = sample_heights(with_dormer, HOUSE)
    result = {
        detail: len(
            fit_building(
                points, HOUSE, Settings.from_dict({"compound": {"detail": detail}})
            ).roof_parts
        )
        for detail in parts
    }
    assert result == parts


def test_without_an_outline_the_plan_is_estimated():
    points = sample_heights(gable_with_shed, HOUSE)
    fit = fit_building(points)
    assert iou(fit.outline, HOUSE) > 0.9
    assert fit.unexplained < 0.1
