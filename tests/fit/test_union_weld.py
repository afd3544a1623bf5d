"""Check welding: a repair is kept if the roof gets cheaper, and outlines stay."""

import importlib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

from hiproof.compose import compose
from hiproof.fit import union
from hiproof.fit.union import fit_building
from hiproof.fit.union.allowed import list_allowed_shapes
from hiproof.fit.union.drawn_plan import DrawnPlan
from hiproof.fit.union.plan import lay_out_plan
from hiproof.fit.union.repairs import find_repairs
from hiproof.fit.union.scene import make_scene
from hiproof.fit.union.sides import Side
from hiproof.fit.union.volumes import COLUMNS, LEVEL, U0, V1
from hiproof.model.heights import find_highest
from hiproof.simulate import Defects, ScanSettings, random_compound, scan_solids
from points_of_roofs import sample_heights

weld = importlib.import_module("hiproof.fit.union.weld")


def scan_compound(kind, seed):
    """Return points and outline of a simulated compound, 5 points a square metre."""
    roof = random_compound(np.random.default_rng(seed), kind).roof
    settings = ScanSettings(density=5.0, defects=Defects.none())
    cloud = scan_solids([compose(roof, -3.0)], np.random.default_rng(seed), settings)
    return cloud.points[cloud.points[:, 2] > -2.0], roof.outline


def capture_problem(monkeypatch, kind, seed):
    """Return the arguments of `weld` for a compound: its problem and first state."""
    visible = {}

    def spy(volumes, sides, agreement, site, base):
        visible["problem"] = weld.make_problem(volumes, agreement, site, base)
        visible["state"] = weld.begin_state(sides, visible["problem"])
        return weld.weld(volumes, sides, agreement, site, base)

    monkeypatch.setattr(union, "weld", spy)
    points, outline = scan_compound(kind, seed)
    fit = fit_building(points, outline)
    assert fit.outline.equals(outline)
    return visible["problem"], visible["state"]


def price_box(state, problem, box=None):
    """Return price and corners of a roof, in a window or as a whole."""
    box = problem.outline.envelope if box is None else box
    window = weld.make_window(box, weld.list_quads(state, problem), problem.base, problem)
    whole = weld.make_window(
        weld.make_whole_box(problem), weld.list_quads(state, problem), problem.base, problem
    )
    extra = weld.list_owners_beyond(weld.draw_window(state, whole, problem).plans[0], box)
    drawing = weld.draw_window(state, window, problem)
    return weld.price_window(state, drawing, extra, window, problem), drawing.corners


@pytest.mark.parametrize(("kind", "seed"), [("L", 1), ("dormered", 2), ("two_level", 3), ("T", 4)])
def test_a_welded_roof_costs_no_more_and_welding_again_changes_nothing(monkeypatch, kind, seed):
    problem, state = capture_problem(monkeypatch, kind, seed)
    volumes, site, agreement, base, *_ = problem
    sides, planes, _ = weld.weld(volumes, state.sides, agreement, site, base)
    changed_state = state._replace(sides=sides, planes=planes)
    assert price_box(changed_state, problem) <= price_box(state, problem)
    second, *_ = weld.weld(volumes, sides, agreement._replace(planes=planes), site, base)
    assert second == sides


@pytest.mark.parametrize(("kind", "seed"), [("dormered", 2), ("dormered", 5), ("T", 4)])
def test_a_window_judges_a_moved_side_as_the_whole_roof_does(monkeypatch, kind, seed):
    problem, state = capture_problem(monkeypatch, kind, seed)
    compared = 0
    for k in range(1, len(problem.volumes)):
        for edge, side in enumerate(state.sides[k]):
            if not side.anchored:
                line = Side(side.offset + 0.4, side.lean, False, side.sigma)
                moved = weld.move_line(state.sides, k, edge, line, problem)
                changed_state = state._replace(sides=moved)
                box = weld.frame_repair(weld.Repair(0.4, {(k, edge): line}), state, problem)
                in_window, on_roof = (
                    np.subtract(price_box(changed_state, problem, b), price_box(state, problem, b))
                    for b in (box, None)
                )
                assert in_window == pytest.approx(on_roof, abs=1e-6)
                compared += 1
    assert compared


@pytest.mark.parametrize(("kind", "seed"), [("dormered", 2), ("dormered", 5)])
def test_repairs_of_a_side_depend_on_the_plan_around_its_volume(monkeypatch, kind, seed):
    problem, state = capture_problem(monkeypatch, kind, seed)
    sides = [
        [side if side.anchored else replace(side, offset=side.offset + 0.1 * k) for side in row]
        for k, row in enumerate(state.sides)
    ]
    state = state._replace(sides=sides)
    quads = weld.list_quads(state, problem)
    whole = weld.make_window(weld.make_whole_box(problem), quads, problem.base, problem)
    (plan,) = weld.draw_window(state, whole, problem).plans
    numbers = range(1, len(problem.volumes))
    arguments = plan, problem.volumes, sides, problem.plan, problem.scene, numbers
    repairs = find_repairs(*arguments)
    everything = plan, np.arange(len(plan.places)), np.arange(len(plan.edges))
    monkeypatch.setattr(DrawnPlan, "select_around", lambda *_: everything)
    assert repairs
    assert [repair.key for repair in repairs] == [one.key for one in find_repairs(*arguments)]


