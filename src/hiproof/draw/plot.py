"""A building over its points, by matplotlib."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..extras import import_extra
from ..log import count_things
from ..model import Building, as_xyz
from ..write.colours import RESIDUAL_STOPS
from .view import TILT_DEG, choose_turn, lightness, list_colours, shade_colour

NEAR_M = 0.2  # m; within it a point counts as explained, as in share_within_20cm
NEAR_COLOUR, FAR_COLOUR = RESIDUAL_STOPS[0][1], RESIDUAL_STOPS[-1][1]
MOST_PLOT_POINTS = 5000  # points drawn; more make a black patch


def plot(building: Building, points: np.ndarray | None = None, ax: Any = None) -> Any:
    """Draw the building's solid, and `points`, into matplotlib axes.

    `points` (n, 3) are world metres, and coloured by their height over its roof. ax:
    three-dimensional axes to draw into; made if None. Returns them. Points within 0.2 m of the roof
    are blue, others red. Raises NoModelError for a building without a model, InputError for points
    of another shape and where matplotlib (extra `report`) is missing.
    """
    model = building.model
    ax = ax if ax is not None else new_axes(choose_turn(building))
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    origin = model.roof.frame.origin
    vertices = model.solid.vertices - origin
    faces = model.solid.faces
    colours = [
        shade_colour(c, lightness(model.solid, f))
        for c, f in zip(list_colours(building), faces, strict=True)
    ]
    rings = [vertices[list(face.rings[0])] for face in faces]
    size = max(map(len, rings))  # matplotlib fills shorter ones with whatever is in memory
    polygons = [np.pad(ring, ((0, size - len(ring)), (0, 0)), mode="edge") for ring in rings]
    ax.add_collection3d(
        Poly3DCollection(
            polygons, facecolors=colours, edgecolors="#333333", linewidths=0.6, alpha=0.75
        )
    )
    visible = vertices
    if points is not None and len(points):
        points = as_xyz(points)
        points = points[np.isfinite(points).all(axis=1)]  # others are in no place
        local = points[:: max(1, len(points) // MOST_PLOT_POINTS)] - origin
        gap = local[:, 2] - model.roof.height_at(local[:, :2])
        mask = np.abs(gap) <= NEAR_M
        for selection, colour, label in (
            (mask, NEAR_COLOUR, "within 0.2 m"),
            (~mask, FAR_COLOUR, "further"),
        ):
            ax.scatter(
                *local[selection].T,
                s=2,
                color=colour,
                label=f"{label}: {count_things(selection.sum(), 'point')}",
                depthshade=False,
            )
        ax.legend(loc="upper left", fontsize="small")
        visible = np.concatenate([vertices, local])
    smallest, largest = visible.min(axis=0), visible.max(axis=0)
    ax.set(
        xlim=(smallest[0], largest[0]),
        ylim=(smallest[1], largest[1]),
        zlim=(smallest[2], largest[2]),
    )
    ax.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title=f"{building.id}: {building.type}")
    ax.set_box_aspect(np.maximum(largest - smallest, 0.1))
    return ax


def new_axes(turn_deg: float) -> Any:
    """Make three-dimensional axes with the view of a notebook."""
    plt = import_extra("matplotlib.pyplot", "report", "plots")
    ax = plt.figure(figsize=(7, 6)).add_subplot(projection="3d")
    # seen from the south where nothing is turned
    ax.view_init(elev=TILT_DEG, azim=-90.0 - turn_deg)
    return ax
