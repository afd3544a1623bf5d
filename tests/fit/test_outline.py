"""Outlines without footprints: no inward bias, straight edges, and sentences for points that are no
roof.
"""

from itertools import pairwise, product

import numpy as np
import pytest
import shapely
from scipy.stats import norm

from hiproof import Status, reconstruct
from hiproof.compose import check_solid
from hiproof.errors import FitError
from hiproof.evaluate.metrics import iou
from hiproof.fit.outline import close_slits, estimate_outline, with_courts
from hiproof.fit.outline.cost import (
    Border,
    apply_change,
    cost_at_depth,
    costs_by_depth,
    interpolate_cost,
    make_drawing,
    structure_cost,
)
from hiproof.fit.outline.lines import (
    BACK,
    drop_line,
    find_corners,
    make_lines,
    replace_lines,
    replaced_by,
)
from hiproof.fit.outline.settle import (
    BLURS_M,
    DEEP_M,
    OFFSETS_M,
    SHALLOW_M,
    STRAY_SHARE,
    WALLS_M,
    log_densities,
    log_likelihoods,
)
from hiproof.fit.outline.soft import SURE_BLURS
from hiproof.fit.outline.spread import unevenness
from hiproof.fit.outline.steps import RUN, add_steps, best_levels
from hiproof.fit.walls import on_walls
from points_of_roofs import scatter

ANYWHERE = (-np.inf, np.inf, -np.inf, np.inf)
L_SHAPE = shapely.Polygon([(0, 0), (16, 0), (16, 8), (7, 8), (7, 18), (0, 18)])
SHAPES = {
    "rectangle": shapely.box(0, 0, 14, 8),
    "l": L_SHAPE,
    "u": shapely.Polygon([(0, 0), (20, 0), (20, 16), (14, 16), (14, 7), (6, 7), (6, 16), (0, 16)]),
}


def points_in(outline, density, angle=0.3, seed=0):
    xy = scatter(outline, np.random.default_rng(seed), density)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return xy @ turn.T, shapely.transform(outline, lambda c: c @ turn.T)


def make_border(points, density, court, *prices):
    """The border of points (x, y, whether of a wall), with what corners and lines cost."""
    return Border(*points, density, court, ANYWHERE, 0.15, costs_by_depth(0.02), *prices)


def count_corners(outline):
    return len(outline.exterior.coords) - 1


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("density", [3.0, 8.0])
def test_the_outline_is_found_without_bias_and_with_the_corners_there_are(name, density):
    xy, truth = points_in(SHAPES[name], density)
    outline = estimate_outline(xy)
    assert outline.is_valid and not outline.interiors
    assert iou(outline, truth) > 0.96
    assert outline.area == pytest.approx(truth.area, rel=0.04)
    assert count_corners(outline) == count_corners(truth)


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_rows_of_points_along_a_side_do_not_draw_it_in(angle):
    x, y = np.meshgrid(np.arange(0.15, 14, 0.3), np.arange(0.4, 8, 0.8))
    xy = np.column_stack([x.ravel(), y.ravel()]) + np.random.default_rng(0).normal(
        0, 0.03, (x.size, 2)
    )
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    outline = estimate_outline(xy @ turn.T)
    assert iou(outline, shapely.transform(shapely.box(0, 0, 14, 8), lambda c: c @ turn.T)) > 0.98


def test_the_outline_turns_and_moves_with_the_points():
    """The last bits of the points may decide between two outlines that cost nearly the same."""
    xy, _ = points_in(L_SHAPE, 6.0, angle=0.1)
    outline, likeness = estimate_outline(xy), []
    for angle in np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, 12):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        moved = estimate_outline(xy @ turn.T + [3.0, -5.0])
        expected = shapely.transform(outline, lambda c, turn=turn: c @ turn.T + [3.0, -5.0])
        likeness.append(iou(moved, expected))
    assert min(likeness) > 0.99 and np.mean(np.array(likeness) > 0.999) >= 0.5


