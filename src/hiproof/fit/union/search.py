"""Search the volumes of a plan.

Structure is searched with some of the points, and fitted again to all of them.
"""

from __future__ import annotations

import numpy as np
import shapely

from .allowed import list_allowed_shapes
from .grow import grow
from .large import find_in_blocks
from .moves import refit_volumes
from .objective import compute_objective
from .plan import Plan
from .prices import LARGE_ROOF_M2, compute_unit_points
from .scene import Scene, find_directions, make_scene, thin_scene
from .trim import trim

SEARCH_POINTS = 600  # Points in which structure is searched.


def find_volumes(
    plan: Plan, outline: shapely.Polygon, settings, types: tuple[str, ...] = ()
) -> tuple[np.ndarray, float, Scene]:
    """Find the volumes (k, COLUMNS) of the roof over `outline`.

    Also returns their objective (points) and the scene of all points. `settings` are those of
    [compound]. Volumes have only shapes that parts of `types` need, any without types.
    """
    count = len(plan.cloud.u)
    numbers = np.arange(min(count, SEARCH_POINTS)) * count // min(count, SEARCH_POINTS)
    evidence = [
        compute_unit_points(plan.density * share, outline.area, settings)
        for share in (len(numbers) / count, 1.0)
    ]
    angles = find_directions(outline, plan)
    full_scene = make_scene(
        plan, outline, angles, evidence[1], settings.tolerance_m, list_allowed_shapes(types)
    )
    # Otherwise, the search of a house uses every point.
    if outline.area > LARGE_ROOF_M2 and count > SEARCH_POINTS:
        volumes = find_in_blocks(plan, outline, full_scene)
        return volumes, compute_objective(volumes, full_scene), full_scene
    scene = thin_scene(full_scene, numbers, evidence[0])
    volumes, _ = grow(scene)
    value = compute_objective(volumes, full_scene)
    volumes, value = refit_volumes(volumes, full_scene, value)
    return *trim(volumes, full_scene, value), full_scene
