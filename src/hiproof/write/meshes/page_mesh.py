"""A solid as a page draws it.

It has triangles of roofs and walls, and the roof's edges, packed for JavaScript.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass

import numpy as np

from ...model import ROOF, WALL, Solid
from .triangles import faces_triangles


@dataclass(frozen=True)
class PageMesh:
    """Triangles of a solid, their parts, and the roof's edges.

    Corners are (t, 3, 3), the part (t,) is the one that each roofs (-1: a wall), `face` (t,) the
    number of its face, and ends of edges are (e, 2, 3).
    """

    corners: np.ndarray
    part: np.ndarray
    face: np.ndarray
    edges: np.ndarray


def solid_mesh(solid: Solid) -> PageMesh:
    """Return the mesh of a solid, in its own frame.

    Faces on the ground are left out.
    """
    corners, part, edges = [np.empty((0, 3, 3))], [], [np.empty((0, 2, 3))]
    numbers = [k for k, face in enumerate(solid.faces) if face.kind in (ROOF, WALL)]
    faces, face_of = [solid.faces[k] for k in numbers], []
    for number, face, triangles in zip(
        numbers, faces, faces_triangles(solid.vertices, faces), strict=True
    ):
        face_of += [number] * len(triangles)
        corners.append(solid.vertices[triangles])
        part += [max(face.part, 0) if face.kind == ROOF else -1] * len(triangles)
        if face.kind == ROOF:
            rings = (solid.vertices[list(ring)] for ring in face.rings)
            edges += [np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings]
    return PageMesh(
        np.concatenate(corners), np.array(part, int), np.array(face_of, int), np.concatenate(edges)
    )


def pack_values(values: np.ndarray, kind: str) -> str:
    """Return the array's little-endian bytes as Base64."""
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode("ascii")
