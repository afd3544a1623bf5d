"""Planar faces cut into triangles, for formats that hold nothing else."""

from __future__ import annotations

import numpy as np
import shapely

from ..model import Face
from ..rings import ring_normal


def face_triangles(vertices: np.ndarray, face: Face) -> np.ndarray:
    """Vertex indices (t, 3) of triangles that tile `face` (holes left out), oriented like its outer ring.

    `vertices` (n, 3) in any frame. No vertices are added, so that neighbouring faces stay joined.

    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> face_triangles(square, Face(((0, 1, 2, 3),), "RoofSurface")).shape
    (2, 3)
    """
    outer = np.array(face.rings[0])
    if len(outer) == 3 and len(face.rings) == 1:
        return outer[None]
    normal = ring_normal(vertices[outer])
    # Dropping the axis of the largest normal component keeps the plan's coordinates exact, so they name their vertex.
    axis = int(np.argmax(np.abs(normal)))
    axes = [(axis + 1) % 3, (axis + 2) % 3]
    rings = [vertices[list(ring)][:, axes] for ring in face.rings]
    index_of = {
        tuple(xy): index
        for ring, flat in zip(face.rings, rings, strict=True)
        for index, xy in zip(ring, flat, strict=True)
    }
    tiles = shapely.constrained_delaunay_triangles(shapely.Polygon(rings[0], rings[1:]))
    found = [[index_of[tuple(xy)] for xy in shapely.get_coordinates(tile)[:3]] for tile in shapely.get_parts(tiles)]
    triangles = np.array(found, int).reshape(-1, 3)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    turned = np.cross(b - a, c - a)[:, axis] * normal[axis] < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return triangles
