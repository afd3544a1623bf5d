"""Buildings of wings (L, T, U, cross): a whole primitive over each of the plan's overlapping rectangles, the roof their max.

A partition cuts a crossing of two gables into pieces at its valleys; here each wing stays one primitive. The rectangles are
the largest that fit into the outline along its axes; a wing is fitted to the points that are in no other, then to those
where it is the highest. It may end at a wing it meets or under that one's ridge, lest it come out on the other
side.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import shapely

from ...errors import FitError
from ...model import Fit, Part, Piece
from ...primitives import CATALOGUE, get
from ...settings import Settings
from ..single import fit_roof
from .fit import CompoundFit
from .plan import Plan
from .single import PARAMETER_COST, PART_COST, moved, stays_within

TYPES = tuple(name for name in CATALOGUE if name != "shed")
ENDS_ANYWHERE = ("flat", "monopitch", "gable", "asymmetric_gable", "gambrel")  # straight on, as far as they go
MAY_BECOME = {"gable": ("gable", "hip", "half_hip")}
MOST_WINGS, MOST_CORNERS, FEWEST_POINTS = 4, 16, 8
SAME_LINE_M, ON_AXIS, FILLED = 0.3, 0.06, 0.97
JOINT_COST = 1.0  # units of complexity for each wing after the first, as for a cut

Box = tuple[float, float, float, float]  # u0, v0, u1, v1 in the building's frame


@dataclass(frozen=True)
class Wing:
    """A primitive over the box it covers; `part` in local coordinates, its piece the box."""

    part: Part
    box: Box


def fit_wings(
    outline: shapely.Polygon, plan: Plan, evidence: float, to_beat: float, settings: Settings
) -> CompoundFit | None:
    """The roof as overlapping wings where its objective, on the layouts' scale, is at most `to_beat`; else None."""
    boxes = wing_boxes(outline, plan)
    if not 2 <= len(boxes) <= MOST_WINGS:
        return None
    uv = np.column_stack([plan.cloud.u, plan.cloud.v])
    points = np.column_stack([plan.frame.xy_local(uv), plan.cloud.z + plan.frame.origin[2]])
    inside = np.stack([within(uv, box) for box in boxes])
    tau = settings.compound.tolerance_m
    own = own_wings(boxes, points, inside, plan, evidence, to_beat, settings)
    if own is None:
        return None
    for start in (trimmed(own, points, plan, tau), own):  # what looks like a gable cut short may be a whole hip
        wings = bettered(start, points, inside, plan, evidence, settings)
        objective = cost_of(wings, points, plan, tau, evidence)
        if objective <= to_beat:
            break
    if objective > to_beat or not all(stays_within(wing.part, outline, plan) for wing in wings):
        return None
    gap = np.abs(points[:, 2] - height_of_wings(wings, points, plan))
    return CompoundFit(tuple(wing.part for wing in wings), outline, objective, len(points), float(np.mean(gap > tau)))


def wing_boxes(outline: shapely.Polygon, plan: Plan) -> list[Box]:
    """The largest boxes that fit into a rectilinear outline without holes; none for any other outline."""
    corners = plan_corners(outline, plan)
    edges = np.abs(np.diff(corners, axis=0))
    slanted = (edges.min(axis=1) > np.maximum(ON_AXIS * edges.max(axis=1), SAME_LINE_M)).any()
    if len(outline.interiors) or slanted or not 6 <= len(corners) - 1 <= MOST_CORNERS:
        return []
    u, v = merged(corners[:, 0]), merged(corners[:, 1])
    shape = shapely.Polygon(corners)
    filled = np.zeros((len(u) - 1, len(v) - 1), bool)
    for i, j in np.ndindex(filled.shape):
        cell = shapely.box(u[i], v[j], u[i + 1], v[j + 1])
        filled[i, j] = shapely.intersection(cell, shape).area > FILLED * cell.area
    fits = [
        (i0, j0, i1, j1)
        for i0, i1 in combinations(range(len(u)), 2)
        for j0, j1 in combinations(range(len(v)), 2)
        if filled[i0:i1, j0:j1].all()
    ]
    largest = [a for a in fits if not any(holds(b, a) for b in fits if b != a)]
    return [(u[i0], v[j0], u[i1], v[j1]) for i0, j0, i1, j1 in largest]