def test_a_side_far_away_on_the_same_line_stays():
    volumes = np.zeros((4, COLUMNS))
    volumes[1:, U0 : V1 + 1] = [(0, 9, 0, 8), (0, 9, 12, 20), (0, 9, 50, 60)]
    sides = [[Side(float(x)) for x in row[U0 : V1 + 1]] for row in volumes]
    site = SimpleNamespace(recall=lambda find, *arguments: find(*arguments))
    problem = SimpleNamespace(volumes=volumes, site=site)
    assert weld.list_sides_on_line(sides, 1, 1, problem) == [(1, 1), (2, 1)]
    moved = weld.move_line(sides, 1, 1, Side(9.5), problem)
    assert [volume_sides[1].offset for volume_sides in moved[1:]] == [9.5, 9.5, 9.0]


def test_a_side_that_misses_its_corner_by_little_is_moved_back(monkeypatch):
    """Where a welded side is moved by 2 cm, welding leaves no more corners than there were."""
    problem, state = capture_problem(monkeypatch, "dormered", 2)
    volumes, site, agreement, base, *_ = problem
    sides, planes, _ = weld.weld(volumes, state.sides, agreement, site, base)
    settled = state._replace(sides=sides, planes=planes)
    for k in range(1, len(volumes)):
        for edge, side in enumerate(sides[k]):
            if not side.anchored and np.isfinite(side.sigma):
                line = Side(side.offset + 0.02, side.lean, False, side.sigma)
                displaced = weld.move_line(sides, k, edge, line, problem)
                back, *_ = weld.weld(
                    volumes, displaced, agreement._replace(planes=planes), site, base
                )
                moved = state._replace(sides=back, planes=planes)
                assert price_box(moved, problem)[1] <= price_box(settled, problem)[1]


def test_a_side_may_take_the_line_of_the_edge_that_carries_it_on():
    outline = shapely.box(0, 0, 20, 10)
    points = sample_heights(lambda x, y: np.full(np.shape(x), 5.0), outline, 4.0, 0.02)
    plan = lay_out_plan(points, outline)
    scene = make_scene(plan, outline, [0.0], 3.0, 0.2, list_allowed_shapes(()))
    places = np.array([[0.0, 5.0], [10.0, 5.0], [10.3, 5.4], [20.0, 5.9]])
    edges, beside = np.array([[0, 1], [2, 3]]), np.array([[0, 1], [2, 1]])
    levels = np.array([[0.0, 0.0, 5.0], [0.0, 0.0, 3.0], [0.0, 0.0, 6.0]])
    owner = np.array([[1, LEVEL], [0, LEVEL], [2, LEVEL]])
    drawn = DrawnPlan(places, edges, beside, levels, owner, corners=4)
    own_places = (places - plan.frame.origin[:2]) @ plan.frame.rotation.T
    edge = int(2 * np.argmin(np.ptp(own_places[:2], axis=0)))  # across which axis the side lies
    x, y = own_places[:, edge // 2], own_places[:, 1 - edge // 2]
    sides = [Side(-1e3), Side(1e3), Side(-1e3), Side(1e3)]
    sides[edge] = Side(float(x[0]))
    repairs = find_repairs(
        drawn, np.zeros((2, COLUMNS)), [[Side(1e3)] * 4, sides], plan, scene, [1]
    )
    lines = [repair.sides[1, edge] for repair in repairs]
    off = [np.abs(line.offset + line.lean * y[2:] - x[2:]).max() for line in lines]
    assert min(off) < 1e-9


@pytest.mark.parametrize("seed", [0, 1])
def test_long_steps_of_a_hand_on_a_large_level_roof_go(seed):
    rng = np.random.default_rng(seed)
    x, y = rng.random((2, 20 * 24 * 14)) * [[24.0], [14.0]]
    z = 3.0 + 0.08 * (x > 7.2) - 0.08 * (x > 16.8) + rng.normal(0.0, 0.02, len(x))
    fit = fit_building(np.column_stack([x, y, z]), shapely.box(0, 0, 24, 14))
    rows = np.concatenate([piece.planes for part in fit.roof_parts for piece in part.pieces])
    assert np.ptp(rows, axis=0) == pytest.approx(np.zeros(3), abs=1e-6)


@pytest.mark.parametrize(("lean", "is_lower"), [(0.08, False), (0.15, True), (-0.2, False)])
def test_a_long_step_that_leans_is_one_line(lean, is_lower):
    rng = np.random.default_rng(0)
    xy = rng.random((8 * 30 * 14, 2)) * [30.0, 14.0]
    beyond = xy[:, 0] - 13.0 - lean * (xy[:, 1] - 7.0)
    z = np.where(beyond > 0.0, 3.0 if is_lower else 9.0, 6.0)
    points = np.column_stack([xy, z + rng.normal(0.0, 0.02, len(xy))])
    fit = fit_building(points, shapely.box(0, 0, 30, 14))
    away = np.abs(beyond) > 0.25
    height, _ = find_highest(fit.roof_parts, xy[away])
    assert np.abs(height - z[away]).max() < 0.1