def test_points_on_the_walls_do_not_push_the_sides_out():
    xy, truth = points_in(L_SHAPE, 6.0)
    rng = np.random.default_rng(1)
    walls = shapely.get_coordinates(
        truth.exterior.interpolate(rng.uniform(0, truth.exterior.length, 150))
    )
    outline = estimate_outline(
        np.concatenate([xy, walls]) + rng.normal(0, 0.06, (len(xy) + 150, 2))
    )
    assert (outline.area - truth.area) / truth.length == pytest.approx(0.0, abs=0.04)
    assert count_corners(outline) == 6


def scan_by_drone(overhang, roof_density, walls_a_metre):
    """Points (n, 3) of a level roof and of the walls below, `overhang` metres behind its eaves; and
    the eaves.
    """
    rng = np.random.default_rng(4)
    truth = shapely.box(0, 0, 14, 8)
    roof, _ = points_in(truth, roof_density, angle=0.0)
    line = truth.buffer(-overhang, join_style="mitre").exterior
    walls = shapely.get_coordinates(
        line.interpolate(rng.uniform(0, line.length, int(walls_a_metre * line.length)))
    )
    z = np.concatenate([np.full(len(roof), 6.0), rng.uniform(0.5, 5.5, len(walls))])
    return np.column_stack([np.concatenate([roof, walls]), z]) + rng.normal(
        0, 0.02, (len(z), 3)
    ), truth


@pytest.mark.parametrize("overhang", [0.5, 0.7])
def test_walls_seen_below_wide_eaves_do_not_pull_the_outline_in(overhang):
    points, truth = scan_by_drone(overhang, roof_density=40.0, walls_a_metre=60)
    assert shapely.hausdorff_distance(estimate_outline(points).exterior, truth.exterior) < 0.15


def test_outlines_are_drawn_straight_where_most_points_are_of_walls():
    points, truth = scan_by_drone(0.6, roof_density=25.0, walls_a_metre=200)
    outline = estimate_outline(points)
    assert count_corners(outline) == 4
    assert shapely.hausdorff_distance(outline.exterior, truth.exterior) < 0.2


def test_an_oblique_wall_is_drawn_as_one():
    xy, truth = points_in(shapely.Polygon([(0, 0), (16, 0), (11, 9), (0, 9)]), 6.0)
    outline = estimate_outline(xy)
    assert count_corners(outline) == 4 and iou(outline, truth) > 0.96


def scan_block(outline, seed=0, height=6.0, step_at=None):
    """Points (n, 3), evenly spread, 5 a square metre, of a level roof with walls; beyond x =
    `step_at` three metres lower.
    """
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = outline.bounds
    xy = np.stack(np.meshgrid(np.arange(x0, x1, 0.45), np.arange(y0, y1, 0.45)), -1).reshape(-1, 2)
    xy = xy + rng.uniform(-0.15, 0.15, xy.shape)
    roof = xy[shapely.contains_xy(outline, *xy.T)]
    border = outline.boundary
    if step_at is not None:
        border = border.union(
            shapely.LineString([(step_at, y0), (step_at, y1)]).intersection(outline)
        )
    places = [
        line.interpolate(rng.uniform(0, line.length, int(3 * line.length)))
        for line in shapely.get_parts(border)
    ]
    walls = shapely.get_coordinates(np.concatenate(places))
    top = np.where(
        np.concatenate([roof, walls])[:, 0] > (np.inf if step_at is None else step_at + 0.01),
        height - 3,
        height,
    )
    z = top - np.r_[np.zeros(len(roof)), rng.uniform(0.0, 6.0, len(walls))]
    return np.column_stack([np.concatenate([roof, walls]) + rng.normal(0, 0.05, (len(z), 2)), z])


@pytest.mark.parametrize("depth", [0.6, -0.6])
def test_a_shallow_bay_is_drawn_where_its_walls_are_seen(depth):
    bay = shapely.box(4, 8 + min(depth, 0), 8, 8 + max(depth, 0))
    truth = shapely.box(0, 0, 14, 8).symmetric_difference(bay)
    outline = estimate_outline(scan_block(truth), 0.0)
    assert count_corners(outline) == 8 and iou(outline, truth) > 0.97


