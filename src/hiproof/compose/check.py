"""Validity of solids by ISO 19107, with val3dity's codes.

Each finding has a code and a sentence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.flat_shell import FlatShell, weld
from ..model import Solid
from .check_faces import bent_faces, check_faces
from .check_shell import check_shell

CODES = {
    101: "has a ring with fewer than three points",
    102: "has the same point twice in a row (points closer than 1 mm are one)",
    103: "has a ring that is not closed",
    104: "has a ring that crosses or touches itself, or is folded to a line",
    201: "has rings that cross or share a stretch",
    202: "has the same ring twice",
    203: "is not planar: a vertex lies too far from its plane",
    204: "is not planar: two of its triangles differ by more than 20 degrees",
    205: "has an inside that its rings cut apart",
    206: "has an inner ring outside its outer ring",
    207: "has an inner ring inside another inner ring",
    208: "has an inner ring that runs the same way as its outer ring",
    301: "the shell has fewer than four faces",
    302: "has an edge that no other face shares: the shell is not closed",
    303: "has an edge or vertex where more than two faces meet: the shell is no manifold",
    305: "is not connected to the rest of the shell",
    306: "meets another face outside shared edges and vertices",
    307: "is oriented against its neighbour",
    405: "the shell is oriented inwards",
}
EARTH_M = 1e9  # coordinates beyond it are of no system in use, and their products overflow


@dataclass(frozen=True)
class Finding:
    """A defect: val3dity's `code`, the `face` (-1: the whole shell), and a sentence `message`."""

    code: int
    face: int
    message: str


def make_finding(code: int, face: int = -1, other: int = -1) -> Finding:
    """Make the finding with its sentence."""
    text = CODES[code]
    subject = f"face {face} {text}" if face >= 0 else text
    return Finding(code, face, f"{code}: {subject}{f' (face {other})' if other >= 0 else ''}")


def check_solid(solid: Solid, planarity_m: float = 0.001) -> tuple[Finding, ...]:
    """Return all defects of the shell of `solid`, none if it is valid.

    Rings count as closed; points closer than 1 mm are one; `planarity_m` is how far a vertex may
    lie from its face's plane (val3dity's default is 0.01). As in val3dity, the shell is looked at
    only when every face is sound by itself.

    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> from hiproof.model import Face
    >>> rings = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)]
    >>> check_solid(Solid(corners, tuple(Face((ring,), "WallSurface") for ring in rings)))
    ()
    >>> check_solid(Solid(corners, tuple(Face((ring,),
    ...     "WallSurface") for ring in rings[:3])))[0].code
    301
    """
    vertices = np.ascontiguousarray(solid.vertices, float).reshape(-1, 3)
    index, ring_start, face_start = solid.flatten()
    if len(index) == 0:
        return (make_finding(301),)
    if not (np.abs(vertices) <= EARTH_M).all() or index.min() < 0 or index.max() >= len(vertices):
        return (
            Finding(
                101,
                -1,
                "101: expected vertices on Earth and indices into them, got others; the file is "
                "damaged",
            ),
        )
    read = tuple(make_finding(code, face) for code, face in solid.defects)
    local = vertices - vertices[index].mean(axis=0)
    shell = FlatShell(local, weld(local)[index], ring_start, face_start)
    rows, planes, may_bend = check_faces(shell, planarity_m)
    may_bend = np.setdiff1d(may_bend, rows[:, 1])  # what is unsound cannot be triangulated
    bent = bent_faces(shell, may_bend, planes.normals)
    found = [*rows.tolist(), *((204, face, -1) for face in bent.tolist())]
    found = found or check_shell(shell, planes)
    return read + tuple(make_finding(code, face, other) for code, face, other in found)
