"""Changed buildings in 3D: both models, and the points of both surveys.

Values are packed float32 arrays about a corner of each building.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..evaluate.models import BuildingModel
from ..evaluate.run import EvaluatedRun
from ..write.meshes.page_mesh import pack_values, solid_mesh

MOST_CHANGE_POINTS = 2000
"""Points of a survey drawn of a building: at 10 points/m2 all of a house, 32 kB in the page."""


def make_scenes(
    run: EvaluatedRun, earlier: EvaluatedRun, pairs: list[tuple[int, int]]
) -> list[dict[str, Any]]:
    """Return the scene of each changed building.

    `pairs` are the numbers of its models in the update and in the `earlier` run.
    """
    return [
        make_scene(
            (earlier.models[before], earlier.points[before]), (run.models[after], run.points[after])
        )
        for after, before in pairs
    ]


def make_scene(
    before: tuple[BuildingModel, np.ndarray], after: tuple[BuildingModel, np.ndarray]
) -> dict[str, Any]:
    """Return the models and points of a building before and after."""
    places = [
        xyz
        for model, points in (before, after)
        for xyz in (points, np.empty((0, 3)) if model.solid is None else model.solid.vertices)
    ]
    corner = np.concatenate(places).min(axis=0, initial=np.inf)
    origin = np.where(np.isfinite(corner), np.floor(corner), 0.0)
    return {
        "id": after[0].id,
        "before": pack_side(*before, origin),
        "after": pack_side(*after, origin),
    }


def pack_side(model: BuildingModel, points: np.ndarray, origin: np.ndarray) -> dict[str, str]:
    """Return a model's triangles and edges, and points (n, 3), about the origin."""
    corners, edges = np.empty((0, 3, 3)), np.empty((0, 2, 3))
    if model.solid is not None:
        mesh = solid_mesh(model.solid.move(-origin))
        corners, edges = mesh.corners, mesh.edges
    drawn = points[:: max(1, -(-len(points) // MOST_CHANGE_POINTS))] - origin
    values = {"corners": corners, "edges": edges, "points": drawn}
    return {name: pack_values(array, "<f4") for name, array in values.items()}
