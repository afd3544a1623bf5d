"""Search the volumes of a plan.

Structure is searched with some of the points, and fitted again to all of them.
"""

from __future__ import annotations

import numpy as np
import shapely

from ..prices import compute_unit
from .allowed import list_allowed_shapes
from .blocks import HeightRaster
from .grow import grow
from .large import search_box
from .moves import refit_volumes
from .objective import compute_objective, is_base_visible
from .plan import Plan
from .scene import find_directions, make_scene, thin_scene
from .trim import trim
from .volumes import make_base
from .whole import Whole

SEARCH_POINTS = 600  # Points in which structure is searched.
LARGE_ROOF_M2 = 200.0  # Area (m2) from which on a roof is searched block by block.


def lay_out_whole(
    plan: Plan, outline: shapely.Polygon, settings, types: tuple[str, ...] = ()
) -> Whole:
    """Return the scene of all points with what is searched block by block.

    `settings` are those of [compound]. Volumes have only shapes that parts of `types` need, any
    without types.
    """
    unit = compute_unit(plan.density, settings)
    angles, allowed = find_directions(outline, plan), list_allowed_shapes(types)
    scene = make_scene(plan, outline, angles, unit, settings.tolerance_m, allowed)
    return Whole(scene, plan, outline)


def find_volumes(whole: Whole, settings) -> np.ndarray:
    """Find the volumes (k, COLUMNS) of a roof. `settings` are those of [compound]."""
    scene, count = whole.scene, whole.scene.n
    if whole.area > LARGE_ROOF_M2 and count > SEARCH_POINTS:
        blocks = search_box(whole, HeightRaster(whole), whole.box, whole.area)
        return np.concatenate(blocks or [make_base(float(whole.z.min()))])
    numbers = np.arange(min(count, SEARCH_POINTS)) * count // min(count, SEARCH_POINTS)
    density = whole.plan.density * len(numbers) / count
    thinned = thin_scene(scene, numbers, compute_unit(density, settings))
    volumes, _ = grow(thinned)
    volumes, value = refit_volumes(volumes, scene, compute_objective(volumes, scene))
    volumes, _ = trim(volumes, scene, value)
    return volumes if is_base_visible(volumes, scene) else volumes[1:]
