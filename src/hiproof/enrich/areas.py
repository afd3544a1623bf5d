"""Areas of a solid's outer walls, party walls, roofs and grounds."""

from __future__ import annotations

import numpy as np

from ..model import CEILING, GROUND, ROOF, WALL, Solid
from ..model.roof_figures import FLAT_SLOPE_DEG, make_triangles, sum_by_face

OF_3DBAG = {
    "ground_area_m2": "b3_opp_grond",
    "flat_roof_area_m2": "b3_opp_dak_plat",
    "sloped_roof_area_m2": "b3_opp_dak_schuin",
    "outer_wall_area_m2": "b3_opp_buitenmuur",
    "party_wall_area_m2": "b3_opp_scheidingsmuur",
}
"""3DBAG's name of each area that it has too."""


def measure_areas(solid: Solid, party_m2: float) -> dict[str, float]:
    """Return areas (m2) by name; `party_m2` of its walls are party walls.

    A roof face is flat below FLAT_SLOPE_DEG, as its azimuth is null there. Ceilings over passages
    count as ground.
    """
    vectors = area_vectors(solid)
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


def area_vectors(solid: Solid) -> np.ndarray:
    """Return the vector areas (faces, 3) of a solid's faces."""
    triangles = make_triangles(solid, solid.vertices.mean(axis=0))
    return sum_by_face(triangles.vectors, triangles.face_of, len(solid.faces))


def measure_faces(solid: Solid) -> tuple[np.ndarray, np.ndarray]:
    """Return the areas (n,) and unit normals (n, 3) of a solid's faces."""
    vectors = area_vectors(solid)
    size = np.linalg.norm(vectors, axis=1)
    return size, vectors / np.maximum(size, 1e-12)[:, None]