def plan_corners(polygon: shapely.Polygon, plan: Plan) -> np.ndarray:
    """Exterior vertices (n, 2) in the building's frame, the first repeated at the end."""
    xy = shapely.get_coordinates(polygon.exterior)
    return plan.frame.to_plan(np.column_stack([xy, np.zeros(len(xy))]))[:, :2]


def merged(values: np.ndarray) -> np.ndarray:
    """Ascending values, those closer than SAME_LINE_M to the one before taken for the same."""
    values = np.sort(values)
    return values[np.r_[True, np.diff(values) > SAME_LINE_M]]


def holds(b: tuple[int, ...], a: tuple[int, ...]) -> bool:
    return b[0] <= a[0] and b[1] <= a[1] and b[2] >= a[2] and b[3] >= a[3]


def within(uv: np.ndarray, box: Box, margin_m: float = 0.0) -> np.ndarray:
    u, v = uv[:, :2].T
    low_u, low_v, high_u, high_v = np.array(box) + np.array([-1, -1, 1, 1]) * margin_m
    return (u >= low_u) & (v >= low_v) & (u <= high_u) & (v <= high_v)


def own_wings(
    boxes: list[Box],
    points: np.ndarray,
    inside: np.ndarray,
    plan: Plan,
    evidence: float,
    to_beat: float,
    settings: Settings,
) -> list[Wing] | None:
    """A wing a box, fitted to the points in no other box; None as soon as what they leave unexplained is too much."""
    wings, least = [], -evidence * JOINT_COST
    for box, members in zip(boxes, inside & (inside.sum(axis=0) == 1), strict=True):
        wing = fitted_wing(points[members], box, plan, settings)
        if wing is None:
            return None
        wings.append(wing)
        least += misfit([wing], points[members], plan, settings.compound.tolerance_m) + evidence * complexity(wing.part)
        if least > to_beat:
            return None
    return wings


def fitted_wing(
    points: np.ndarray, box: Box, plan: Plan, settings: Settings, types: tuple[str, ...] = TYPES
) -> Wing | None:
    """The primitive that stands best for a wing's own points, over its box; None where they do not carry one."""
    if len(points) < FEWEST_POINTS:
        return None
    try:
        fit: Fit = fit_roof(points, types, polygon_of(box, plan), "likelihood", settings)
    except FitError:
        return None
    return over_box(moved(fit.part, fit.global_translation), box, plan)


def over_box(part: Part, box: Box, plan: Plan) -> Wing:
    return Wing(dataclasses.replace(part, pieces=(Piece(polygon_of(box, plan), part.pieces[0].planes),)), box)


def polygon_of(box: Box, plan: Plan) -> shapely.Polygon:
    return shapely.transform(shapely.box(*box), plan.frame.xy_local)


def trimmed(wings: list[Wing], points: np.ndarray, plan: Plan, tau: float) -> list[Wing]:
    """Wings ended under the middle of those they meet wherever that brings the roof nearer to its points."""
    value = misfit(wings, points, plan, tau)
    for k in range(len(wings)):
        for box in shorter_boxes(wings, k):
            changed = [*wings[:k], over_box(wings[k].part, box, plan), *wings[k + 1 :]]
            cost = misfit(changed, points, plan, tau)
            if cost < value:
                wings, value = changed, cost
    return wings


