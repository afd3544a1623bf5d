"""Shapes of more than five planes, put together from parts: a row of equal monopitches is a saw-tooth (teeth.py), a gable on a
truncated gable's top is a gambrel."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import shapely

from ...model import Part, Piece
from ...primitives import get
from ...primitives.contract import BACK, FRONT
from ...primitives.family import member_of
from ...rings import GRID_M
from .regions import besides, polygons_of
from .teeth import SIZE_ALIKE, TURN_ALIKE_RAD, with_saw_teeth

ON_TOP_M = 0.3  # a gable whose eave is so near another's top stands on it


def put_together(parts: list[Part], allowed: tuple[str, ...] = ()) -> list[Part]:
    """`parts` with saw-teeth and gambrels in place of what they are made of, where those types are `allowed`."""
    if not allowed or "shed" in allowed:
        parts = with_saw_teeth(parts)
    if not allowed or "gambrel" in allowed:
        parts = with_gambrels(parts)
    return parts


def with_gambrels(parts: list[Part]) -> list[Part]:
    """`parts` with every gable on a truncated gable's top, or between two steeper slopes, united with these."""
    gables = [part for part in parts if part.type == "gable" and tuple(part.parameters) == get("gable").parameters]
    for upper in gables:
        below = [part for part in parts if part is not upper]
        for lower in [(part,) for part in below] + list(combinations(below, 2)):
            found = gambrel_of(upper, slopes_below(upper, lower))
            if found is not None:
                return with_gambrels([*besides(below, lower), found])
    return parts


@dataclass(frozen=True)
class Slope:
    """One lower side of a gambrel: the line of its eave across the ridge (m, from the upper gable's), its height, its slope."""

    at: float
    eave: float
    slope: float
    outlines: tuple[shapely.Polygon, ...]


def slopes_below(upper: Part, lower: tuple[Part, ...]) -> list[Slope]:
    """The slopes on the two sides below the gable `upper`: of a truncated gable, or of a monopitch on each side; else none."""
    across = np.array([-math.sin(upper.kappa), math.cos(upper.kappa)])
    found = []
    for part in lower:
        turn = math.remainder(part.kappa - upper.kappa, 2.0 * math.pi)
        step, p = float(across @ (part.translation - upper.translation)[:2]), part.parameters
        outlines = tuple(piece.outline for piece in part.pieces)
        if part.type == "monopitch" and len(lower) == 2 and "height" in p:
            side = -1.0 if abs(turn) < TURN_ALIKE_RAD else 1.0
            if side > 0.0 and abs(abs(turn) - math.pi) > TURN_ALIKE_RAD:
                return []
            found.append(Slope(step + side * 0.5 * p["width"], part.translation[2], p["height"] / p["width"], outlines))
        elif part.type == "truncated_gable" and len(lower) == 1 and abs(math.remainder(turn, math.pi)) < TURN_ALIKE_RAD:
            member = member_of(part.type, p, part.kappa, part.translation)
            for sign, side in ((-1.0, FRONT), (1.0, BACK)):
                at = step + sign * 0.5 * p["width"]
                found.append(Slope(at, member.eaves[side], member.slopes[side], outlines))
        else:
            return []
    return sorted(found, key=lambda slope: slope.at)


def gambrel_of(upper: Part, below: list[Slope]) -> Part | None:
    """The gable `upper` and the slopes on its two sides as one gambrel, None where they are none."""
    top = upper.parameters
    if len(below) != 2:
        return None
    front, back = below
    slope, upper_slope = 0.5 * (front.slope + back.slope), 2.0 * top["height"] / top["width"]
    width, eave = back.at - front.at, 0.5 * (front.eave + back.eave)
    rise = upper.translation[2] + top["height"] - eave
    half_break = (0.5 * slope * width - rise) / (slope - upper_slope) if slope > upper_slope + 0.1 else 0.0
    reach = [one.eave + one.slope * (0.5 * (width - top["width"])) for one in below]
    fits = (
        abs(front.at + back.at) < 2.0 * ON_TOP_M
        and abs(front.eave - back.eave) < 2.0 * ON_TOP_M
        and abs(front.slope - back.slope) < SIZE_ALIKE * slope
        and all(abs(height - upper.translation[2]) < 2.0 * ON_TOP_M for height in reach)
        and 0.1 < 2.0 * half_break / max(width, 1e-6) < 0.95
    )
    if not fits:
        return None
    parameters = {
        "width": width,
        "length": top["length"],
        "height": rise,
        "break_width": 2.0 * half_break,
        "break_height": rise - upper_slope * half_break,
    }
    across = np.array([-math.sin(upper.kappa), math.cos(upper.kappa)])
    centre = upper.translation[:2] + 0.5 * (front.at + back.at) * across
    translation = np.array([*centre, eave])
    shape = get("gambrel")
    planes = shape.part(shape.to_theta(parameters, upper.kappa, translation)).pieces[0].planes
    outlines = [piece.outline for piece in upper.pieces] + [o for one in below for o in one.outlines]
    covered = polygons_of(shapely.union_all(outlines, grid_size=GRID_M))
    return Part("gambrel", tuple(Piece(polygon, planes) for polygon in covered), parameters, upper.kappa, translation)
