"""Combine parts into shapes of more than five planes.

A row of equal monopitches is a saw-tooth (teeth.py). A gable on a truncated gable's top is a
gambrel.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ...model import Part, Piece
from ...primitives import get
from ...primitives.contract import BACK, FRONT
from ...primitives.family import read_member
from .regions import exclude_parts, list_polygons, unite_outlines
from .teeth import SIZE_ALIKE, TURN_ALIKE_RAD, lay_places, unite_saw_teeth

# Difference (m) in height allowed between a gambrel and the parts that it replaces.
GAMBREL_GAP_M = 0.15
GAMBREL_SHARE = 0.9  # Share of places at which it must hold.
SKEWED = 1e-6  # Slope (rise over run) along the ridge that is numerically none.
LEAST_BREAK = 0.1  # Smallest share of a gambrel's width between its breaks.
MOST_BREAK = 0.95  # Largest share of a gambrel's width between its breaks.
STEEPER = 0.1  # Difference (rise over run) of its lower and upper slopes.


def combine_parts(parts: list[Part], allowed: tuple[str, ...] = ()) -> list[Part]:
    """Combine `parts` into saw-teeth and gambrels, if those types are `allowed`."""
    if not allowed or "shed" in allowed:
        parts = unite_saw_teeth(parts)
    if not allowed or "gambrel" in allowed:
        parts = unite_gambrels(parts)
    return parts


def unite_gambrels(parts: list[Part]) -> list[Part]:
    """Unite every gable with the steeper slopes under it.

    These are a truncated gable below its top, or two slopes beside it.
    """
    for upper in parts:
        top = read_top(upper)
        if top is None:
            continue
        lower_parts = [part for part in parts if part is not upper]
        for lower, slopes in list_lower_slopes(upper, lower_parts):
            gambrel = make_gambrel(upper, top, lower, slopes)
            if gambrel is not None:
                return unite_gambrels([*exclude_parts(lower_parts, lower), gambrel])
    return parts


@dataclass(frozen=True)
class GambrelTop:
    """The upper slopes of a gambrel.

    `offset` is how far across it their ridge lies from the gable's middle (m), `ridge` its height.
    """

    offset: float
    ridge: float
    slope: float


def read_top(upper: Part) -> GambrelTop | None:
    """Return the slopes of a gable, None if they are not alike, and for other parts."""
    if upper.type not in ("gable", "asymmetric_gable"):
        return None
    along = np.array([math.cos(upper.kappa), math.sin(upper.kappa)])
    planes = upper.pieces[0].planes
    rises = planes[:, :2] @ np.array([-along[1], along[0]])
    if len(planes) != 2 or np.abs(planes[:, :2] @ along).max() > SKEWED:
        return None
    front, back = int(rises.argmax()), int(rises.argmin())
    slope = 0.5 * float(rises[front] - rises[back])
    if abs(rises[front] + rises[back]) > SIZE_ALIKE * slope:
        return None
    heights = planes @ np.array([*upper.translation[:2], 1.0])
    offset = float(heights[back] - heights[front]) / (2.0 * slope)
    return GambrelTop(offset, float(heights[front] + rises[front] * offset), slope)


@dataclass(frozen=True)
class GambrelSlope:
    """One lower side of a gambrel.

    `offset` is how far across it the line of its eave lies from the upper gable's middle (m),
    `eave` its height.
    """

    offset: float
    eave: float
    slope: float


def list_lower_slopes(
    upper: Part, parts: list[Part]
) -> Iterator[tuple[tuple[Part, ...], list[GambrelSlope]]]:
    """Yield which parts may be the two sides below a gable, and their slopes.

    They are a truncated gable, or two monopitches, parallel to the gable `upper`.
    """
    monopitches = []
    for part in parts:
        slopes = read_slopes(upper, part)
        if len(slopes) == 2:
            yield (part,), slopes
        elif slopes:
            monopitches.append((part, slopes[0]))
    for (part, slope), (other, other_slope) in combinations(monopitches, 2):
        yield (part, other), [slope, other_slope]


def read_slopes(upper: Part, part: Part) -> list[GambrelSlope]:
    """Return the slopes of a part that is parallel to the gable `upper`.

    A truncated gable has two, a monopitch one, and other parts none that count.
    """
    turn, p = math.remainder(part.kappa - upper.kappa, 2.0 * math.pi), part.parameters
    if abs(math.remainder(turn, math.pi)) > TURN_ALIKE_RAD:
        return []
    step = float(measure_across(upper) @ (part.translation - upper.translation)[:2])
    if part.type == "monopitch" and "height" in p:
        offset = step + math.copysign(0.5 * p["width"], abs(turn) - TURN_ALIKE_RAD)
        return [GambrelSlope(offset, part.translation[2], p["height"] / p["width"])]
    if part.type != "truncated_gable":
        return []
    member = read_member(part.type, p, part.kappa, part.translation)
    return [
        GambrelSlope(step + sign * 0.5 * p["width"], member.eaves[side], member.slopes[side])
        for sign, side in ((-1.0, FRONT), (1.0, BACK))
    ]


def measure_across(upper: Part) -> np.ndarray:
    """Return the unit vector (2,) across the ridge of a gable."""
    return np.array([-math.sin(upper.kappa), math.cos(upper.kappa)])


def make_gambrel(
    upper: Part, top: GambrelTop, lower: tuple[Part, ...], slopes: list[GambrelSlope]
) -> Part | None:
    """Make one gambrel of a gable and the slopes on its two sides.

    The gable is `upper`, and the two `slopes` are those of the `lower` parts. Returns None if they
    are none.
    """
    front, back = sorted(slopes, key=lambda slope: slope.offset)
    slope, width = 0.5 * (front.slope + back.slope), back.offset - front.offset
    if abs(front.slope - back.slope) > SIZE_ALIKE * slope or slope < top.slope + STEEPER:
        return None
    eave = 0.5 * (front.eave + back.eave)
    rise = top.ridge - eave
    half_break = (0.5 * slope * width - rise) / (slope - top.slope)
    if not LEAST_BREAK < 2.0 * half_break / max(width, 1e-6) < MOST_BREAK:
        return None
    parameters = {
        "width": width,
        "length": upper.parameters["length"],
        "height": rise,
        "break_width": 2.0 * half_break,
        "break_height": rise - top.slope * half_break,
    }
    middle = 0.5 * (front.offset + back.offset)
    centre = upper.translation[:2] + middle * measure_across(upper)
    shape = get("gambrel")
    planes = shape.planes_at(shape.to_theta(parameters, upper.kappa, np.array([*centre, eave])))
    if not is_same_surface(planes, (upper, *lower)):
        return None
    pieces = tuple(
        Piece(polygon, planes) for polygon in list_polygons(unite_outlines((upper, *lower)))
    )
    return Part("gambrel", pieces, parameters, upper.kappa, np.array([*centre, eave]))


def is_same_surface(planes: np.ndarray, parts: tuple[Part, ...]) -> bool:
    """Return whether `planes` (k, 3) have nearly the heights of `parts`.

    They have them nearly everywhere: the lowest of the planes is compared with the highest of the
    parts, where these are.
    """
    xy = lay_places(parts)
    z = np.max([part.height_at(xy) for part in parts], axis=0)
    is_covered = np.isfinite(z)
    heights = (np.column_stack([xy[is_covered], np.ones(is_covered.sum())]) @ planes.T).min(axis=1)
    return bool(
        (np.abs(heights - z[is_covered]) < GAMBREL_GAP_M).sum() > GAMBREL_SHARE * is_covered.sum()
    )