def shorter_boxes(wings: list[Wing], k: int) -> list[Box]:
    """Boxes of wing k that end at the middle or the near side of another wing at whose far side they end now."""
    u0, v0, u1, v1 = box = wings[k].box
    if wings[k].part.type not in ENDS_ANYWHERE:
        return []
    found = []
    for other in (wing.box for j, wing in enumerate(wings) if j != k):
        if other[0] <= u0 and other[2] >= u1:
            middle = (other[1] + other[3]) / 2
            found += [(u0, v, u1, v1) for v in (middle, other[3]) if abs(v0 - other[1]) < SAME_LINE_M]
            found += [(u0, v0, u1, v) for v in (middle, other[1]) if abs(v1 - other[3]) < SAME_LINE_M]
        if other[1] <= v0 and other[3] >= v1:
            middle = (other[0] + other[2]) / 2
            found += [(u, v0, u1, v1) for u in (middle, other[2]) if abs(u0 - other[0]) < SAME_LINE_M]
            found += [(u0, v0, u, v1) for u in (middle, other[0]) if abs(u1 - other[2]) < SAME_LINE_M]
    return [b for b in found if b != box and b[2] - b[0] > SAME_LINE_M and b[3] - b[1] > SAME_LINE_M]


def bettered(
    wings: list[Wing], points: np.ndarray, inside: np.ndarray, plan: Plan, evidence: float, settings: Settings
) -> list[Wing]:
    """The wings, each replaced by its refit where that lowers the objective."""
    tau = settings.compound.tolerance_m
    objective = cost_of(wings, points, plan, tau, evidence)
    for k, again in enumerate(refitted(wings, points, inside, plan, settings)):
        if again is not None:
            changed = [*wings[:k], again, *wings[k + 1 :]]
            cost = cost_of(changed, points, plan, tau, evidence)
            wings, objective = (changed, cost) if cost < objective else (wings, objective)
    return wings


def refitted(
    wings: list[Wing], points: np.ndarray, inside: np.ndarray, plan: Plan, settings: Settings
) -> list[Wing | None]:
    """Each wing fitted again to all points over which it is the highest.

    Its type is kept, but for a gable, which may have hipped ends where it meets others: its own points show none.
    """
    highest = heights(wings, points, plan).argmax(axis=0)
    again = []
    for k, wing in enumerate(wings):
        members = points[inside[k] & (highest == k)]
        again.append(fitted_wing(members, wing.box, plan, settings, MAY_BECOME.get(wing.part.type, (wing.part.type,))))
    return again


def heights(wings: list[Wing], points: np.ndarray, plan: Plan) -> np.ndarray:
    """Height (wings, n) of each wing at the points, minus infinity beyond its box (a little further where none covers)."""
    uv = plan.frame.to_plan(points)[:, :2]
    inside = np.stack([within(uv, wing.box) for wing in wings])
    near = np.stack([within(uv, wing.box, SAME_LINE_M) for wing in wings])
    covered = inside | (near & ~inside.any(axis=0))
    return np.where(covered, np.stack([wing.part.pieces[0].height_at(points[:, :2]) for wing in wings]), -np.inf)


def height_of_wings(wings: list[Wing], points: np.ndarray, plan: Plan) -> np.ndarray:
    return heights(wings, points, plan).max(axis=0)


def misfit(wings: list[Wing], points: np.ndarray, plan: Plan, tau: float) -> float:
    """Sum of min((dz / tau)^2, 1) over the points; one that no wing covers costs one."""
    gap = (points[:, 2] - height_of_wings(wings, points, plan)) / tau
    return float(np.minimum(gap**2, 1.0).sum())


def cost_of(wings: list[Wing], points: np.ndarray, plan: Plan, tau: float, evidence: float) -> float:
    """The wings' objective on the layouts' scale."""
    structure = sum(complexity(wing.part) for wing in wings) - JOINT_COST
    return misfit(wings, points, plan, tau) + evidence * structure


def complexity(part: Part) -> float:
    """Units of complexity of a wing and of the line along which it joins another."""
    return JOINT_COST + PART_COST + PARAMETER_COST * (1 + len(get(part.type).bounds))
