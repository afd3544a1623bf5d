"""Parts of the new roof that continue parts of the earlier one.

A part continues another where both take the same place and have nearly the same planes there. It
keeps that part's number where it can: parts that continue others come first, in the earlier order.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from ..compose.settle import DIGITS, PLAN_DIGITS
from ..errors import HiproofError
from ..geometry.rings import repair_polygons
from ..model import Building, Piece, Roof
from ..model.heights import find_highest
from ..parametric.building import build
from ..parametric.refit import measure_building, select_inside
from ..write.parameters import building_record
from .members import SAME_OUTLINE, compute_overlap

PART_GRID_M = 0.5  # of the places where parts are compared

SAME_PLACE = 0.5
"""Intersection over union of the places of two parts from which on one continues the other."""

LARGEST_GAP_M2 = 0.05
"""Area (m2) between parts, beyond which parts of two epochs do not fit each other."""

OTHER_SHARE = 0.02
"""Share of a roof that may lie elsewhere with earlier parts than without: strips along their edges,
which lie within some decimetres."""


def continue_parts(
    old: Building, new: Building, near_m: float, points: np.ndarray
) -> tuple[Building, list[int | None]]:
    """Return the new building with its parts in the earlier order.

    A part that the test does not tell from the part it continues keeps that part's parameters:
    their heights differ by no more than `near_m`. One that only moved up or down keeps all but its
    height. The numbers of the parts that they continue come with the building, None for new parts.
    With kept parts, the building is measured again on the new `points` (n, 3), in world metres.
    """
    pairs = match_parts(old, new)
    order = sorted(range(len(new.parts)), key=lambda k: (k not in pairs, pairs.get(k, k), k))
    lineage = [pairs.get(k) for k in order]
    result = keep_parts(old, new, pairs, order, near_m)
    if result is not None:
        return measure_again(result, new, points), lineage
    if order == list(range(len(order))):
        return new, lineage
    record = building_record(new)
    record["parts"] = [record["parts"][k] for k in order]
    return build(record, new.model.compose), lineage


def keep_parts(
    old: Building, new: Building, pairs: dict[int, int], order: list[int], near_m: float
) -> Building | None:
    """Return the new building with as many earlier parts as fit it.

    None where none does. `pairs` has the earlier part that each new part continues. The parts come
    in the `order`.
    """
    before, record = building_record(old), building_record(new)
    move_record(record, np.array(before["origin"]))
    lifts = find_lifts(old, new, pairs, near_m)
    kept = {
        k: lift_part(before["parts"][pairs[k]], lift, record["parts"][k]["sigma"].get("t_z"))
        for k, lift in lifts.items()
    }
    redrawn = {k: part | {"outlines": record["parts"][k]["outlines"]} for k, part in kept.items()}
    first = {k: kept[k] if has_same_outline(old, pairs[k], new, k) else redrawn[k] for k in kept}

    def try_parts(parts: dict[int, dict[str, Any]]) -> Building | None:
        if not parts:
            return None
        requested = record | {"parts": [parts.get(k, record["parts"][k]) for k in order]}
        try:
            result = build(requested, new.model.compose)
        except HiproofError:
            return None
        return result if is_same_roof(result.roof, new.roof, near_m) else None

    result = try_parts(first) or try_parts(redrawn)
    if result is not None or len(kept) < 2:
        return result
    chosen: dict[int, dict[str, Any]] = {}
    for k in kept:
        for parts in (chosen | {k: first[k]}, chosen | {k: redrawn[k]}):
            if (found := try_parts(parts)) is not None:
                result, chosen = found, parts
                break
    return result


def find_lifts(
    old: Building, new: Building, pairs: dict[int, int], near_m: float
) -> dict[int, float]:
    """Return how much higher (m) each new part of an earlier shape lies.

    Parts that did not move have 0, and parts that moved together the same height.
    """
    result = {}
    for k, j in pairs.items():
        d = compare_heights(old, j, new, k)
        if d.size and np.abs(d - np.median(d)).max() <= near_m:
            result[k] = measure_lift(d, near_m)
    return unite_lifts(result, near_m)


def measure_lift(differences: np.ndarray, near_m: float) -> float:
    """Return the median difference (m) of heights (n,), 0 where chance explains it."""
    lift = float(np.median(differences))
    return lift if abs(lift) > near_m else 0.0


def unite_lifts(lifts: dict[int, float], near_m: float) -> dict[int, float]:
    """Return how much higher (m) parts lie, the same for all that moved together."""
    moved = [lift for lift in lifts.values() if lift]
    if not moved or np.ptp(moved) > near_m:
        return lifts
    return {k: float(np.mean(moved)) if lift else 0.0 for k, lift in lifts.items()}


def compare_heights(old: Building, j: int, new: Building, k: int) -> np.ndarray:
    """Return how much higher (n,) part `k` is than `j`, place by place."""
    before, after = old.parts[j], new.parts[k]
    shift = old.roof.frame.origin - new.roof.frame.origin
    xy = make_grid(unite_pieces(before.pieces))
    heights = np.stack([before.height_at(xy) + shift[2], after.height_at(xy + shift[:2])])
    return np.diff(heights[:, np.isfinite(heights).all(axis=0)], axis=0)[0]


def lift_part(before: dict[str, Any], height: float, sigma_m: float | None) -> dict[str, Any]:
    """Return an earlier part so much higher (m).

    `sigma_m` is the standard deviation of its new height, None where it is unknown.
    """
    if not height:
        return before
    x, y, z = before["position"]
    sigma = {name: v for name, v in (before.get("sigma") or {}).items() if name != "t_z"}
    if sigma_m is not None:
        sigma["t_z"] = round(sigma_m, DIGITS)
    return before | {"position": [x, y, round(z + height, DIGITS)], "sigma": sigma}


def has_same_outline(old: Building, j: int, new: Building, k: int) -> bool:
    """Return whether part `k` of the new roof has the outline of `j`."""
    shift = old.roof.frame.origin - new.roof.frame.origin
    first = unite_pieces(old.parts[j].pieces)
    second = unite_pieces([piece.move(-shift) for piece in new.parts[k].pieces])
    return compute_overlap(first, second) >= SAME_OUTLINE


def is_same_roof(roof: Roof, new: Roof, near_m: float) -> bool:
    """Return whether chance explains the differences of two roofs."""
    if not covers_outline(roof):
        return False
    xy, shift = make_grid(roof.outline), roof.frame.origin - new.frame.origin
    heights = np.stack([roof.height_at(xy) + shift[2], new.height_at(xy + shift[:2])])
    heights = heights[:, np.isfinite(heights).all(axis=0)]
    return bool(np.mean(np.abs(heights[1] - heights[0]) > near_m) <= OTHER_SHARE)


def measure_again(result: Building, new: Building, points: np.ndarray) -> Building:
    """Return a building that keeps earlier parts with its own residuals and grade.

    The numbers of points are those of the `new` building, which it takes the place of.
    """
    measured = measure_building(result, select_inside(result.roof, points))
    quality = dataclasses.replace(
        measured.quality, points=new.quality.points, density=new.quality.density
    )
    return dataclasses.replace(result, quality=quality, grade=measured.grade)


def move_record(record: dict[str, Any], origin: np.ndarray) -> None:
    """Move an object of parameters.jsonl to another `origin` (3,)."""
    shift = np.array(record["origin"]) - origin

    def move_rings(rings: list[Any]) -> list[Any]:
        return [np.round(np.array(ring) + shift[:2], PLAN_DIGITS).tolist() for ring in rings]

    record["origin"], record["outline"] = origin.tolist(), move_rings(record["outline"])
    for part in record["parts"]:
        part["position"] = np.round(np.array(part["position"]) + shift, DIGITS).tolist()
        part["outlines"] = [move_rings(rings) for rings in part["outlines"]]


def covers_outline(roof: Roof) -> bool:
    """Return whether the parts leave no gap in the outline."""
    gaps = shapely.difference(roof.outline, unite_pieces(roof.pieces))
    return bool(gaps.area < LARGEST_GAP_M2)


def unite_pieces(pieces: Sequence[Piece]) -> shapely.Geometry:
    """Return the place of some pieces; one whose ring touches itself is repaired."""
    return shapely.union_all(repair_polygons([piece.outline for piece in pieces]))


def make_grid(area: shapely.Geometry) -> np.ndarray:
    """Return places (n, 2) every PART_GRID_M in the bounds of an area."""
    x0, y0, x1, y1 = area.bounds
    x, y = np.meshgrid(np.arange(x0, x1, PART_GRID_M), np.arange(y0, y1, PART_GRID_M))
    return np.column_stack([x.ravel(), y.ravel()])


def match_parts(old: Building, new: Building) -> dict[int, int]:
    """Return the earlier part that each new part continues, where one does.

    Both have to show at the same places of a grid. Pairs of the largest overlap go first, and every
    part is taken once.
    """
    xy = make_grid(old.roof.outline)
    shift = old.roof.frame.origin - new.roof.frame.origin
    before, after = show_parts(old.roof, xy), show_parts(new.roof, xy + shift[:2])
    pairs, counts = np.unique(np.column_stack([after, before]), axis=0, return_counts=True)
    scores: list[tuple[float, int, int]] = []
    for (k, j), common in zip(pairs.tolist(), counts.tolist(), strict=True):
        share = common / ((after == k).sum() + (before == j).sum() - common)
        if min(k, j) >= 0 and share >= SAME_PLACE:
            scores.append((-round(float(share), 6), k, j))
    result: dict[int, int] = {}
    for _, k, j in sorted(scores):
        if k not in result and j not in result.values():
            result[k] = j
    return result


def show_parts(roof: Roof, xy: np.ndarray) -> np.ndarray:
    """Return the part (n,) that shows at `xy` (n, 2), -1 beside the roof."""
    heights, top = find_highest(roof.parts, xy)
    return np.where(np.isfinite(heights), top, -1)
