"""The rules for each face of a shell by itself: val3dity's codes 101 to 208.

A finding is a row (code, face, -1). Bent faces (204) are found by the triangles of their
constrained Delaunay triangulation, of which two are over 20 degrees apart. Rings are compared by
GEOS, as val3dity does.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from ..geometry.components import label_components
from ..geometry.flat_shell import FlatShell

OFF_PLANE_M = 2e-4  # m; besides its flatness, how far off a face still counts as on it
SMALLEST_RING_M2 = 1e-7  # m2; a ring with less is folded to a line
KEPT_AXES = np.array([(1, 2), (0, 2), (0, 1)])  # of a projection along each axis
FLAT_M = 1e-9  # m; a face as flat as this has no bent triangle that is wider


@dataclass(frozen=True)
class FacePlanes:
    """The best plane of each face: unit normal, offset, and how far corners lie off it.

    `axes` (f, 2) are the coordinates that its projection keeps, and `flat` (n, 2) are the corners
    there.
    """

    normals: np.ndarray
    offsets: np.ndarray
    flatness: np.ndarray
    axes: np.ndarray
    flat: np.ndarray

    @cached_property
    def slack(self) -> np.ndarray:
        """How far off its plane (f,) still counts as on a face."""
        return self.flatness + OFF_PLANE_M

    def project(self, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return points (k, 3) in the projections of `faces` (k,)."""
        return np.take_along_axis(points, self.axes[faces], axis=1)


def fit_planes(shell: FlatShell, normals: np.ndarray) -> FacePlanes:
    """Fit a plane to each face by least squares; `normals` (f, 3) say which way it looks."""
    face_of = shell.face_of
    count = np.maximum(np.bincount(face_of, minlength=shell.faces), 1)[:, None]
    centres = shell.sum_by_face(shell.corners) / count
    off = shell.corners - centres[face_of]
    products = shell.sum_by_face((off[:, :, None] * off[:, None]).reshape(-1, 9))
    across = np.linalg.eigh(products.reshape(-1, 3, 3))[1][:, :, 0]
    normals = np.copysign(1.0, (across * normals).sum(axis=1, keepdims=True)) * across
    flatness = np.zeros(shell.faces)
    np.maximum.at(flatness, face_of, np.abs((off * normals[face_of]).sum(axis=1)))
    axes = KEPT_AXES[np.abs(normals).argmax(axis=1)]
    flat = np.take_along_axis(shell.corners, axes[face_of], axis=1)
    return FacePlanes(normals, (centres * normals).sum(axis=1), flatness, axes, flat)


def check_faces(shell: FlatShell, planarity_m: float) -> tuple[np.ndarray, FacePlanes, np.ndarray]:
    """Return findings (k, 3), the faces' planes, and the faces (m,) that may be bent."""
    codes = np.zeros(shell.faces, np.int64)
    is_twice = shell.index == shell.index[shell.after]
    codes[shell.face_of[is_twice]] = 102
    codes[shell.face_of_ring[shell.sizes < 3]] = 101
    codes[np.diff(shell.face_start) == 0] = 101
    outer = np.zeros((shell.faces, 3))
    has_rings = np.diff(shell.face_start) > 0
    outer[has_rings] = shell.areas[shell.face_start[:-1][has_rings]]
    size = np.linalg.norm(outer, axis=1)
    codes[(codes == 0) & (size < SMALLEST_RING_M2)] = 104
    is_sound = codes == 0
    planes = fit_planes(shell, outer / np.where(is_sound, size, 1.0)[:, None])
    is_planar = planes.flatness <= planarity_m
    rows = [(code, face) for face, code in enumerate(codes.tolist()) if code]
    rows += [(203, face) for face in np.flatnonzero(is_sound & ~is_planar).tolist()]
    corners = np.bincount(shell.face_of, minlength=shell.faces)
    may_cross = is_sound & (corners > 3)
    crossing = np.unique(shell.face_of_ring[find_crossing_rings(shell, planes.flat, may_cross)])
    is_simple = is_sound.copy()
    is_simple[crossing] = False
    rows += [(104, face) for face in crossing.tolist()]
    for face in np.flatnonzero(is_simple & (np.diff(shell.face_start) > 1)).tolist():
        rows += [(code, face) for code in check_inner_rings(shell, planes, face)]
    may_bend = is_sound & is_planar & (corners > 3) & (planes.flatness > FLAT_M)
    rows.sort(key=lambda row: row[1])
    found = np.array([(code, face, -1) for code, face in rows], np.int64).reshape(-1, 3)
    return found, planes, np.flatnonzero(may_bend)


