"""The two shapes of more than five planes, put together from parts: a row of equal monopitches is a saw-tooth, a gable on a
truncated gable's top is a gambrel."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import shapely

from ...model import Part, Piece
from ...primitives import get
from ...primitives.contract import BACK, FRONT
from ...primitives.family import member_of
from ...primitives.shed import TEETH
from .regions import GRID_M, polygons_of

# rise over run; m; share of a size; rad: within which teeth or the halves of a gambrel are alike
SLOPE_ALIKE, HEIGHT_ALIKE_M, SIZE_ALIKE, TURN_ALIKE_RAD = 0.05, 0.25, 0.2, 0.03
UNEVEN_M = 0.1  # heights of teeth, were they equally wide, that differ by more: they are not
NEARLY, GRID_STEP_M = 0.8, 0.4  # of a tooth's area, at places so close, that a part must show as
ON_TOP_M = 0.3  # a gable whose eave is so near another's top stands on it


def put_together(parts: list[Part], allowed: tuple[str, ...] = ()) -> list[Part]:
    """`parts` with saw-teeth and gambrels in place of what they are made of, where those types are `allowed`."""
    if not allowed or "shed" in allowed:
        parts = with_saw_teeth(parts)
    if not allowed or "gambrel" in allowed:
        parts = with_gambrels(parts)
    return parts


def with_saw_teeth(parts: list[Part]) -> list[Part]:
    """`parts` with every row of equal monopitches replaced by one saw-tooth ("shed")."""
    teeth = [part for part in parts if is_tooth(part)]
    others = [part for part in parts if not is_tooth(part)]
    while teeth:
        row = [teeth.pop(0)]
        grown = True
        while grown and len(row) < max(TEETH):
            neighbour = next((part for part in teeth if follows(row[-1], part) or follows(part, row[0])), None)
            grown = neighbour is not None
            if neighbour is not None:
                teeth = [part for part in teeth if part is not neighbour]
                row = [*row, neighbour] if follows(row[-1], neighbour) else [neighbour, *row]
        if len(row) >= min(TEETH):
            row, teeth, others = carried_on(row, teeth, others)
        united = saw_tooth(row) if len(row) >= min(TEETH) else None
        others += row if united is None else [united]
    return others


def carried_on(row: list[Part], teeth: list[Part], others: list[Part]) -> tuple[list[Part], list[Part], list[Part]]:
    """The row with parts of the other lists that show as its next tooth although they are more than that, and these lists without them."""
    found = True
    while found and len(row) < max(TEETH):
        found = False
        for last, step in ((row[-1], 1.0), (row[0], -1.0)):
            place, rest = next_tooth(row, last, step), [*teeth, *others]
            part = next((p for p in rest if shows_as(p, place, [*row, *(q for q in rest if q is not p)])), None)
            if part is not None:
                outline = shapely.intersection(part.pieces[0].outline, place.pieces[0].outline)
                tooth = replace(place, pieces=tuple(replace(place.pieces[0], outline=o) for o in polygons_of(outline)))
                row = [*row, tooth] if step > 0.0 else [tooth, *row]
                teeth, others = ([p for p in own if p is not part] for own in (teeth, others))
                found = True
                break
    return row, teeth, others


def next_tooth(row: list[Part], last: Part, step: float) -> Part:
    """The tooth that would follow the `last` of a row, before it with a `step` of -1."""
    width = float(np.mean([part.parameters["width"] for part in row]))
    across = step * width * np.array([-math.sin(last.kappa), math.cos(last.kappa)])
    piece = last.pieces[0]
    planes = piece.planes.copy()
    planes[:, 2] -= planes[:, :2] @ across
    return replace(
        last,
        pieces=(Piece(shapely.affinity.translate(piece.outline, *across), planes),),
        translation=last.translation + np.array([*across, 0.0]),
    )


def shows_as(part: Part, tooth: Part, others: list[Part]) -> bool:
    """Whether what shows of a part under `others` is the `tooth`: there as high nearly everywhere, and nowhere else."""
    if len(part.pieces) != 1 or not shapely.intersects(part.pieces[0].outline, tooth.pieces[0].outline):
        return False
    x0, y0, x1, y1 = part.pieces[0].outline.bounds
    xy = np.stack(np.meshgrid(np.arange(x0, x1, GRID_STEP_M), np.arange(y0, y1, GRID_STEP_M)), axis=-1).reshape(-1, 2)
    z, wanted = part.height_at(xy), tooth.height_at(xy)
    beneath = np.max([other.height_at(xy) for other in others], axis=0)
    shows = z > beneath + 1e-6
    alike = np.abs(z[shows] - wanted[shows]) < HEIGHT_ALIKE_M
    covered = alike.sum() * GRID_STEP_M**2 > NEARLY * tooth.area
    return bool(covered and alike.sum() > NEARLY * shows.sum())


def is_tooth(part: Part) -> bool:
    return part.type == "monopitch" and len(part.pieces) == 1 and "height" in part.parameters


def follows(tooth: Part, next_tooth: Part) -> bool:
    """Whether `next_tooth` is the like of `tooth` and lies right behind its upper edge."""
    one, other = tooth.parameters, next_tooth.parameters
    turn = math.remainder(next_tooth.kappa - tooth.kappa, 2.0 * math.pi)
    same_slope = abs(one["height"] / one["width"] - other["height"] / other["width"]) < SLOPE_ALIKE
    same_size = all(
        abs(one[name] - other[name]) < SIZE_ALIKE * max(one[name], other[name]) for name in ("width", "length")
    )
    step = next_tooth.translation - tooth.translation
    across = np.array([-math.sin(tooth.kappa), math.cos(tooth.kappa)]) @ step[:2]
    along = np.array([math.cos(tooth.kappa), math.sin(tooth.kappa)]) @ step[:2]
    spacing = 0.5 * (one["width"] + other["width"])
    return (
        abs(turn) < TURN_ALIKE_RAD
        and same_slope
        and same_size
        and abs(step[2]) < HEIGHT_ALIKE_M
        and abs(across - spacing) < SIZE_ALIKE * spacing
        and abs(along) < SIZE_ALIKE * one["length"]
    )


def saw_tooth(row: list[Part]) -> Part | None:
    """One shed part of equal monopitches, in order from the lowest v to the highest; None where some are wider than others."""
    count, kappa, origin = len(row), row[0].kappa, row[0].translation[:2]
    axes = np.array([[math.cos(kappa), math.sin(kappa)], [-math.sin(kappa), math.cos(kappa)]])
    covered = shapely.union_all([piece.outline for part in row for piece in part.pieces])
    along, across = ((shapely.get_coordinates(covered) - origin) @ axes.T).T
    low, width = across.min(), np.ptp(across)
    centres = (np.array([part.translation[:2] for part in row]) - origin) @ axes.T
    slopes = np.array([part.parameters["height"] / part.parameters["width"] for part in row])
    middles = low + width / count * (np.arange(count) + 0.5)
    heights = [p.translation[2] + 0.5 * p.parameters["height"] for p in row] + slopes * (middles - centres[:, 1])
    if np.ptp(heights) > UNEVEN_M:
        return None
    rise, length = slopes.mean() * width / count, np.mean([part.parameters["length"] for part in row])
    parameters = {"width": float(width), "length": float(length), "height": float(rise), "teeth": float(count)}
    centre = np.array([centres[:, 0].mean(), low + 0.5 * width]) @ axes + origin
    translation = np.array([*centre, heights.mean() - 0.5 * rise])
    shape = get("shed").variant(parameters)
    whole = shape.part(shape.to_theta(parameters, kappa, translation))
    breaks = low + width * np.arange(count + 1) / count
    breaks[[0, -1]] += -1.0, 1.0
    pieces = []
    for foot, top, piece in zip(breaks[:-1], breaks[1:], whole.pieces, strict=True):
        strip = shapely.box(along.min() - 1.0, foot, along.max() + 1.0, top)
        strip = shapely.transform(strip, lambda uv: uv @ axes + origin)
        pieces += [Piece(polygon, piece.planes) for polygon in polygons_of(shapely.intersection(covered, strip))]
    return Part("shed", tuple(pieces), parameters, kappa, translation)


def with_gambrels(parts: list[Part]) -> list[Part]:
    """`parts` with every gable on a truncated gable's top, or between two steeper slopes, united with these."""
    for upper in parts:
        below = [part for part in parts if part is not upper]
        for lower in [(part,) for part in below] + list(combinations(below, 2)):
            found = gambrel_of(upper, slopes_below(upper, lower))
            if found is not None:
                rest = [part for part in below if not any(part is one for one in lower)]
                return with_gambrels([*rest, found])
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
    if upper.type != "gable" or tuple(top) != get("gable").parameters or len(below) != 2:
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
