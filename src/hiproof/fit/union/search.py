"""From a plan to volumes: structure from some of the points, simplified as a draughtsman would, settled on all of them."""

from __future__ import annotations

import numpy as np
import shapely

from .allowed import allowed_shapes
from .block import settle_all
from .groups import run_in_groups
from .grow import grow
from .improve import simplify
from .large import find_in_windows
from .objective import objective
from .plan import Plan
from .prices import COMMON_HOUSE_M2, LARGE_M2, evidence_per_unit
from .regions import Site
from .run_on import run_on
from .scene import Scene, directions_of, scene_of, seen_through
from .trim import trim

SEARCH_POINTS = 600  # points that structure is looked for in; all of them settle it
# What a person would leave out of low-pitched roofs: differences up to LENIENT_M (more on large roofs).
LENIENT_M, LENIENT_MORE_M, LENIENT_SOFT_M, LENIENT_SLOPE = 0.1, 0.04, 0.18, 0.15


def find_volumes(
    plan: Plan, outline: shapely.Polygon, settings, types: tuple[str, ...] = ()
) -> tuple[np.ndarray, float, Scene]:
    """Volumes (k, COLUMNS) of the roof over `outline`, their objective (points) and the scene of all points.

    `settings` are those of [compound]; volumes have only shapes that parts of `types` need (any where there are none).
    """
    count = len(plan.cloud.u)
    few = np.arange(min(count, SEARCH_POINTS)) * count // min(count, SEARCH_POINTS)
    evidence = [evidence_per_unit(plan.density * share, outline.area, settings) for share in (len(few) / count, 1.0)]
    angles = directions_of(outline, plan)
    every = scene_of(plan, outline, angles, evidence[1], settings.tolerance_m, allowed_shapes(types))
    if outline.area > LARGE_M2 and count > SEARCH_POINTS:  # else a house's search sees every point
        site = Site(outline, plan, every, {})
        volumes = run_in_groups(trim_and_run_on, find_in_windows(plan, outline, every), site)
        return volumes, objective(volumes, every, np.inf), every
    scene = seen_through(every, few, evidence[0])
    volumes, _ = grow(scene)
    volumes, value = settle_all(volumes, every)
    lenient = lenient_scene(scene, outline.area)
    volumes, _ = simplify(volumes, lenient, objective(volumes, lenient, np.inf), LENIENT_SLOPE)
    volumes, value = settle_all(volumes, every)
    volumes, value = trim(volumes, every, value)
    volumes, value = run_on(volumes, every, value)
    return volumes, value, every


def trim_and_run_on(volumes: np.ndarray, scene: Scene, _: object = None) -> np.ndarray:
    """Draw hidden edges in, and let ends that stand out of a neighbour run on into it."""
    volumes, value = trim(volumes, scene, objective(volumes, scene, np.inf))
    return run_on(volumes, scene, value)[0]


def lenient_scene(scene: Scene, area_m2: float) -> Scene:
    """The scene with a larger residual free of cost."""
    dead = LENIENT_M + LENIENT_MORE_M * min(max((area_m2 - COMMON_HOUSE_M2) / 100.0, 0.0), 1.0)
    return scene._replace(dead=dead, width=LENIENT_SOFT_M)