def test_walls_of_a_step_inside_are_walls_but_draw_no_side():
    points = scan_block(shapely.box(0, 0, 14, 8), step_at=9.0)
    wall = on_walls(points, points, 0.4)
    x, y = points[:, :2].T
    inner = (
        (abs(x - 9.0) < 0.2) & (abs(y - 4.0) < 3.0) & (points[:, 2] < 4.5) & (points[:, 2] > 3.3)
    )
    deep = (abs(x - 4.0) < 3.0) & (abs(y - 4.0) < 3.0)
    assert wall[inner].mean() > 0.9 and not wall[deep].any()
    assert wall[(x < 0.05) & (points[:, 2] < 4.5)].mean() > 0.8
    assert count_corners(estimate_outline(points, 0.0)) == 4


def test_a_bay_drawn_as_a_wedge_becomes_one_with_right_angles():
    truth = shapely.box(0, 0, 14, 8) - shapely.box(5, 6.5, 8, 8)
    x, y = points_in(truth, 8.0, angle=0.0)[0].T
    order = np.argsort(y)
    points = x[order], y[order], np.zeros(len(x), bool)
    border = make_border(points, 8.0, False, 3.0, 3.0, 1.0, 6.0)
    wedge = [(0, 0), (14, 0), (14, 8), (8.5, 8), (6.5, 6), (4.5, 8), (0, 8)]
    drawing = make_drawing(make_lines(np.array(wedge, float)), 0.0, border)
    assert len(add_steps(drawing, border, 1).lines) == 7  # no matter of single sides
    result = add_steps(drawing, border, RUN)
    assert len(result.lines) == 8 and result.cost < drawing.cost
    assert iou(shapely.Polygon(result.corners), truth) > 0.96


def test_a_slit_beside_a_high_wall_is_closed_and_a_wide_bay_stays():
    house, annex = shapely.box(0, 0, 14, 8), shapely.box(2, 8.9, 9, 12)
    touching = shapely.union_all([house, annex, shapely.box(8, 8, 9, 8.9)])
    outline = estimate_outline(points_in(touching, 18.0, angle=0.0)[0], 0.0)
    assert count_corners(outline) == 8
    assert iou(outline, house | shapely.box(2, 8, 9, 12)) > 0.97
    bay = house - shapely.box(5, 4, 7, 8)
    assert count_corners(estimate_outline(points_in(bay, 18.0, angle=0.0)[0], 0.0)) == 8


def test_a_slit_that_becomes_wide_is_left_as_it_is():
    wedge = shapely.Polygon([(0, 0), (14, 0), (14, 8), (9, 8), (7, 2), (5, 8), (0, 8)])
    assert close_slits(wedge) is wedge


def test_an_outline_ends_in_no_spike():
    xy, truth = points_in(shapely.box(0, 0, 14, 8), 8.0, angle=0.0)
    trail = np.column_stack([np.linspace(14, 20, 13), 8.0 + np.linspace(0.0, 0.4, 13)])
    outline = estimate_outline(np.concatenate([xy, trail]))
    azimuth = make_lines(
        shapely.get_coordinates(shapely.geometry.polygon.orient(outline).exterior)[:-1]
    )[:, 0]
    assert np.cos(azimuth - np.roll(azimuth, 1)).min() > BACK
    assert iou(outline, truth) > 0.95
    spike = np.array([(0, 0), (14, 0), (20, 8.2), (13.8, 7.7), (0, 8)], float)
    assert not find_corners(make_lines(spike), np.empty_like(spike), -1)


