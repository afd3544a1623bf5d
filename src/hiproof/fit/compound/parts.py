"""From pieces to the parts of a roof: each named by the catalogue, equal monopitches in a row joined to a saw-tooth."""

from __future__ import annotations

import math

import numpy as np

from ...model import Part
from ...primitives.shed import TEETH
from .joint import JointFit
from .pieces import RowPiece
from .plan import Plan
from .recognise import recognised

SLOPE_ALIKE, HEIGHT_ALIKE_M, SIZE_ALIKE, TURN_ALIKE_RAD = 0.05, 0.25, 0.2, 0.03


def assembled_parts(pieces: list[RowPiece], joint: JointFit, plan: Plan) -> tuple[Part, ...]:
    """The parts of a roof, named by the catalogue."""
    return tuple(with_saw_teeth([part_of(piece, joint, plan) for piece in pieces]))


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
