"""Make what nearly meets meet, if the roof gets cheaper by it.

    misfit + units * (visible parameters + corners + length of low steps)

This concerns sides, corners and low steps. A corner has a price because a draughtsman counts it. A
metre of a low step has that of the search. Repairs are tried the smallest first, each in a window
around it, and one that pays is kept. After a round, the roof is drawn again, until no repair pays.
Then faces are handed to the volumes beside them, at the same price. The outline never moves.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import NamedTuple

import numpy as np
import shapely

from ...geometry.point_in_polygon import find_inside
from ...model import Part
from ...model.heights import find_highest
from .add import FEWEST_UNEXPLAINED, UNEXPLAINED
from .agree import Agreement
from .around import compute_roof_everywhere, measure_context
from .clusters import (
    Basis,
    collect_terms,
    constrain,
    count_free,
    evaluate_equation,
    join_bases,
    place_planes,
    price_rows,
    solve_normal,
    sum_first_round,
    sum_row_costs,
)
from .drawn_plan import DrawnPlan, count_parameters, draw_plan, make_part
from .faces import PlanFace, Regions, assign_face, draw_out_sides, list_faces
from .finish import Planes
from .objective import compute_costs, compute_misfits
from .plan import Plan
from .prices import CORNER_COST, LOW_STEP_COST_A_METRE, PARAMETER_COST, REPAIR_UNITS
from .regions import (
    PlanSite,
    compute_volume_heights,
    cut_regions,
    list_polygons,
    locate_points,
    sketch_regions,
)
from .repairs import REPAIR_REACH_M, Repair, find_repairs, measure_low_steps
from .scene import Scene, select_points
from .sides import Side, cross_lines
from .volumes import DIRECTION, U0, U1, V0, V1

WINDOW_M2 = 400.0  # A roof of so many square metres is one window.
MARGIN_M = 2.0  # Distance (m) that a window reaches beyond a repair.
# Repairs of one side that are drawn for each line of sides: of 78 after the second, 4 paid, of 229
# first ones 84 did. Drawing one costs as much as composing its window.
TRIALS_A_LINE = 2
MOST_ROUNDS = 20  # Most rounds of repairs.
MOST_JUDGES = 1500  # Most points of a window that judge. Of more, every k-th does.
LEFT_OVER = 1e-9  # An equation of which the others leave less (m) holds because of them.
ONE_LINE_M = 0.02  # Sides of two volumes nearer than this (m) are one line.
LINE_REACH_M = 5.0  # Distance (m) along a line from which on another side on it stays.


class WeldProblem(NamedTuple):
    """What does not change while a roof is welded.

    `xy` (n, 2) are its points in local coordinates, `order` (n,) their numbers by ascending x.
    """

    volumes: np.ndarray
    site: PlanSite
    agreement: Agreement
    base: bool
    xy: np.ndarray
    order: np.ndarray

    @property
    def outline(self) -> shapely.Polygon:
        return self.site.outline

    @property
    def plan(self) -> Plan:
        return self.site.plan

    @property
    def scene(self) -> Scene:
        return self.site.scene


class RoofState(NamedTuple):
    """A roof: its sides and planes.

    `bases` are those of the members' clusters, by volume. `regions` are what each volume may roof,
    empty as long as that follows from the sides.
    """

    sides: list[list[Side]]
    planes: list[Planes]
    bases: dict[int, Basis]
    regions: Regions = ()


class Window(NamedTuple):
    """A part of a roof, or all of it, in a `box` of local coordinates.

    It has the numbers of the volumes that reach into the box, what they are cut to (one site for
    every part of the outline), and the points that judge: local `xy` (n, 2) and `z` (n,), each for
    `weight` points. `base` says whether the base may show in it.
    """

    box: shapely.Polygon
    numbers: np.ndarray
    sites: list[PlanSite]
    scene: Scene
    xy: np.ndarray
    z: np.ndarray
    weight: float
    base: bool


class Drawing(NamedTuple):
    """What a window shows of a roof, by site.

    These are the regions of its volumes, one part over these, and the plan of the part. A plan is
    None where its part makes none.
    """

    regions: Sequence[Regions]
    parts: list[Part]
    plans: list[DrawnPlan | None]

    @property
    def corners(self) -> float:
        """The number of corners of the plans, infinite where one is None."""
        return sum(math.inf if plan is None else plan.corners for plan in self.plans)


def weld(
    volumes: np.ndarray,
    sides: list[list[Side]],
    agreement: Agreement,
    site: PlanSite,
    base: bool,
) -> tuple[list[list[Side]], list[Planes], list[list[shapely.Polygon]]]:
    """Return the sides, planes and regions of all volumes with every repair that pays."""
    if len(volumes) - 1 + base < 2:  # one volume meets no other
        planes = list(agreement.planes)
        sketch = sketch_regions(volumes, planes, sides, site, base)
        return sides, planes, cut_regions(volumes, sketch, sides, site)
    problem = make_problem(volumes, agreement, site, base)
    state = begin_state(sides, problem)
    whole = make_window(make_whole_box(problem), list_quads(state, problem), base, problem)
    drawing = draw_window(state, whole, problem)
    trials, numbers = Counter[tuple](), list(range(1, len(volumes)))
    for _ in range(MOST_ROUNDS):
        state, known_drawing, numbers = run_round(state, drawing, whole, trials, numbers, problem)
        if not numbers:
            break
        drawing = known_drawing or draw_window(state, whole, problem)
    drawn = dict(zip(whole.numbers.tolist(), drawing.regions[0], strict=True))
    sketch = [drawn.get(k, []) for k in range(len(volumes))]
    regions = cut_regions(volumes, sketch, state.sides, site)
    state = assign_faces(state._replace(regions=regions), drawing, whole, problem)
    return state.sides, state.planes, list(state.regions)


def make_problem(
    volumes: np.ndarray, agreement: Agreement, site: PlanSite, base: bool
) -> WeldProblem:
    xy = site.recall(locate_points, site.scene, site.plan)
    order = np.argsort(xy[:, 0], kind="stable")
    return WeldProblem(volumes, site, agreement, base, xy, order)


def begin_state(sides: list[list[Side]], problem: WeldProblem) -> RoofState:
    """Return the roof as volumes agree on it."""
    agreement = problem.agreement
    return RoofState(sides, list(agreement.planes), agreement.bases)


def draw_window(state: RoofState, window: Window, problem: WeldProblem) -> Drawing:
    """Draw what a window shows of a roof."""
    volumes, planes = problem.volumes[window.numbers], [state.planes[k] for k in window.numbers]
    sides = [state.sides[k] for k in window.numbers]
    given_regions = [state.regions[k] for k in window.numbers] if state.regions else []
    all_regions, parts, plans = [], [], []
    for site in window.sites:
        regions = given_regions or sketch_regions(volumes, planes, sides, site, window.base)
        all_regions.append(regions)
        part, owner = make_part(regions, volumes, planes, site)
        parts.append(part)
        plans.append(draw_plan(part, owner, site.outline))
    return Drawing(all_regions, parts, plans)


@dataclass
class RepairTrial:
    """A window of a roof as it is in a `state`, with which repairs in it are compared.

    `plan` is that of the whole roof. The window is drawn when a repair needs it, unless its drawing
    is `known`.
    """

    state: RoofState
    window: Window
    plan: DrawnPlan
    problem: WeldProblem
    known: Drawing | None = None

    @cached_property
    def drawing(self) -> Drawing:
        return self.known or draw_window(self.state, self.window, self.problem)

    @cached_property
    def owners_beyond(self) -> set[tuple[int, int]]:
        return list_owners_beyond(self.plan, self.window.box)

    @cached_property
    def price(self) -> float:
        return price_window(self.state, self.drawing, self.owners_beyond, self.window, self.problem)

    def draw_if_cheaper(self, state: RoofState) -> Drawing | None:
        """Draw the window after a repair; None if it costs as much or has as many corners."""
        if self.drawing.corners == math.inf:
            return None
        trial = draw_window(state, self.window, self.problem)
        if trial.corners >= self.drawing.corners:
            return None
        price = price_window(state, trial, self.owners_beyond, self.window, self.problem)
        return trial if price < self.price else None


def run_round(
    state: RoofState,
    drawing: Drawing,
    whole: Window,
    trials: Counter[tuple],
    numbers: list[int],
    problem: WeldProblem,
) -> tuple[RoofState, Drawing | None, list[int]]:
    """Return the roof with every repair that pays, one in each window.

    Sides of the volumes `numbers` may move. `trials` say how often each repair, and each side's
    line, was drawn. Also returns the roof's drawing, if it is known, and the volumes whose sides
    may move next.
    """
    plan = drawing.plans[0]
    if plan is None:
        return state, drawing, []
    area = problem.outline.area
    changed: list[shapely.Polygon] = []
    boxes: dict[tuple, shapely.Polygon] = {}
    postponed, after_drawing = set[int](), None
    quads = list_quads(state, problem) if area > WINDOW_M2 else []
    present = RepairTrial(state, whole, plan, problem, drawing)
    scene, volumes = problem.scene, problem.volumes
    settled = {key for key, count in trials.items() if count >= TRIALS_A_LINE}
    for repair in find_repairs(plan, volumes, state.sides, problem.plan, scene, numbers, settled):
        # Planes are as they were until another equation holds, and so is what one more costs.
        if not repair.owners <= state.bases.keys():
            continue
        lines = repair.sides if len(repair.sides) == 1 else {}  # stairs are few
        if any(trials[side] >= TRIALS_A_LINE for side in lines):
            continue
        key = repair.key, *(count_free(state.bases[k]) for k in sorted(repair.owners))
        if trials[key]:
            continue
        which = (*repair.sides, *repair.owners)
        if which not in boxes:
            is_large = area > WINDOW_M2
            boxes[which] = frame_repair(repair, state, problem) if is_large else whole.box
        box = boxes[which]
        if changed and shapely.intersects(box, changed).any():
            postponed |= {k for k, _ in repair.sides}
            continue
        if present.window.box is not box and not present.window.box.equals(box):
            window = make_window(box, quads, problem.base and shows_base(plan, box), problem)
            present = RepairTrial(state, window, plan, problem)
        repaired_state = apply_repair(state, repair, present.window, problem)
        if repaired_state is None:
            trials[key] += 1
            continue
        on_lines = (list_sides_on_line(state.sides, *side, problem) for side in lines)
        trials.update((key, *chain.from_iterable(on_lines)))
        trial = present.draw_if_cheaper(repaired_state)
        if trial is not None:
            state, after_drawing = repaired_state, trial if present.window is whole else None
            changed.append(box)
    return state, after_drawing, list_unsettled(state, changed, postponed, problem)


def list_unsettled(
    state: RoofState, changed: list[shapely.Polygon], postponed: set[int], problem: WeldProblem
) -> list[int]:
    """List the volumes in boxes that `changed`, and those `postponed`.

    What else there is was tried before. Without a change, there is none.
    """
    if not changed:
        return []
    is_near = shapely.intersects(np.array(list_quads(state, problem))[:, None], changed)
    return sorted(postponed.union((1 + np.flatnonzero(is_near.any(axis=1))).tolist()))


def assign_faces(
    state: RoofState, drawing: Drawing, whole: Window, problem: WeldProblem
) -> RoofState:
    """Return the roof with every face handed over that makes it cheaper.

    The state has regions. Who takes a face gets its sides drawn out.
    """
    first_state, tried_keys = state, set[tuple]()
    while True:
        next_state = run_face_round(state, drawing, whole, tried_keys, problem)
        if next_state is state:
            break
        state, drawing = next_state, draw_window(next_state, whole, problem)
    sides = list(state.sides)
    for k, region in enumerate(state.regions):
        if region and region is not first_state.regions[k]:
            sides[k] = draw_out_sides(problem.volumes[k], sides[k], region, problem.site)
    return state._replace(sides=sides)


def run_face_round(
    state: RoofState, drawing: Drawing, whole: Window, tried_keys: set[tuple], problem: WeldProblem
) -> RoofState:
    """Return the roof with faces handed over, at most one in each window."""
    plan, is_large = drawing.plans[0], problem.outline.area > WINDOW_M2
    if plan is None:
        return state
    changed: list[shapely.Polygon] = []
    present = RepairTrial(state, whole, plan, problem, drawing)
    for face in list_faces(plan):
        box = shapely.box(*shapely.buffer(face.polygon, MARGIN_M).bounds) if is_large else whole.box
        if face.key in tried_keys or any(shapely.intersects(box, other) for other in changed):
            continue
        tried_keys.add(face.key)
        if is_large:
            places = problem.site.recall(join_polygons, state.regions)
            window = make_window(box, places, problem.base, problem)
            present = RepairTrial(state, window, plan, problem)
        new_state = assign_if_cheaper(face, present)
        if new_state is not None:
            state = new_state
            changed.append(box)
    return state


def join_polygons(regions: Regions) -> list[shapely.MultiPolygon]:
    """Return the region of each volume but the base as one geometry."""
    return [shapely.MultiPolygon(polygons) for polygons in regions[1:]]


def assign_if_cheaper(face: PlanFace, present: RepairTrial) -> RoofState | None:
    """Return the roof with a face handed over, None if that is not cheaper."""
    state, site = present.state, present.problem.site
    for takers in rank_takers(face, present):
        regions = assign_face(face, takers, state.regions, site)
        new_state = state._replace(regions=regions)
        if regions and present.draw_if_cheaper(new_state) is not None:
            return new_state
    return None


def rank_takers(face: PlanFace, present: RepairTrial) -> list[frozenset[int]]:
    """List who may take a face: first who explains its points best.

    Who would leave points unexplained that are worth a volume is left out.
    """
    window, planes, problem = present.window, present.state.planes, present.problem
    inside = find_inside(face.polygon, *window.xy.T)
    heights = {
        k: compute_volume_heights(problem.volumes[k], planes[k], window.xy[inside], problem.site)
        for k in (face.owner, *face.takers)
    }

    def measure_misfits(volumes: Iterable[int]) -> np.ndarray:
        highest = np.max([heights[k] for k in volumes], axis=0)
        return compute_misfits(window.z[inside], highest, problem.scene)

    misfits = {takers: measure_misfits(takers) for takers in face.list_choices()}
    limit = count_unexplained(measure_misfits([face.owner])) + FEWEST_UNEXPLAINED
    ranked = sorted(misfits, key=lambda takers: misfits[takers].sum())
    return [takers for takers in ranked if count_unexplained(misfits[takers]) < limit]


def count_unexplained(misfits: np.ndarray) -> int:
    return int(np.count_nonzero(misfits > UNEXPLAINED))


def list_owners_beyond(plan_drawn: DrawnPlan, box: shapely.Polygon) -> set[tuple[int, int]]:
    """Return the planes, by volume and number, that are visible beyond a window, too."""
    x0, y0, x1, y1 = box.bounds
    x, y = plan_drawn.places.T
    out = (x < x0) | (x > x1) | (y < y0) | (y > y1)
    planes = plan_drawn.beside[out[plan_drawn.edges].any(axis=1)]
    return {(k, p) for k, p in plan_drawn.owner[np.unique(planes[planes >= 0])].tolist()}


def shows_base(plan_drawn: DrawnPlan, box: shapely.Polygon) -> bool:
    """Return whether the base lies beside an edge in a box."""
    is_base = np.append(plan_drawn.owner[:, 0] == 0, False)  # False is that of -1, outside
    ends = plan_drawn.places[plan_drawn.edges[is_base[plan_drawn.beside].any(axis=1)]]
    x0, y0, x1, y1 = box.bounds
    is_low, is_high = ends.max(axis=1) < (x0, y0), ends.min(axis=1) > (x1, y1)
    return not (is_low | is_high).any(axis=1).all()


def make_whole_box(problem: WeldProblem) -> shapely.Polygon:
    """Return the box of a window that holds all of the roof."""
    return shapely.box(*problem.outline.bounds)


def frame_repair(repair: Repair, state: RoofState, problem: WeldProblem) -> shapely.Polygon:
    """Return the window of a repair.

    It lies around the sides that move and the volumes whose planes change.
    """
    if 0 in repair.owners:
        return make_whole_box(problem)
    quads = [problem.site.draw_quad(problem.volumes[k], state.sides[k]) for k in repair.owners]
    places = [shapely.get_coordinates(quad) for quad in quads]
    places += [list_line_ends(state.sides, k, edge, problem) for k, edge in repair.sides]
    ends = np.concatenate(places)
    margin = MARGIN_M + (REPAIR_REACH_M if repair.sides else 0.0)
    return shapely.box(*(ends.min(axis=0) - margin), *(ends.max(axis=0) + margin))


def list_line_ends(sides: list[list[Side]], k: int, edge: int, problem: WeldProblem) -> np.ndarray:
    """Return the ends (n, 2) of all sides on the line of side `edge` of volume k.

    They are in local coordinates.
    """
    on_line = list_sides_on_line(sides, k, edge, problem)
    beside = slice(2, 4) if edge < 2 else slice(0, 2)
    lines = [(sides[j][other], *sides[j][beside]) for j, other in on_line]
    offsets, leans = (
        np.array([[getattr(side, name) for side in line] for line in lines]).reshape(-1, 3)
        for name in ("offset", "lean")
    )
    x, y = cross_lines(offsets[:, :1], leans[:, :1], offsets[:, 1:], leans[:, 1:])
    ends = np.stack([x, y] if edge < 2 else [y, x], axis=-1).reshape(-1, 2)
    c, s = problem.scene.turn[int(problem.volumes[k, DIRECTION])]
    return problem.plan.frame.xy_local(ends @ np.array([[c, s], [-s, c]]))


def list_quads(state: RoofState, problem: WeldProblem) -> list[shapely.Polygon]:
    """Return the plans of all volumes but the base, in local coordinates."""
    pairs = zip(problem.volumes[1:], state.sides[1:], strict=True)
    return [problem.site.draw_quad(volume, volume_sides) for volume, volume_sides in pairs]


def make_window(
    box: shapely.Polygon, quads: list[shapely.Polygon], base: bool, problem: WeldProblem
) -> Window:
    """Return what of the roof lies in a box of local coordinates.

    Its volumes have these `quads`, and `base` says whether the base may show.
    """
    scene, xy, order = problem.scene, problem.xy, problem.order
    numbers = np.array([0, *(1 + np.flatnonzero(shapely.intersects(quads, box)))], int)
    x0, y0, x1, y1 = box.bounds
    first, last = np.searchsorted(xy[:, 0], (x0, x1), sorter=order)
    strip = np.sort(order[first:last])
    inside = strip[(xy[strip, 1] >= y0) & (xy[strip, 1] <= y1)]
    count = min(len(inside), MOST_JUDGES)
    window_scene = select_points(scene, inside)
    judges = inside[np.arange(count) * len(inside) // max(count, 1)]
    outline = problem.outline
    if box.covers(outline):
        sites = [problem.site]
    else:
        polygons = list_polygons(shapely.intersection(outline, box))
        sites = [
            PlanSite(part, problem.plan, window_scene, problem.site.cache) for part in polygons
        ]
    weight = len(inside) / max(count, 1)
    return Window(box, numbers, sites, window_scene, xy[judges], scene.z[judges], weight, base)


def price_window(
    state: RoofState,
    drawing: Drawing,
    other_owners: set[tuple[int, int]],
    window: Window,
    problem: WeldProblem,
) -> float:
    """Return what a window of a roof costs (points).

    It has the parameters that are visible in it or in `other_owners`. It is infinite if no plan
    results.
    """
    scene, numbers = problem.scene, window.numbers
    owners, low_steps_m = set(other_owners), 0.0
    for plan_drawn in drawing.plans:
        if plan_drawn is None:
            return math.inf
        low_steps_m += measure_low_steps(plan_drawn)
        owners |= {
            (int(numbers[k]), p) for k, p in plan_drawn.owner[plan_drawn.visible_planes].tolist()
        }
    rows = np.array([state.planes[k].rows[p] for k, p in sorted(owners)])
    turns = scene.turn[problem.volumes[[k for k, _ in sorted(owners)], DIRECTION].astype(int)]
    height, _ = find_highest(drawing.parts, window.xy)
    misfit = window.weight * float(compute_misfits(window.z, height, scene).sum())
    units = PARAMETER_COST * count_parameters(rows, turns) + CORNER_COST * drawing.corners
    units += LOW_STEP_COST_A_METRE * low_steps_m
    return misfit + scene.evidence * units


def apply_repair(
    state: RoofState, repair: Repair, window: Window, problem: WeldProblem
) -> RoofState | None:
    """Return the roof after a repair, None if its points cost too much more."""
    most_units = REPAIR_UNITS + LOW_STEP_COST_A_METRE * repair.length
    most_cost = most_units * problem.scene.evidence
    sides = state.sides
    extra_cost, volumes = 0.0, problem.volumes[window.numbers]
    for (k, edge), side in repair.sides.items():
        position, old_side = int(np.flatnonzero(window.numbers == k)[0]), state.sides[k][edge]
        extra_cost += measure_extra_cost(volumes, position, edge, old_side, side, window.scene)
        sides = move_line(sides, k, edge, side, problem)
    if extra_cost > most_cost:
        return None
    if not repair.equations:
        return state._replace(sides=sides)
    fit = fit_repair(repair, state, most_cost, problem)
    return None if fit is None else state._replace(sides=sides, planes=fit[0], bases=fit[1])


def fit_repair(
    repair: Repair, state: RoofState, most_cost: float, problem: WeldProblem
) -> tuple[list[Planes], dict[int, Basis]] | None:
    """Fit planes under a repair's equations, too.

    Returns them and the members' bases, None if points cost over `most_cost` more.
    """
    members, scene, frame = problem.agreement.members, problem.scene, problem.plan.frame
    equations = []
    for place, terms in repair.equations:
        position = np.append((place - frame.origin[:2]) @ frame.rotation.T, 1.0)
        equations.append(
            collect_terms(
                (k, weight * position @ members[k].common_design[p]) for weight, (k, p) in terms
            )
        )
    equation = {k: np.array([equation[k] for equation in equations]) for k in equations[0]}
    basis = join_bases([state.bases[k] for k in sorted(repair.owners)])
    if not np.abs(evaluate_equation(equation, basis)).max() > LEFT_OVER:
        return None
    free = constrain(basis, equation)
    if not count_free(free):
        return None
    sums = {
        k: problem.site.recall(sum_first_round, members[k], state.planes[k].rows, scene)
        for k in basis
    }
    rows = place_planes(members, solve_normal(sums, free, members).unknowns)
    cost_before = sum_row_costs(members, {k: state.planes[k].rows for k in basis}, scene)
    if price_rows(members, rows, scene) > cost_before + most_cost:
        return None
    # The covariance stays: that planes meet somewhere does not make their place more precise.
    planes = [
        replace(planes, rows=rows[k]) if k in rows else planes
        for k, planes in enumerate(state.planes)
    ]
    return planes, state.bases | dict.fromkeys(free, free)


def move_line(
    sides: list[list[Side]], k: int, edge: int, line: Side, problem: WeldProblem
) -> list[list[Side]]:
    """Move all sides on the line of side `edge` of volume k onto another `line`."""
    moved = list(sides)
    for j, other in list_sides_on_line(sides, k, edge, problem):
        moved[j] = list(moved[j])
        moved[j][other] = replace(line, sigma=sides[j][other].sigma)
    return moved


def list_sides_on_line(
    sides: list[list[Side]], k: int, edge: int, problem: WeldProblem
) -> list[tuple[int, int]]:
    """List the sides, as (volume, edge), on the line of side `edge` of volume k.

    Sides on the outline are left out, and those too far along the line.
    """
    volumes, old_side = problem.volumes, sides[k][edge]
    starts, ends = volumes[:, [V0, V1] if edge < 2 else [U0, U1]].T
    is_within = (starts < ends[k] + LINE_REACH_M) & (ends > starts[k] - LINE_REACH_M)
    is_within &= volumes[:, DIRECTION] == volumes[k, DIRECTION]
    is_within[0] = False
    return [
        (j, e)
        for j in np.flatnonzero(is_within).tolist()
        for e in ((0, 1) if edge < 2 else (2, 3))
        if abs(sides[j][e].offset - old_side.offset) < ONE_LINE_M
        and abs(sides[j][e].lean - old_side.lean) < ONE_LINE_M
        and not sides[j][e].anchored
    ]


def measure_extra_cost(
    volumes: np.ndarray, k: int, edge: int, old_side: Side, side: Side, scene: Scene
) -> float:
    """Return how much more points cost with `edge` of volume k on the line `side`.

    The points are those of `scene`.
    """
    axis, direction, sign = edge // 2, int(volumes[k, DIRECTION]), -1.0 if edge % 2 == 0 else 1.0
    x, y = (scene.U[direction], scene.V[direction])[:: 1 if axis == 0 else -1]
    is_within = (y >= volumes[k, V0 - 2 * axis]) & (y <= volumes[k, V1 - 2 * axis])
    is_within &= sign * (x - volumes[k, U0 + (edge ^ 1)]) >= 0.0
    is_before, is_after = (
        is_within & (sign * (x - line.offset - line.lean * y) <= 0.0) for line in (old_side, side)
    )
    context = measure_context(volumes, scene.U, scene.V, scene.order, k)
    everywhere, roof_without = (
        compute_roof_everywhere(volumes, scene.U, scene.V, k, context),
        context.roof_without,
    )
    gain = np.where(
        everywhere != roof_without,
        compute_costs(everywhere, scene) - compute_costs(roof_without, scene),
        0.0,
    )
    return float(gain[is_after].sum() - gain[is_before].sum())
