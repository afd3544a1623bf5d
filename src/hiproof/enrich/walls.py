"""The upright faces of a solid, each a polygon in its own plane; areas of all faces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from ..geometry.rings import repair_polygons, ring_normals
from ..model import CEILING, GROUND, ROOF, WALL, Solid
from ..model.roof_figures import FLAT_SLOPE_DEG

# Share of a wall's area that plan may show. Coordinates rounded to a tenth of a millimetre tilt a
# wall of 1 m by 1e-4.
TILT_SHARE = 0.001


class Wall(NamedTuple):
    """A wall of a solid: the number of its face, and its polygon.

    The polygon has coordinates (s, z): metres along the wall, to the right seen from outside, and
    heights. `origin` (2,) is the place in plan where s is 0, `along` (2,) the direction of s.
    """

    face: int
    origin: np.ndarray
    along: np.ndarray
    polygon: shapely.Polygon

    def lift(self, sz: np.ndarray) -> np.ndarray:
        """Return the world coordinates (n, 3) of places (n, 2) on the wall."""
        return np.column_stack([self.origin + sz[:, :1] * self.along, sz[:, 1]])


def find_walls(solid: Solid) -> tuple[Wall, ...]:
    """Return the upright walls of a solid, in the order of its faces."""
    numbers = [k for k, face in enumerate(solid.faces) if face.kind == WALL]
    if not numbers:
        return ()
    outer = [solid.vertices[list(solid.faces[k].rings[0])] for k in numbers]
    normals = ring_normals(outer)
    size = np.linalg.norm(normals, axis=1)
    upright = (np.abs(normals[:, 2]) <= TILT_SHARE * size) & (size > 0)
    return tuple(
        make_wall(solid, numbers[k], normals[k], outer[k][0, :2]) for k in np.flatnonzero(upright)
    )


def make_wall(solid: Solid, number: int, normal: np.ndarray, origin: np.ndarray) -> Wall:
    """Make the wall of a face whose outward normal is `normal` (3,)."""
    along = np.array([-normal[1], normal[0]]) / np.hypot(normal[0], normal[1])
    rings = []
    for ring in solid.faces[number].rings:
        xyz = solid.vertices[list(ring)]
        rings.append(np.column_stack([(xyz[:, :2] - origin) @ along, xyz[:, 2]]))
    polygon = shapely.Polygon(rings[0], rings[1:])
    return Wall(number, origin, along, polygon if polygon.is_valid else repair_polygons(polygon))


# 3DBAG's name of each area that it has too.
OF_3DBAG = {
    "ground_area_m2": "b3_opp_grond",
    "flat_roof_area_m2": "b3_opp_dak_plat",
    "sloped_roof_area_m2": "b3_opp_dak_schuin",
    "outer_wall_area_m2": "b3_opp_buitenmuur",
    "party_wall_area_m2": "b3_opp_scheidingsmuur",
}


def measure_areas(solid: Solid, party_m2: float) -> dict[str, float]:
    """Return areas (m2) by name; `party_m2` of its walls are party walls.

    A roof face is flat below FLAT_SLOPE_DEG, as its azimuth is null there. Ceilings over passages
    count as ground.
    """
    vectors = solid.shell.face_areas
    size = np.linalg.norm(vectors, axis=1)
    kinds = np.array([face.kind for face in solid.faces])
    slope = np.degrees(np.arctan2(np.hypot(vectors[:, 0], vectors[:, 1]), vectors[:, 2]))
    walls = float(size[kinds == WALL].sum())
    return {
        "ground_area_m2": float(size[(kinds == GROUND) | (kinds == CEILING)].sum()),
        "flat_roof_area_m2": float(size[(kinds == ROOF) & (slope < FLAT_SLOPE_DEG)].sum()),
        "sloped_roof_area_m2": float(size[(kinds == ROOF) & (slope >= FLAT_SLOPE_DEG)].sum()),
        "outer_wall_area_m2": max(walls - party_m2, 0.0),
        "party_wall_area_m2": party_m2,
    }


def measure_faces(solid: Solid) -> tuple[np.ndarray, np.ndarray]:
    """Return the areas (n,) and unit normals (n, 3) of a solid's faces."""
    vectors = solid.shell.face_areas
    size = np.linalg.norm(vectors, axis=1)
    return size, vectors / np.maximum(size, 1e-12)[:, None]
