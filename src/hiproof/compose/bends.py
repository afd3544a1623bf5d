"""Bent faces, of which two triangles are over 20 degrees apart.

The triangles are those of their constrained Delaunay triangulation (val3dity's 204).
"""

from __future__ import annotations

import numpy as np
import shapely

from ..geometry.flat_shell import FlatShell

# val3dity's limit of 20 degrees, and half of it, below which no pair needs to be compared
FLAT_COSINE, SURELY_FLAT_COSINE = np.cos(np.deg2rad(20.0)), np.cos(np.deg2rad(10.0))


def bent_faces(shell: FlatShell, faces: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return those of ascending `faces` (k,) that are bent, or that no triangles fill.

    `normals` (f, 3) are those of the best planes of all faces.

    >>> places = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1, 0]])
    >>> saddle = FlatShell(places, np.arange(4), np.array([0, 4]), np.array([0, 1]))
    >>> bent_faces(saddle, np.array([0]), np.array([[-0.4, -0.4, 0.8]])).tolist()
    [0]
    """
    if len(faces) == 0:
        return faces
    place, corner = shell.pair_with_corners(faces)
    corners, face_normals = shell.corners[corner], normals[faces]
    u = np.cross(face_normals, np.eye(3)[np.abs(face_normals).argmin(axis=1)])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    axes = u, np.cross(face_normals, u)
    flat = np.zeros((len(shell.index), 2))
    flat[corner] = np.column_stack([(corners * axis[place]).sum(axis=1) for axis in axes])
    collections = triangulate(shell.draw_faces(faces, flat))
    triangles, owner = shapely.get_parts(collections, return_index=True)
    places = shapely.get_coordinates(triangles).reshape(-1, 4, 2)
    start = np.append(0, np.cumsum(np.bincount(place)))
    triangle_normals = measure_triangle_normals(
        places, owner, corners, flat[corner], start, face_normals
    )
    bent = are_bent(triangle_normals, owner, face_normals)
    return faces[bent | shapely.is_missing(collections)]


def triangulate(polygons: np.ndarray) -> np.ndarray:
    """Triangulate each of the polygons, None for one that GEOS finds no triangles of."""
    try:
        return np.asarray(shapely.constrained_delaunay_triangles(polygons), object)
    except shapely.GEOSException:
        if len(polygons) == 1:
            return np.array([None], object)
        return np.concatenate([triangulate(polygons[k : k + 1]) for k in range(len(polygons))])


def measure_triangle_normals(
    places: np.ndarray,
    owner: np.ndarray,
    corners: np.ndarray,
    flat: np.ndarray,
    start: np.ndarray,
    normals: np.ndarray,
) -> np.ndarray:
    """Return the unit normals (t, 3) of triangles, zero without an area.

    Triangles have `places` (t, 4, 2) in their face's plane. They face as the `normals` (k, 3) do.
    """
    faces = np.repeat(np.arange(len(normals)), np.diff(start)).tolist()
    vertices = dict(zip(zip(faces, *flat.T.tolist(), strict=True), corners.tolist(), strict=True))
    first_vertices = corners[start[:-1]].tolist()
    triangles = [
        [vertices.get((face, x, y), first_vertices[face]) for x, y in ring[:3]]
        for face, ring in zip(owner.tolist(), places.tolist(), strict=True)
    ]
    a, b, c = np.array(triangles).reshape(-1, 3, 3).swapaxes(0, 1)
    result = np.cross(b - a, c - a)
    size = np.linalg.norm(result, axis=1)
    size = np.where((result * normals[owner]).sum(axis=1) > 0.0, size, -size)
    return result / np.where(size == 0.0, 1.0, size)[:, None]


def are_bent(normals: np.ndarray, owner: np.ndarray, face_normals: np.ndarray) -> np.ndarray:
    """Return whether each face (k,) has two triangles over 20 degrees apart.

    `normals` (t, 3) are those of the triangles, and `owner` (t,) is the face of each.
    """
    has_area = normals.any(axis=1)
    # Two triangles within 10 degrees of the face are within 20 of one another.
    aside = has_area & ((normals * face_normals[owner]).sum(axis=1) < SURELY_FLAT_COSINE)
    is_apart = (normals[aside] @ normals.T < FLAT_COSINE) & has_area
    is_apart &= owner[aside, None] == owner
    bent = np.zeros(len(face_normals), bool)
    bent[owner[aside][is_apart.any(axis=1)]] = True
    return bent
