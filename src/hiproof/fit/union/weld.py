"""Make what nearly meets meet, where the roof gets cheaper by it: sides, corners and low steps.

    misfit + units * (parameters that show + corners)

A corner has a price because it is what a draughtsman counts. Repairs are tried the smallest first,
each in a window around it, and one that pays is kept. After a round the roof is drawn anew, until
no repair pays. The outline never moves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from ...model import Part
from ...model.heights import find_highest
from .agree import Agreement, fitted, null_space
from .around import look_around, roof_everywhere
from .drawn_plan import DrawnPlan, count_parameters, draw_plan, part_over
from .finish import Planes
from .objective import costs, misfits
from .plan import Plan
from .prices import CORNER_COST, PARAMETER_COST, REPAIR_UNITS
from .regions import Site, polygons_of, regions_of
from .repairs import Repair, find_repairs
from .scene import Scene, select_points
from .sides import Side, corners_of
from .volumes import DIRECTION, U0, V0, V1

WINDOW_M2, MARGIN_M = (
    400.0,
    2.0,
)  # a roof of so many square metres is one window; how far a window reaches beyond a repair
# repairs that are drawn for every WINDOW_M2 of the outline, and rounds: each draws as much as
# composing its window costs.
# What comes after them stays as the search left it.
MOST_TRIALS, MOST_ROUNDS = 40, 20
MOST_POINTS = 1500  # of a window that judge; of more every k-th
ENDS = (0, 3), (1, 2), (0, 1), (2, 3)  # the corners of a volume in which each of its sides ends
LEFT_OVER = 1e-9  # m; an equation that the others leave so little of holds by them
ONE_LINE_M = 0.02  # sides of two volumes nearer than this are one line


class Problem(NamedTuple):
    """What does not change while a roof is welded.

    `xy` (n, 2) are its points in local coordinates, `order` (n,) their numbers by ascending x.
    """

    volumes: np.ndarray
    site: Site
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


class State(NamedTuple):
    """A roof: its sides and planes, the unknowns that its equations leave free (p, q), and what the
    points of its members cost under these, None where they have not been fitted together yet."""

    sides: list[list[Side]]
    planes: list[Planes]
    basis: np.ndarray
    cost: float | None


class Window(NamedTuple):
    """A part of a roof, or all of it, in a `box` of local coordinates.

    It has the numbers of the volumes that reach into the box, what they are cut to (one site for
    every part of the outline), and the points that judge: local `xy` (n, 2) and `z` (n,), each for
    `weight` points.
    """

    box: shapely.Polygon
    numbers: np.ndarray
    sites: list[Site]
    scene: Scene
    xy: np.ndarray
    z: np.ndarray
    weight: float


class Drawing(NamedTuple):
    """What a window shows of a roof: regions, these as one part, and plan for each of its sites.

    A plan is None where its regions make none.
    """

    regions: list[list[list[shapely.Polygon]]]
    parts: list[Part]
    plans: list[DrawnPlan | None]

    @property
    def corners(self) -> float:
        """How many corners the plans have, infinitely many where one is None."""
        return sum(math.inf if plan is None else plan.corners for plan in self.plans)


def weld(
    volumes: np.ndarray,
    sides: list[list[Side]],
    agreement: Agreement,
    site: Site,
    base: bool,
) -> tuple[list[list[Side]], list[Planes], list[list[shapely.Polygon]]]:
    """Return the sides, planes and regions of all volumes with every repair that pays."""
    problem = problem_of(volumes, agreement, site, base)
    state = state_before(sides, problem)
    whole = window_of(whole_box(problem), quads_of(state, problem), problem)
    drawing = draw(state, whole, problem)
    tried: set[tuple] = set()
    for _ in range(MOST_ROUNDS):
        better, better_drawing = after_a_round(state, drawing, whole, tried, problem)
        if better is state:
            break
        state, drawing = better, better_drawing or draw(better, whole, problem)
    return state.sides, state.planes, drawing.regions[0]


def problem_of(volumes: np.ndarray, agreement: Agreement, site: Site, base: bool) -> Problem:
    scene = site.scene
    points = np.column_stack([scene.U[0, : scene.n], scene.V[0, : scene.n]])
    xy = site.plan.frame.xy_local(points)
    order = np.argsort(xy[:, 0], kind="stable")
    return Problem(volumes, site, agreement, base, xy, order)


def state_before(sides: list[list[Side]], problem: Problem) -> State:
    """The roof as volumes agree on it."""
    agreement = problem.agreement
    return State(sides, list(agreement.planes), agreement.basis, agreement.cost)


def cost_of_members(agreement: Agreement, scene: Scene) -> float:
    """What the points of members cost under the equations that hold between them."""
    members = list(agreement.members.values())
    return fitted(members, agreement.basis, agreement.start, scene).cost


def draw(state: State, window: Window, problem: Problem) -> Drawing:
    """Draw what a window shows of a roof."""
    volumes, planes = problem.volumes[window.numbers], [state.planes[k] for k in window.numbers]
    sides = [state.sides[k] for k in window.numbers]
    regions = [regions_of(volumes, planes, sides, site, problem.base) for site in window.sites]
    drawn = [part_over(own, volumes, planes, problem.plan, problem.scene) for own in regions]
    pairs = zip(drawn, window.sites, strict=True)
    plans = [draw_plan(part, owner, site.outline) for (part, owner), site in pairs]
    return Drawing(regions, [part for part, _ in drawn], plans)


@dataclass
class Comparison:
    """A window of a roof as it is in a `state`, with which repairs in it are compared.

    `plan` is that of the whole roof. The window is drawn when a repair asks for it, unless its
    drawing is `known`.
    """

    state: State
    window: Window
    plan: DrawnPlan
    problem: Problem
    known: Drawing | None = None

    @cached_property
    def drawing(self) -> Drawing:
        return self.known or draw(self.state, self.window, self.problem)

    @cached_property
    def beyond(self) -> set[tuple[int, int]]:
        return owners_beyond(self.plan, self.window.box)

    @cached_property
    def price(self) -> float:
        return price_of(self.state, self.drawing, self.beyond, self.window, self.problem)

    def draw_if_cheaper(self, after: State) -> Drawing | None:
        """Draw the window after a repair; None where it costs as much or has as many corners."""
        if self.drawing.corners == math.inf:
            return None
        trial = draw(after, self.window, self.problem)
        if trial.corners >= self.drawing.corners:
            return None
        price = price_of(after, trial, self.beyond, self.window, self.problem)
        return trial if price < self.price else None


def after_a_round(
    state: State, drawing: Drawing, whole: Window, tried: set[tuple], problem: Problem
) -> tuple[State, Drawing | None]:
    """The roof with every repair that pays, of those not `tried`, one in each window.

    Its drawing comes with it where it is known.
    """
    plan = drawing.plans[0]
    if plan is None:
        return state, drawing
    area = problem.outline.area
    most = MOST_TRIALS * max(area / WINDOW_M2, 1.0)
    changed: list[shapely.Polygon] = []
    after_drawing = None
    quads = quads_of(state, problem) if area > WINDOW_M2 else []
    present = Comparison(state, whole, plan, problem, drawing)
    for repair in find_repairs(plan, problem.volumes, state.sides, problem.plan, problem.scene):
        if repair.key in tried or len(tried) >= most:
            continue
        box = box_of(repair, state, problem) if area > WINDOW_M2 else whole.box
        if any(shapely.intersects(box, other) for other in changed):
            continue
        if present.window.box is not box and not present.window.box.equals(box):
            present = Comparison(state, window_of(box, quads, problem), plan, problem)
        after = repaired(state, repair, present.window, problem)
        if after is None:
            continue
        tried.add(repair.key)
        trial = present.draw_if_cheaper(after)
        if trial is not None:
            state, after_drawing = after, trial if present.window is whole else None
            changed.append(box)
    return state, after_drawing


def owners_beyond(drawn: DrawnPlan, box: shapely.Polygon) -> set[tuple[int, int]]:
    """The planes, by volume and number, that show beyond a window too."""
    x0, y0, x1, y1 = box.bounds
    x, y = drawn.places.T
    out = (x < x0) | (x > x1) | (y < y0) | (y > y1)
    beside = drawn.beside[out[drawn.edges].any(axis=1)]
    return {(k, p) for k, p in drawn.owner[np.unique(beside[beside >= 0])].tolist()}


def whole_box(problem: Problem) -> shapely.Polygon:
    """The window that holds all of the roof."""
    return shapely.box(*problem.outline.bounds)


def box_of(repair: Repair, state: State, problem: Problem) -> shapely.Polygon:
    """The window of a repair: around the sides that move and the volumes whose planes change."""
    volumes, plan, scene = problem.volumes, problem.plan, problem.scene
    owners = {k for _, terms in repair.equations for _, (k, _) in terms}
    quads = [problem.site.quad(volumes[k], state.sides[k])[0] for k in owners if k > 0]
    places = [shapely.get_coordinates(quad) for quad in quads]
    for (k, edge), side in repair.sides.items():
        c, s = scene.turn[int(volumes[k, DIRECTION])]
        for j, own_edge in on_one_line(state.sides, k, edge, problem):
            for line in (state.sides[j][own_edge], side):
                own = [line if e == own_edge else other for e, other in enumerate(state.sides[j])]
                ends = corners_of(own)[list(ENDS[own_edge])]
                places.append(plan.frame.xy_local(ends @ np.array([[c, s], [-s, c]])))
    if not places or 0 in owners:
        return whole_box(problem)
    low, high = (end(np.concatenate(places), axis=0) for end in (np.min, np.max))
    return shapely.box(*(low - MARGIN_M), *(high + MARGIN_M))


def quads_of(state: State, problem: Problem) -> list[shapely.Polygon]:
    """The plans of all volumes but the base, in local coordinates."""
    pairs = zip(problem.volumes[1:], state.sides[1:], strict=True)
    return [problem.site.quad(volume, own)[0] for volume, own in pairs]


def window_of(box: shapely.Polygon, quads: list[shapely.Polygon], problem: Problem) -> Window:
    """What of the roof, whose volumes have these `quads`, lies in a box of local coordinates."""
    scene, xy, order = problem.scene, problem.xy, problem.order
    numbers = np.array([0, *(1 + np.flatnonzero(shapely.intersects(quads, box)))], int)
    x0, y0, x1, y1 = box.bounds
    first, last = np.searchsorted(xy[:, 0], (x0, x1), sorter=order)
    strip = np.sort(order[first:last])
    inside = strip[(xy[strip, 1] >= y0) & (xy[strip, 1] <= y1)]
    count = min(len(inside), MOST_POINTS)
    seen = select_points(scene, inside)
    judges = inside[np.arange(count) * len(inside) // max(count, 1)]
    outline = problem.outline
    if box.covers(outline):
        sites = [problem.site]
    else:
        within = polygons_of(shapely.intersection(outline, box))
        sites = [Site(part, problem.plan, seen, {}) for part in within]
    weight = len(inside) / max(count, 1)
    return Window(box, numbers, sites, seen, xy[judges], scene.z[judges], weight)


def price_of(
    state: State, drawing: Drawing, beyond: set[tuple[int, int]], window: Window, problem: Problem
) -> float:
    """What a window of a roof costs (points), with the parameters that show in it or `beyond`;
    infinite where no plan comes out.
    """
    scene, numbers = problem.scene, window.numbers
    shown = set(beyond)
    for drawn in drawing.plans:
        if drawn is None:
            return math.inf
        shown |= {(int(numbers[k]), p) for k, p in drawn.owner[drawn.shown].tolist()}
    rows = np.array([state.planes[k].rows[p] for k, p in sorted(shown)])
    turns = scene.turn[problem.volumes[[k for k, _ in sorted(shown)], DIRECTION].astype(int)]
    height, _ = find_highest(drawing.parts, window.xy)
    misfit = window.weight * float(misfits(window.z, height, scene).sum())
    units = PARAMETER_COST * count_parameters(rows, turns) + CORNER_COST * drawing.corners
    return misfit + scene.evidence * units


def repaired(state: State, repair: Repair, window: Window, problem: Problem) -> State | None:
    """The roof after a repair; None where its points ask too much for it."""
    most = REPAIR_UNITS * problem.scene.evidence
    sides, planes, basis, cost = state
    for (k, edge), side in repair.sides.items():
        own = int(np.flatnonzero(window.numbers == k)[0])
        volumes = problem.volumes[window.numbers]
        if dearer(volumes, own, edge, sides[k][edge], side, window.scene) > most:
            return None
        sides = with_line_moved(sides, k, edge, side, problem)
    if not repair.equations:
        return State(sides, planes, basis, cost)
    found = equalised(repair, state, most, problem)
    return None if found is None else State(sides, *found)


def equalised(
    repair: Repair, state: State, most: float, problem: Problem
) -> tuple[list[Planes], np.ndarray, float] | None:
    """Planes fitted under a repair's equations too, the unknowns left free, the points' cost.

    None where points cost over `most` more.
    """
    members, start = problem.agreement.members, problem.agreement.start
    rows = []
    for place, terms in repair.equations:
        if any(k not in members for _, (k, _) in terms):
            return None
        at = np.append((place - problem.plan.frame.origin[:2]) @ problem.plan.frame.rotation.T, 1.0)
        rows.append(sum(weight * (at @ members[k].common[p]) for weight, (k, p) in terms))
    equations = np.array(rows) @ state.basis
    if not np.abs(equations).max() > LEFT_OVER:
        return None
    free = state.basis @ null_space(equations)
    if not free.shape[1]:
        return None
    known = [replace(member, rows=state.planes[k].rows) for k, member in members.items()]
    found = fitted(known, free, start, problem.scene)
    before = state.cost
    if before is None:
        before = problem.site.once(cost_of_members, problem.agreement, problem.scene)
    if not math.isfinite(found.cost) or found.cost > before + most:
        return None
    planes = list(state.planes)
    for k, own in zip(members, found.rows, strict=True):
        # as well known as before: that planes meet somewhere does not say how well it is known
        planes[k] = replace(planes[k], rows=own)
    return planes, free, found.cost


def with_line_moved(
    sides: list[list[Side]], k: int, edge: int, line: Side, problem: Problem
) -> list[list[Side]]:
    """All sides, with those on the line of side `edge` of volume k moved onto another `line`."""
    moved = [list(own) for own in sides]
    for j, other in on_one_line(sides, k, edge, problem):
        moved[j][other] = replace(line, sigma=sides[j][other].sigma)
    return moved


def on_one_line(
    sides: list[list[Side]], k: int, edge: int, problem: Problem
) -> list[tuple[int, int]]:
    """The sides, as (volume, edge), on the line of side `edge` of volume k and off the outline."""
    at, lean, anchored = problem.site.once(lay_out_sides, sides)
    was, directions = sides[k][edge], problem.volumes[:, DIRECTION]
    near = (np.abs(at - was.at) < ONE_LINE_M) & (np.abs(lean - was.lean) < ONE_LINE_M) & ~anchored
    near &= (directions == directions[k])[:, None]
    near[0], near[:, (edge ^ 2) & 2], near[:, (edge ^ 2) | 1] = False, False, False
    return [(j, e) for j, e in np.argwhere(near).tolist()]


def lay_out_sides(sides: list[list[Side]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where all sides lie, how they lean, and whether they are anchored: three arrays (k, 4)."""
    at, lean = (np.array([[getattr(side, name) for side in own] for own in sides]) for name in ("at", "lean"))
    return at, lean, np.array([[side.anchored for side in own] for own in sides])


def dearer(volumes: np.ndarray, k: int, edge: int, was: Side, side: Side, scene: Scene) -> float:
    """How much more the points of a `scene` cost where `edge` of volume k lies on the line `side`."""
    axis, direction, sign = edge // 2, int(volumes[k, DIRECTION]), -1.0 if edge % 2 == 0 else 1.0
    x, y = (scene.U[direction], scene.V[direction])[:: 1 if axis == 0 else -1]
    within = (y >= volumes[k, V0 - 2 * axis]) & (y <= volumes[k, V1 - 2 * axis])
    within &= sign * (x - volumes[k, U0 + (edge ^ 1)]) >= 0.0
    before, after = (within & (sign * (x - line.at - line.lean * y) <= 0.0) for line in (was, side))
    around = look_around(volumes, scene.U, scene.V, k)
    everywhere, without = roof_everywhere(volumes, scene.U, scene.V, k, around), around.without
    gain = np.where(everywhere != without, costs(everywhere, scene) - costs(without, scene), 0.0)
    return float(gain[after].sum() - gain[before].sum())
