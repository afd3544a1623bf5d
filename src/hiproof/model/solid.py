"""A closed shell of planar faces."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely

from ..geometry.flat_shell import FlatShell

ROOF, WALL, GROUND = "RoofSurface", "WallSurface", "GroundSurface"
CEILING = "OuterCeilingSurface"  # over a passage


@dataclass(frozen=True)
class Face:
    """A planar polygon of a solid: `rings` of vertex indices.

    The outer ring comes first, counter-clockwise when seen from outside. `kind` is RoofSurface,
    WallSurface, GroundSurface or OuterCeilingSurface; `part` the index of the roof part of a
    RoofSurface, else -1.
    """

    rings: tuple[tuple[int, ...], ...]
    kind: str
    part: int = -1


@dataclass(frozen=True)
class Solid:
    """A closed shell: `vertices` (n, 3) and `faces` that point outwards.

    A Building's solid is in world coordinates. `defects` are (ISO 19107 code, face) of a shell read
    from a file that its vertices cannot show, such as an open ring.
    """

    vertices: np.ndarray
    faces: tuple[Face, ...]
    defects: tuple[tuple[int, int], ...] = ()

    def move(self, shift: np.ndarray) -> Solid:
        return Solid(self.vertices + shift, self.faces, self.defects)

    def drop_unused_vertices(self) -> Solid:
        """Return the solid with only the vertices that its faces use, in their order."""
        used = np.unique(self.flatten()[0])
        number = {vertex: index for index, vertex in enumerate(used.tolist())}
        faces = tuple(
            replace(face, rings=tuple(tuple([number[v] for v in ring]) for ring in face.rings))
            for face in self.faces
        )
        return replace(self, vertices=self.vertices[used], faces=faces)

    @property
    def volume(self) -> float:
        """Volume [m3] by the divergence theorem; positive when the faces point outwards."""
        return round(self.shell.volume, 9)

    @property
    def shell(self) -> FlatShell:
        """The shell as arrays, about the mean of its vertices."""
        return FlatShell(self.vertices - self.vertices.mean(axis=0), *self.flatten())

    def flatten(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the rings' vertices end to end, each ring's start, each face's first ring."""
        rings = [ring for face in self.faces for ring in face.rings]
        index = np.array([vertex for ring in rings for vertex in ring], np.int64)
        ring_start = np.cumsum([0, *map(len, rings)], dtype=np.int64)
        face_start = np.cumsum([0, *(len(face.rings) for face in self.faces)], dtype=np.int64)
        return index, ring_start, face_start

    def select_faces(self, kind: str) -> tuple[Face, ...]:
        return tuple(face for face in self.faces if face.kind == kind)

    def project_face(self, face: Face) -> shapely.Polygon:
        """Return a face of the solid in plan, its holes left out."""
        outer, *holes = (self.vertices[list(ring), :2] for ring in face.rings)
        return shapely.Polygon(outer, holes)