@pytest.mark.parametrize("name", ["rectangle", "l"])
def test_a_court_is_drawn_as_the_outline_is(name):
    court = {
        "rectangle": shapely.box(5, 5, 10, 9),
        "l": shapely.Polygon([(4, 4), (14, 4), (14, 7), (7, 7), (7, 10), (4, 10)]),
    }[name]
    truth = shapely.box(0, 0, 18, 14) - court
    outline = estimate_outline(scan_block(truth), 0.0)
    assert len(outline.interiors) == 1 and count_corners(outline) == 4
    assert count_corners(shapely.Polygon(outline.interiors[0])) == count_corners(court)
    assert iou(shapely.Polygon(outline.interiors[0]), court) > 0.95


def test_a_gap_in_a_roof_that_is_smaller_than_a_building_is_no_court():
    truth = shapely.box(0, 0, 14, 10)
    assert not estimate_outline(scan_block(truth - shapely.box(6, 4, 7.7, 5.7)), 0.0).interiors


def test_a_block_with_a_court_has_a_valid_solid_with_one():
    building = reconstruct(scan_block(shapely.box(0, 0, 18, 14) - shapely.box(5, 5, 10, 9)))
    assert building.status is Status.MODELLED and not check_solid(building.solid)
    assert len(building.roof.outline.interiors) == 1
    assert building.roof.outline.area == pytest.approx(18 * 14 - 20, rel=0.03)


def test_courts_that_are_bays_already_or_would_cut_a_roof_in_two_are_left_out():
    outline = shapely.box(0, 0, 20, 10)
    inside, bay, across = (
        shapely.box(4, 4, 7, 7),
        shapely.box(9, 9, 12, 14),
        shapely.box(9, -1, 11, 11),
    )
    assert with_courts(outline, [inside, bay]).equals(outline - inside)
    assert with_courts(outline, [across]).equals(outline)
    assert with_courts(outline, [shapely.box(9, 1, 12, 10.2)]).area == pytest.approx(
        outline.area - 27
    )


def test_levels_of_columns_are_the_cheapest_of_all():
    rng = np.random.default_rng(7)
    for _ in range(20):
        costs, step = rng.exponential(2.0, (5, 4)), rng.uniform(0.5, 3.0)
        price = {
            levels: sum(costs[range(5), levels]) + step * sum(a != b for a, b in pairwise(levels))
            for levels in product(range(4), repeat=5)
        }
        assert price[tuple(best_levels(costs, step))] == pytest.approx(min(price.values()))


def test_points_of_chance_are_as_uneven_as_chance_and_rows_are_less():
    rng, box = np.random.default_rng(2), shapely.box(0, 0, 30, 30)
    assert unevenness(rng.uniform(0, 30, (4500, 2)), box, 0.45) == pytest.approx(1.0, abs=0.1)
    assert unevenness(scan_block(box)[:, :2], box, 0.45) < 0.7
    assert unevenness(rng.uniform(0, 2, (20, 2)), shapely.box(0, 0, 2, 2), 0.45) == 1.0


@pytest.mark.parametrize("court", [False, True])
def test_a_change_is_drawn_and_priced_as_if_all_were_drawn_anew(court):
    rng = np.random.default_rng(3)
    x, y = rng.uniform(0, 10, (2, 300))
    points = x, np.sort(y), rng.random(300) < 0.3
    border = make_border(points, 3.0, court, 2.5, 3.0, 1.0, 6.0)
    ring = np.array([(0, 0), (9.8, 0.4), (9.5, 6), (4, 6.2), (4.1, 10), (0, 9.7)], float)
    lines = make_lines(ring[::-1] if court else ring)
    drawing = make_drawing(lines, 0.0, border)
    priced = 0
    for i in range(len(lines)):
        notch = lines[[i] * 3] + [(0.0, 0.0), (np.pi / 2, 0.0), (0.0, -0.8)]
        middle = drawing.corners[[i, (i + 1) % len(lines)]].mean(axis=0)
        notch[1, 1] = middle @ [np.cos(notch[1, 0]), np.sin(notch[1, 0])]
        changes = [(replace_lines(lines, i, 1, lines[i, 0] + 0.05, lines[i, 1] + 0.3), 2)]
        changes += [(drop_line(lines, i), 1), (replaced_by(lines, i, 1, notch), 4)]
        for new, expected in changes:
            change = new, drawing, i, 1, expected, border
            result, redrawn = apply_change(*change, np.inf), make_drawing(new, 0.0, border)
            if np.isfinite(redrawn.cost):
                assert apply_change(*change, result.cost - 1e-6).cost == np.inf
                assert apply_change(*change, result.cost + 1e-6).cost < np.inf
                assert result.cost == pytest.approx(redrawn.cost)
                assert result.structure == redrawn.structure
                assert result.own == pytest.approx(redrawn.own)
                assert result.corners == pytest.approx(redrawn.corners)
                priced += 1
    assert priced >= 12


