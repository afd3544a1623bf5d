"""Planar faces cut into triangles, for formats that hold nothing else, and for pages."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from ...geometry.rings import ring_normals
from ...model import ROOF, WALL, Face, Solid


def face_triangles(vertices: np.ndarray, face: Face) -> np.ndarray:
    """Return vertex indices (t, 3) of triangles that tile `face`.

    Holes are left out. Triangles are oriented like the outer ring. `vertices` (n, 3) in any frame.
    No vertices are added, so that neighbouring faces stay joined.

    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> face_triangles(square, Face(((0, 1, 2, 3),), "RoofSurface")).shape
    (2, 3)
    """
    return faces_triangles(vertices, [face])[0]


def face_normals(vertices: np.ndarray, faces: Sequence[Face]) -> np.ndarray:
    """Return the vector areas (n, 3) of the outer rings of n faces."""
    return (
        ring_normals([vertices[list(face.rings[0])] for face in faces])
        if faces
        else np.empty((0, 3))
    )


def faces_triangles(
    vertices: np.ndarray, faces: Sequence[Face], normals: np.ndarray | None = None
) -> list[np.ndarray]:
    """Return every face's triangles as `face_triangles`, by one call, by known `normals`."""
    neighbours = [number for number, face in enumerate(faces) if not is_triangle(face)]
    normals = face_normals(vertices, faces) if normals is None else normals
    tiles = iter(
        cut_faces(vertices, [faces[number].rings for number in neighbours], normals[neighbours])
        if neighbours
        else []
    )
    return [np.array(face.rings[:1], int) if is_triangle(face) else next(tiles) for face in faces]


def is_triangle(face: Face) -> bool:
    return len(face.rings) == 1 and len(face.rings[0]) == 3


def cut_faces(
    vertices: np.ndarray, faces: Sequence[Sequence[Sequence[int]]], normals: np.ndarray
) -> list[np.ndarray]:
    """Return triangles (t, 3) of faces of rings, with normals (n, 3), by constrained Delaunay."""
    # Dropping the axis of the largest normal component keeps the plan's coordinates exact. In its
    # place stands the number of the vertex.
    axes = np.abs(normals).argmax(axis=1)
    plans = [
        [
            np.column_stack([vertices[list(ring)][:, [(axis + 1) % 3, (axis + 2) % 3]], ring])
            for ring in rings
        ]
        for axis, rings in zip(axes, faces, strict=True)
    ]
    polygons = [shapely.Polygon(outer, holes) for outer, *holes in plans]
    tiles, owner = shapely.get_parts(
        shapely.constrained_delaunay_triangles(polygons), return_index=True
    )
    corners = shapely.get_coordinates(tiles, include_z=True).reshape(-1, 4, 3)[:, :3]
    (ax, ay, _), (bx, by, _) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    turned = (ax * by - ay * bx) * normals[owner, axes[owner]] < 0
    corners[turned] = corners[turned][:, ::-1]
    numbers = corners[:, :, 2].astype(int)
    return [numbers[owner == face] for face in range(len(faces))]


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
    """Return a solid's mesh in its own frame, without faces on the ground."""
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
