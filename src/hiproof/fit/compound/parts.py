"""From pieces to the parts of a roof: each named by the catalogue, equal monopitches in a row joined to a saw-tooth."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise

import numpy as np
import shapely

from ...model import Part, Piece
from ...primitives.shed import TEETH
from .joint import PARAMETER_SHARE, JointFit
from .pieces import RowPiece, polygons_of
from .plan import Plan
from .recognise import recognised

PLAN_ACCURACY_M = 0.1  # of a point: nearer to a step it may belong to either side
SLOPE_ALIKE, HEIGHT_ALIKE_M, SIZE_ALIKE, TURN_ALIKE_RAD = 0.05, 0.25, 0.2, 0.03


def assembled_parts(
    pieces: list[RowPiece], joint: JointFit, plan: Plan, tau: float, evidence: float
) -> tuple[Part, ...]:
    """The parts of a roof, named by the catalogue; the teeth of a saw-tooth equally wide where the points allow it."""
    parts = with_saw_teeth([part_of(piece, joint, plan) for piece in pieces])
    return tuple(with_equal_teeth(part, plan, tau, evidence) if part.type == "shed" else part for part in parts)


def part_of(found: RowPiece, joint: JointFit, plan: Plan) -> Part:
    """The piece as a part, with standard deviations where all its planes were fitted."""
    if (found.rows < 0).any():
        return recognised(found.piece)
    to_local = np.kron(np.eye(len(found.rows)), plan.frame.plane_map())
    return recognised(found.piece, to_local @ joint.covariance_of(found.rows) @ to_local.T)


def with_saw_teeth(parts: list[Part]) -> list[Part]:
    """`parts` with every row of equal monopitches replaced by one saw-tooth ("shed")."""
    teeth = [part for part in parts if part.type == "monopitch" and len(part.pieces) == 1]
    others = [part for part in parts if not (part.type == "monopitch" and len(part.pieces) == 1)]
    while teeth:
        row = [teeth.pop(0)]
        grown = True
        while grown and len(row) < max(TEETH):
            neighbour = next((part for part in teeth if follows(row[-1], part) or follows(part, row[0])), None)
            grown = neighbour is not None
            if grown:
                teeth = [part for part in teeth if part is not neighbour]
                row = [*row, neighbour] if follows(row[-1], neighbour) else [neighbour, *row]
        others.append(saw_tooth(row) if len(row) >= min(TEETH) else row[0])
    return others


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


def saw_tooth(row: list[Part]) -> Part:
    """One shed part of equal monopitches, in order from the lowest v to the highest."""
    mean = {name: float(np.mean([part.parameters[name] for part in row])) for name in ("width", "length", "height")}
    parameters = {"width": len(row) * mean["width"], "length": mean["length"], "height": mean["height"]}
    translation = np.mean([part.translation for part in row], axis=0)
    pieces = tuple(part.pieces[0] for part in row)
    return Part("shed", pieces, parameters | {"teeth": float(len(row))}, row[0].kappa, translation)


def with_equal_teeth(part: Part, plan: Plan, tau: float, evidence: float) -> Part:
    """The saw-tooth with its steps at even distances, unless points away from them speak for uneven ones.

    The points beside one step leave its place uncertain by their distance and their own accuracy in plan; all steps
    together tell it far better.
    """
    even = evenly_cut(part)
    if even is None:
        return part
    xy = plan.frame.xy_local(np.column_stack([plan.cloud.u, plan.cloud.v]))
    z = plan.cloud.z + plan.frame.origin[2]
    clear = [shapely.buffer(piece.outline, -PLAN_ACCURACY_M, join_style="mitre") for piece in (*part.pieces, *even)]
    inside = [shapely.contains_xy(outline, xy[:, 0], xy[:, 1]) for outline in clear]
    before, after = inside[: len(even)], inside[len(even) :]
    told = np.any(before, axis=0) & np.any(after, axis=0)
    rise = misfit(even, after & told, xy, z, tau) - misfit(part.pieces, before & told, xy, z, tau)
    saved = PARAMETER_SHARE * evidence * (len(even) - 1)
    return part if rise > saved else dataclasses.replace(part, pieces=even)


def evenly_cut(part: Part) -> tuple[Piece, ...] | None:
    """The part's plan cut at even distances across, a piece a tooth with the tooth's plane; None where it falls apart."""
    whole = shapely.union_all([piece.outline for piece in part.pieces])
    c, s = math.cos(part.kappa), math.sin(part.kappa)
    to_local = np.array([[c, s], [-s, c]])
    (left, low), (right, high) = (f(shapely.get_coordinates(whole) @ to_local.T, axis=0) for f in (np.min, np.max))
    even = []
    for piece, (start, end) in zip(part.pieces, pairwise(np.linspace(low, high, len(part.pieces) + 1)), strict=True):
        strip = shapely.transform(shapely.box(left - 1.0, start, right + 1.0, end), lambda uv: uv @ to_local)
        polygons = polygons_of(shapely.intersection(whole, strip))
        if len(polygons) != 1:
            return None
        even.append(Piece(polygons[0], piece.planes))
    return tuple(even)


def misfit(pieces: tuple[Piece, ...], members: np.ndarray, xy: np.ndarray, z: np.ndarray, tau: float) -> float:
    """Sum of min((dz / tau)^2, 1) over the `members` (k, n) of each piece."""
    gaps = [piece.height_at(xy[own]) - z[own] for piece, own in zip(pieces, members, strict=True)]
    return float(sum(np.minimum((gap / tau) ** 2, 1.0).sum() for gap in gaps))