@pytest.mark.parametrize("wall", [False, True])
def test_what_points_cost_is_looked_up_as_it_is_computed(wall):
    for depth in np.random.default_rng(5).uniform(-5.0, 5.0, 300).tolist():
        sure = min(max(depth, -SURE_BLURS), SURE_BLURS)
        expected = cost_at_depth(sure, wall, 0.02)
        assert interpolate_cost(depth, wall, costs_by_depth(0.02)) == pytest.approx(
            expected, abs=5e-5
        )


def test_lines_skew_ones_directions_and_sharp_corners_have_their_prices():
    border = make_border(np.zeros((3, 0)), 3.0, False, 3.0, 5.0, 1.0, 7.0)
    rings = {"square": [(0, 0), (8, 0), (8, 6), (0, 6)], "wedge": [(0, 0), (12, 0), (0, 5)]}
    rings |= {"slant": [(0, 0), (9, 0), (7, 6), (-2, 6)]}
    costs = {
        k: structure_cost(make_lines(np.array(ring, float)), 0.0, border)
        for k, ring in rings.items()
    }
    assert costs == {"square": 12.0, "wedge": 9.0 + 5.0 + 1.0 + 7.0, "slant": 12.0 + 5.0 + 2 * 1.0}


def test_the_given_direction_is_that_of_the_edges():
    xy, _ = points_in(L_SHAPE, 8.0, angle=0.5)
    edges = np.diff(shapely.get_coordinates(estimate_outline(xy, kappa=0.5).exterior), axis=0)
    angle = np.abs(np.angle(np.exp(4j * (np.arctan2(edges[:, 1], edges[:, 0]) - 0.5)))) / 4
    length = np.hypot(edges[:, 0], edges[:, 1])
    assert length[angle < 0.02].sum() > 0.8 * length.sum()


@pytest.mark.parametrize(
    "xy", [np.zeros((0, 2)), np.zeros((5, 2)), np.column_stack([np.arange(6.0), np.arange(6.0)])]
)
def test_points_that_span_no_area_are_an_error_with_a_sentence(xy):
    with pytest.raises(FitError, match="expected points that span an area"):
        estimate_outline(xy)


@pytest.mark.parametrize("seed", range(6))
def test_kept_densities_say_of_a_side_what_its_points_do(seed):
    rng = np.random.default_rng(seed)
    depth, a_metre = rng.uniform(-0.79, DEEP_M, 60), rng.uniform(2.0, 90.0)
    shallow = depth[depth < SHALLOW_M - OFFSETS_M[0]]
    for row, (blur, walls) in enumerate(product(BLURS_M, WALLS_M)):
        distance = (shallow[:, None] + OFFSETS_M) / blur
        density = np.where(
            np.abs(distance) > SURE_BLURS,
            distance > 0.0,
            norm.cdf(distance) + walls * norm.pdf(distance) / blur,
        )
        logs = np.log(a_metre * (density + STRAY_SHARE)).sum(axis=0) - a_metre * (
            DEEP_M + OFFSETS_M + walls
        )
        difference = np.abs(log_likelihoods(depth, a_metre, log_densities())[row] - logs)
        # where it is cut off the density jumps by a third
        assert np.median(difference) < 1e-3 * len(shallow) and difference.max() < 0.6
