"""Validity of solids by ISO 19107: findings with val3dity's codes and a sentence each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from ..geometry.components import label_components
from ..geometry.flat_shell import ON_SEGMENT_M, FlatShell, cross_strictly, weld
from ..model import Solid
from .check_faces import FacePlanes, bent_faces, check_faces


def check_shell(shell: FlatShell, planes: FacePlanes) -> list[tuple[int, int, int]]:
    """Return the findings of a shell, whose planes are those of `check_faces`."""
    if shell.faces < 4:
        return [(301, -1, -1)]
    rows = check_edges(shell)
    rows = (rows or check_umbrellas(shell)) + check_intersections(shell, planes)
    return rows or ([(405, -1, -1)] if shell.volume <= 0 else [])


def check_edges(shell: FlatShell) -> list[tuple[int, int, int]]:
    """Find codes 302, 303, 307 (every edge twice, oppositely) and 305 (one component)."""
    order = np.argsort(shell.edge_of, kind="stable")
    edges, start, uses = np.unique(shell.edge_of[order], return_index=True, return_counts=True)
    is_rising = shell.index < shell.index[shell.after]
    rising = np.bincount(shell.edge_of, is_rising)
    faces, rows = shell.face_of[order].tolist(), []
    for k in edges[(uses != 2) | (2 * rising != uses)].tolist():
        code = {1: 302, 2: 307}.get(int(uses[k]), 303)
        rows.append((code, faces[start[k]], faces[start[k] + 1] if uses[k] > 1 else -1))
    links = np.array([np.repeat(shell.face_of[order[start]], uses), faces])
    apart = np.flatnonzero(label_components(shell.faces, links))
    return rows + [(305, face, -1) for face in apart[:1].tolist()]


def check_umbrellas(shell: FlatShell) -> list[tuple[int, int, int]]:
    """Find code 303 where faces around a vertex form more than one fan.

    Only for shells whose edges are all paired. A vertex in which two rings of one face touch is
    left out: which corners adjoin there is not shown by the rings.
    """
    one, two = np.argsort(shell.edge_of, kind="stable").reshape(-1, 2).T
    links = np.column_stack([(one, shell.after[two]), (two, shell.after[one])])
    labels, rows = label_components(len(shell.index), links), []
    fans = np.unique(np.column_stack([shell.index, labels]), axis=0)[:, 0]
    for vertex in np.flatnonzero(np.bincount(fans) > 1).tolist():
        corners = np.flatnonzero(shell.index == vertex)
        faces = shell.face_of[corners]
        if len(np.unique(faces)) == len(faces):
            other = faces[labels[corners] != labels[corners[0]]]
            rows.append((303, int(other[0]), int(faces[0])))
    return rows


def check_intersections(shell: FlatShell, planes: FacePlanes) -> list[tuple[int, int, int]]:
    """Find code 306: faces of meeting boxes that meet elsewhere than at shared edges."""
    starts = shell.ring_start[shell.face_start[:-1]]
    low = np.minimum.reduceat(shell.corners, starts)
    high = np.maximum.reduceat(shell.corners, starts)
    slack = planes.slack[:, None]
    lower, upper = low - slack, high + slack
    boxes = shapely.box(*lower[:, :2].T, *upper[:, :2].T)
    face, other = shapely.STRtree(boxes).query(boxes)
    meets = (low[other] <= upper[face]) & (lower[face] <= high[other])
    keep = (face != other) & meets.all(axis=1)
    place, corner = shell.pair_with_corners(other[keep])
    face = face[keep][place]
    a, b = shell.corners[corner], shell.corners[shell.after[corner]]
    is_near = (np.minimum(a, b) <= upper[face]) & (np.maximum(a, b) >= lower[face])
    face, corner = face[is_near.all(axis=1)], corner[is_near.all(axis=1)]
    pairs = np.column_stack([face, shell.face_of[corner]])[pierce(shell, planes, face, corner)]
    return [(306, one, two) for one, two in np.unique(pairs, axis=0).tolist()]


def pierce(
    shell: FlatShell, planes: FacePlanes, face: np.ndarray, corner: np.ndarray
) -> np.ndarray:
    """Return whether (k,) the edges that begin at `corner` (k,) pierce or lie in a `face` (k,).

    Shared vertices do not count.
    """
    ends, slack = np.array([corner, shell.after[corner]]), planes.slack[face]
    rise = (shell.corners[ends] * planes.normals[face]).sum(axis=2) - planes.offsets[face]
    on_plane = np.abs(rise) <= slack
    in_plane = on_plane.all(axis=0)
    is_through = (rise.min(axis=0) < -slack) & (rise.max(axis=0) > slack)
    size = len(shell.index)
    is_shared = np.isin(face * size + shell.edge_of[corner], shell.face_of * size + shell.edge_of)
    size = len(shell.vertices)
    is_own = np.isin(face * size + shell.index[corner], shell.face_of * size + shell.index)
    p, q = (planes.project(face, shell.corners[k]) for k in ends)
    depth = measure_depth(shell, planes, face, p, on_plane[0] & ~is_own)
    result = depth > -ON_SEGMENT_M
    share = np.where(is_through, rise[0] / np.where(is_through, rise[0] - rise[1], 1), 0.5)
    is_asked = (in_plane & ~is_shared) | is_through
    result |= measure_depth(shell, planes, face, p + share[:, None] * (q - p), is_asked) > slack
    asked = np.flatnonzero(in_plane & ~is_shared & ~result)
    place, edge = shell.pair_with_corners(face[asked])
    asked = asked[place]
    others = shell.index[ends[:, asked]]
    is_apart = (shell.index[edge] != others) & (shell.index[shell.after[edge]] != others)
    crosses = cross_strictly(p[asked], q[asked], planes.flat[edge], planes.flat[shell.after[edge]])
    result[asked[crosses & is_apart.all(axis=0)]] = True
    return result


def measure_depth(
    shell: FlatShell, planes: FacePlanes, face: np.ndarray, points: np.ndarray, is_asked: np.ndarray
) -> np.ndarray:
    """Return how far inside the border of a face (k,) points (k, 2) lie, negative outside."""
    result = np.full(len(face), -np.inf)
    numbers, which = np.unique(face[is_asked], return_inverse=True)
    if len(numbers):
        areas, places = shell.draw_faces(numbers, planes.flat), shapely.points(points[is_asked])
        depth = shapely.distance(shapely.boundary(areas)[which], places)
        result[is_asked] = np.where(shapely.intersects(areas[which], places), depth, -depth)
    return result


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
