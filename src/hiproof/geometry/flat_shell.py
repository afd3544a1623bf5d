"""The rings of a shell as arrays: what the rules of ISO 19107 are checked on.

A corner is a place in a ring. Polygons are looked at in the projection along the largest component
of their normal, which only drops a coordinate and so moves nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from .components import label_components
from .grid import expand

SAME_POINT_M = 1e-3  # m; val3dity's snap tolerance
ON_SEGMENT_M = 1e-9  # m; numerically on the segment


@dataclass(frozen=True)
class FlatShell:
    """A flattened shell (`Solid.flatten`): ring r has corners ring_start[r]:ring_start[r + 1].

    Face f has the rings face_start[f]:face_start[f + 1], the outer one first.
    """

    vertices: np.ndarray
    index: np.ndarray
    ring_start: np.ndarray
    face_start: np.ndarray

    @cached_property
    def sizes(self) -> np.ndarray:
        """The number of corners of each ring."""
        return np.diff(self.ring_start)

    @cached_property
    def ring_of(self) -> np.ndarray:
        """The ring of each corner."""
        return np.repeat(np.arange(len(self.sizes)), self.sizes)

    @cached_property
    def face_of_ring(self) -> np.ndarray:
        return np.repeat(np.arange(self.faces), np.diff(self.face_start))

    @cached_property
    def face_of(self) -> np.ndarray:
        """The face of each corner."""
        return self.face_of_ring[self.ring_of]

    @cached_property
    def after(self) -> np.ndarray:
        """The corner that follows each corner in its ring."""
        after, has_corners = np.arange(len(self.index)) + 1, self.sizes > 0
        after[self.ring_start[1:][has_corners] - 1] = self.ring_start[:-1][has_corners]
        return after

    @cached_property
    def corners(self) -> np.ndarray:
        """The place (n, 3) of each corner."""
        return self.vertices[self.index]

    @cached_property
    def edge_of(self) -> np.ndarray:
        """The number of the edge that begins at each corner, the same in either direction."""
        ends = np.sort(np.column_stack([self.index, self.index[self.after]]), axis=1)
        keys = ends[:, 0] * len(self.vertices) + ends[:, 1]
        return np.unique(keys, return_inverse=True)[1]

    @property
    def faces(self) -> int:
        return len(self.face_start) - 1

    def pair_with_corners(self, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return each place in `faces` (k,) with each corner of the face there, as pairs."""
        member, place = expand(np.bincount(self.face_of, minlength=self.faces)[faces])
        return member, self.ring_start[self.face_start[faces]][member] + place

    def draw_faces(self, faces: np.ndarray, flat: np.ndarray) -> np.ndarray:
        """Return the polygons of ascending `faces` (k,), their corners at `flat` (n, 2 or 3)."""
        is_drawn = np.zeros(self.faces, bool)
        is_drawn[faces] = True
        corners = np.flatnonzero(is_drawn[self.face_of])
        numbers, ring_of = np.unique(self.ring_of[corners], return_inverse=True)
        rings = shapely.linearrings(flat[corners], indices=ring_of)
        return shapely.polygons(rings, indices=np.searchsorted(faces, self.face_of_ring[numbers]))

    def sum_by_face(self, values: np.ndarray) -> np.ndarray:
        """Sum values (n,) or (n, k) of corners by face."""
        columns = values.reshape(len(values), -1).T
        sums = [np.bincount(self.face_of, column, self.faces) for column in columns]
        return np.stack(sums, axis=-1).reshape(self.faces, *values.shape[1:])

    @cached_property
    def areas(self) -> np.ndarray:
        """The area vector (r, 3) of each ring: half as long, it has the ring's area."""
        origins = self.corners[np.minimum(self.ring_start[:-1], len(self.index) - 1)]
        spokes = self.corners - origins[self.ring_of]
        parts = np.cross(spokes, spokes[self.after]).T / 2
        return np.column_stack([np.bincount(self.ring_of, part, len(self.sizes)) for part in parts])

    @cached_property
    def face_areas(self) -> np.ndarray:
        """The area vector (f, 3) of each face, of which its holes take away."""
        parts = self.areas.T
        return np.column_stack([np.bincount(self.face_of_ring, part, self.faces) for part in parts])

    @property
    def volume(self) -> float:
        """What the shell encloses, by the divergence theorem; positive if faces point outwards."""
        anchors = self.corners[self.ring_start[self.face_start[self.face_of_ring]]]
        return float((anchors * self.areas).sum() / 3)


def weld(vertices: np.ndarray) -> np.ndarray:
    """Return for each vertex (n, 3) the first one of those that are one point with it."""
    points = shapely.points(vertices[:, :2])
    pairs = shapely.STRtree(points).query(points, predicate="dwithin", distance=SAME_POINT_M)
    is_same = np.linalg.norm(vertices[pairs[0]] - vertices[pairs[1]], axis=1) < SAME_POINT_M
    labels = label_components(len(vertices), pairs[:, is_same])
    return np.unique(labels, return_index=True)[1][labels]


def cross_2d(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return on which side of the lines from a to b points c lie; all are (n, 2)."""
    return (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])


def cross_strictly(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return whether the open segments ab and cd cross in one point; all are (n, 2)."""
    return (np.sign(cross_2d(a, b, c)) * np.sign(cross_2d(a, b, d)) < 0) & (
        np.sign(cross_2d(c, d, a)) * np.sign(cross_2d(c, d, b)) < 0
    )
