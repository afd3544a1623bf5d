"""Bent faces, of which two triangles are over 20 degrees apart.

The triangles are those of their constrained Delaunay triangulation (val3dity's 204).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely

from ..compiled import compiled
from ..geometry.area_vectors import cross, dot
from ..geometry.arrays import copy_row

# val3dity's limit of 20 degrees, and half of it, below which no pair needs to be compared
FLAT_COSINE, SURELY_FLAT_COSINE = np.cos(np.deg2rad(20.0)), np.cos(np.deg2rad(10.0))


def bent_faces(
    faces: np.ndarray,
    vertices: np.ndarray,
    index: np.ndarray,
    ring_start: np.ndarray,
    face_start: np.ndarray,
    normals: np.ndarray,
) -> np.ndarray:
    """Return those of `faces` (k,) that are bent, or that no triangles fill.

    The solid is flattened as for `check_faces`, and `normals` (f, 3) are those of its best planes.

    >>> saddle = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 1], [0, 1,
    ...     0]]), np.arange(4), np.array([0, 4]), np.array([0, 1])
    >>> bent_faces(np.array([0]), *saddle, np.array([[-0.4, -0.4, 0.8]])).tolist()
    [0]
    """
    if len(faces) == 0:
        return faces
    corners, flat, start = in_their_planes(faces, vertices, index, ring_start, face_start, normals)
    polygons = []
    for face, lower in zip(faces, start[:-1], strict=True):
        bounds = ring_start[face_start[face] : face_start[face + 1] + 1]
        outer, *holes = (flat[lower + a : lower + b] for a, b in pairwise(bounds - bounds[0]))
        polygons.append(shapely.Polygon(outer, holes))
    collections = triangulate(polygons)
    triangles, owner = shapely.get_parts(collections, return_index=True)
    places = shapely.get_coordinates(triangles).reshape(-1, 4, 2)
    bent = are_bent(places, owner, corners, flat, start, normals[faces])
    return faces[bent | shapely.is_missing(collections)]


def triangulate(polygons: list[shapely.Polygon]) -> np.ndarray:
    """Triangulate each of the polygons, None for one that GEOS finds no triangles of."""
    try:
        return np.asarray(shapely.constrained_delaunay_triangles(polygons), object)
    except shapely.GEOSException:
        if len(polygons) == 1:
            return np.array([None], object)
        return np.concatenate([triangulate([polygon]) for polygon in polygons])


@compiled
def in_their_planes(faces, vertices, index, ring_start, face_start, normals):
    """Return the vertices (m, 3) of `faces`, and the same (m, 2) in their planes.

    They are those of all rings; each face's start comes with them.
    """
    start = np.zeros(len(faces) + 1, np.int64)
    for k in range(len(faces)):
        face = faces[k]
        start[k + 1] = start[k] + ring_start[face_start[face + 1]] - ring_start[face_start[face]]
    corners, flat = np.empty((start[-1], 3)), np.empty((start[-1], 2))
    for k in range(len(faces)):
        lower, normal = ring_start[face_start[faces[k]]], normals[faces[k]]
        perpendicular = np.zeros(3)
        perpendicular[np.argmin(np.abs(normal))] = 1.0
        u = cross(normal, perpendicular)
        u /= np.sqrt(dot(u, u))
        v = cross(normal, u)
        for i in range(start[k], start[k + 1]):
            copy_row(corners[i], vertices[index[lower + i - start[k]]])
            flat[i, 0], flat[i, 1] = dot(corners[i], u), dot(corners[i], v)
    return corners, flat, start


@compiled
def corner_at(x, y, flat, lower, upper):
    """Return the vertex of flat[lower:upper] that lies at (x, y)."""
    for i in range(lower, upper):
        if flat[i, 0] == x and flat[i, 1] == y:
            return i
    return lower


@compiled
def triangle_normals(places, owner, corners, flat, start, normals):
    """Return the unit normals (t, 3) of triangles, zero without an area.

    Triangles have `places` (t, 4, 2) in their face's plane.
    """
    result = np.zeros((len(places), 3))
    for t in range(len(places)):
        lower, upper = start[owner[t]], start[owner[t] + 1]
        a = corners[corner_at(places[t, 0, 0], places[t, 0, 1], flat, lower, upper)]
        b = corners[corner_at(places[t, 1, 0], places[t, 1, 1], flat, lower, upper)]
        c = corners[corner_at(places[t, 2, 0], places[t, 2, 1], flat, lower, upper)]
        normal = cross(b - a, c - a)
        size = np.sqrt(dot(normal, normal))
        if size > 0:
            size = size if dot(normal, normals[owner[t]]) > 0 else -size
            copy_row(result[t], normal / size)
    return result


@compiled
def are_bent(places, owner, corners, flat, start, normals):
    """Return whether each face (k,) has two triangles over 20 degrees apart.

    `owner` (t,) is the face of each triangle.
    """
    bent = np.zeros(len(normals), np.bool_)
    result = triangle_normals(places, owner, corners, flat, start, normals)
    for t in range(len(result)):
        if (
            dot(result[t], normals[owner[t]]) >= SURELY_FLAT_COSINE
            or not result[t].any()
            or bent[owner[t]]
        ):
            continue  # two triangles within 10 degrees of the face are within 20 of one another
        for s in range(len(result)):
            if owner[s] == owner[t] and result[s].any() and dot(result[s], result[t]) < FLAT_COSINE:
                bent[owner[t]] = True
    return bent
