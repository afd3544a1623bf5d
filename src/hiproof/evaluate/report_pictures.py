"""Small SVG pictures for the report: histograms, and models with points."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

import numpy as np

from ..data_files import draw_rings
from ..geometry.rings import ring_normal
from ..model import GROUND, ROOF, Solid
from ..write.colours import RESIDUAL_STOPS
from ..write.meshes.viewed import choose_look

MOST_PICTURE_POINTS = 400  # dots in a small picture; more would cover the model
CHART_WIDTH, CHART_HEIGHT = 300, 210  # pixels; three pictures stand side by side on a laptop

# of all quantities shown, below what they are known by: values so near each other are one
NARROWEST = 1e-3


def residual_bins(distances: np.ndarray) -> np.ndarray:
    """Index (n,) of the residual colour of each distance in metres."""
    return np.searchsorted([stop for stop, _ in RESIDUAL_STOPS[1:]], distances, side="right")


def histogram(values: np.ndarray, title: str, unit: str, bins: int = 30) -> str:
    """Draw a histogram of the finite `values`, all above the 98th percentile in one bar."""
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    heading = f"{title} ({unit})" if unit else title
    if not len(values):
        return f"<figure><figcaption>{escape(heading)}: no figures</figcaption></figure>"
    if np.ptp(values) < NARROWEST:
        return (
            f"<figure><figcaption>{escape(heading)}: {short(values.mean())} for "
            "all</figcaption></figure>"
        )
    smallest, upper = float(values.min()), float(np.percentile(values, 98))
    upper = max(upper, smallest + NARROWEST)
    counts, edges = np.histogram(
        np.clip(values, smallest, upper), bins=bins, range=(smallest, upper)
    )
    step, top = CHART_WIDTH / bins, CHART_HEIGHT - 40
    bars = "".join(
        f'<rect x="{i * step:.1f}" y="{top - top * n / counts.max():.1f}" width="{step - 1:.1f}" '
        f'height="{top * n / counts.max():.1f}"><title>{edges[i]:.3f} to {edges[i + 1]:.3f}: '
        f"{n}</title></rect>"
        for i, n in enumerate(counts)
        if n
    )
    middle = float(np.median(values))
    x = CHART_WIDTH * (np.clip(middle, smallest, upper) - smallest) / (upper - smallest)
    beyond = " and more" if short(values.max()) != short(upper) else ""
    axis = (
        f'<text x="0" y="{top + 16}">{short(smallest)}</text>'
        f'<text x="{CHART_WIDTH}" y="{top + 16}" '
        f'text-anchor="end">{short(upper)}{beyond}</text>'
        f'<line x1="{x:.1f}" x2="{x:.1f}" y1="0" y2="{top}" class="median"/>'
        f'<text x="{CHART_WIDTH / 2}" y="{top + 34}" text-anchor="middle">median {short(middle)}, '
        "mean "
        f"{short(values.mean())}</text>"
    )
    body = (
        f'<svg viewBox="0 -4 {CHART_WIDTH} {CHART_HEIGHT}" class="histogram" role="img" '
        f'aria-label="{escape(heading, quote=True)}">{bars}{axis}</svg>'
    )
    return f"<figure>{body}<figcaption>{escape(heading)}</figcaption></figure>"


def short(value: float) -> str:
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def building_pictures(
    solid: Solid, points: np.ndarray, distances: np.ndarray, part_types: Mapping[int, str]
) -> str:
    """Draw the model with its points from above at an angle, and from the side.

    Points (n, 3) are coloured by their distances (n,). The side view looks along the level
    direction of the largest roof face, so that slopes show as lines. Roofs have the colour of their
    part's type, by number in `part_types`.
    """
    if len(points) > MOST_PICTURE_POINTS:
        keep = np.linspace(0, len(points) - 1, MOST_PICTURE_POINTS).astype(int)
        points, distances = points[keep], distances[keep]
    across = slope_direction(solid)
    along = np.array([-across[1], across[0], 0.0])
    colours = [choose_look(face, part_types).colour for face in solid.faces]
    right = 0.8 * across + 0.6 * along
    vertical = 0.5 * (0.8 * along - 0.6 * across) + [0.0, 0.0, np.sqrt(0.75)]
    up = np.array([0.0, 0.0, 1.0])
    return projection(
        solid, colours, points, distances, right, vertical, "from above"
    ) + projection(solid, colours, points, distances, across, up, "from the side")


def slope_direction(solid: Solid) -> np.ndarray:
    """Return the level unit vector (3,) in which the largest slope falls, east if level."""
    normals = np.array(
        [ring_normal(solid.vertices[list(face.rings[0])]) for face in solid.select_faces(ROOF)]
    )
    if not len(normals):
        return np.array([1.0, 0.0, 0.0])
    level = normals * [1.0, 1.0, 0.0]
    strongest = level[np.argmax(np.linalg.norm(level, axis=1))]
    length = np.linalg.norm(strongest)
    return strongest / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])


def projection(
    solid: Solid,
    colours: list[str],
    points: np.ndarray,
    distances: np.ndarray,
    right: np.ndarray,
    vertical: np.ndarray,
    label: str,
) -> str:
    """Draw faces and points as an SVG, seen along one direction.

    Each face has its colour. `right` and `vertical` (3,) are the picture's axes. Screen readers
    read its `label`.
    """
    axes = np.column_stack([right, -vertical])
    corners, dots = solid.vertices @ axes, points @ axes
    everything = np.concatenate([corners, dots])
    smallest, largest = everything.min(axis=0), everything.max(axis=0)
    scale = min(
        (CHART_WIDTH - 16) / max(largest[0] - smallest[0], 1e-6),
        (CHART_HEIGHT - 16) / max(largest[1] - smallest[1], 1e-6),
    )

    def place(xy: np.ndarray) -> np.ndarray:
        return (xy - (smallest + largest) / 2) * scale + [CHART_WIDTH / 2, CHART_HEIGHT / 2]

    towards = np.cross(right, vertical)
    faces = sorted(
        (
            (face, colour)
            for face, colour in zip(solid.faces, colours, strict=True)
            if face.kind != GROUND
        ),
        key=lambda drawn: float((solid.vertices[list(drawn[0].rings[0])] @ towards).mean()),
    )
    shapes = "".join(
        f'<path d="{draw_rings(place(corners[list(r)]) for r in face.rings)}" fill="{colour}"/>'
        for face, colour in faces
    )
    bins, cloud = residual_bins(distances), ""
    for i, (_, stop) in enumerate(RESIDUAL_STOPS):
        path = "".join(f"M{x:.1f} {y:.1f}h0" for x, y in place(dots[bins == i]))
        cloud += f'<path d="{path}" stroke="{stop}"/>'
    return (
        f'<svg viewBox="0 0 {CHART_WIDTH} {CHART_HEIGHT}" class="model" role="img" '
        f'aria-label="{label}"><g '
        f'class="faces">{shapes}</g>'
        f'<g class="dots">{cloud}</g></svg>'
    )