def find_crossing_rings(shell: FlatShell, flat: np.ndarray, is_asked: np.ndarray) -> np.ndarray:
    """Return rings (k,) of faces asked for that cross, touch or fold back on themselves."""
    rings = np.flatnonzero(is_asked[shell.face_of_ring])
    corners = is_asked[shell.face_of]
    numbers = np.searchsorted(rings, shell.ring_of[corners])
    return rings[~shapely.is_simple(shapely.linearrings(flat[corners], indices=numbers))]


def check_inner_rings(shell: FlatShell, planes: FacePlanes, face: int) -> list[int]:
    """Return the codes of a face's inner rings, at most one a ring."""
    first, last = shell.face_start[face : face + 2].tolist()
    numbers = [np.arange(*shell.ring_start[r : r + 2]) for r in range(first, last)]
    polygons = [shapely.Polygon(planes.flat[corners]) for corners in numbers]
    vertices = [set(shell.index[corners].tolist()) for corners in numbers]
    result, links = [], np.empty((2, 0), np.int64)
    for r in range(1, last - first):
        code = 0
        for s in range(r):
            touch = shapely.intersection(polygons[s].exterior, polygons[r].exterior)
            points = shapely.get_num_coordinates(touch)
            labels = label_components(last - first, links)
            if vertices[r] == vertices[s] and len(numbers[r]) == len(numbers[s]):
                code = 202
            elif touch.length > 0.0 or polygons[s].overlaps(polygons[r]):
                code = 201
            elif points > 1 or (points and labels[r] == labels[s]):
                code = 205
            elif s == 0 and not polygons[0].contains(polygons[r]):
                code = 206
            elif s > 0 and (polygons[s].contains(polygons[r]) or polygons[r].contains(polygons[s])):
                code = 207
            if code:
                break
            if points:
                links = np.column_stack([links, [r, s]])
        if code == 0 and shell.areas[first + r] @ planes.normals[face] > 0:
            code = 208
        result += [code] if code else []
    return result


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
    axes = u, np.cross(face_normals, u), face_normals
    turned = np.zeros((len(shell.index), 3))
    turned[corner] = np.column_stack([(corners * axis[place]).sum(axis=1) for axis in axes])
    collections = triangulate(shell.draw_faces(faces, turned))
    triangles, owner = shapely.get_parts(collections, return_index=True)
    places = shapely.get_coordinates(triangles, include_z=True).reshape(-1, 4, 3)
    bent = np.isin(np.arange(len(faces)), find_bent(measure_normals(places), owner))
    return faces[bent | shapely.is_missing(collections)]


def triangulate(polygons: np.ndarray) -> np.ndarray:
    """Triangulate each of the polygons, None for one that GEOS finds no triangles of."""
    try:
        return np.asarray(shapely.constrained_delaunay_triangles(polygons), object)
    except shapely.GEOSException:
        if len(polygons) == 1:
            return np.array([None], object)
        return np.concatenate([triangulate(polygons[k : k + 1]) for k in range(len(polygons))])


def measure_normals(triangles: np.ndarray) -> np.ndarray:
    """Return unit normals (t, 3) of triangles (t, 4, 3) that look up, zero without area."""
    a, b, c, _ = triangles.swapaxes(0, 1)
    result = np.cross(b - a, c - a)
    size = np.linalg.norm(result, axis=1)
    size = np.where(result[:, 2] > 0.0, size, -size)
    return result / np.where(size == 0.0, 1.0, size)[:, None]


def find_bent(normals: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Return the owners (t,) of two triangles, `normals` (t, 3), over 20 degrees apart."""
    has_area = normals.any(axis=1)
    # Two triangles within 10 degrees of the face are within 20 of one another.
    aside = has_area & (normals[:, 2] < SURELY_FLAT_COSINE)
    is_apart = (normals[aside] @ normals.T < FLAT_COSINE) & has_area
    is_apart &= owner[aside, None] == owner
    return owner[aside][is_apart.any(axis=1)]
