"""The view of a solid: faces turned, projected and ordered from far to near."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..geometry.rings import ring_normal
from ..model import ROOF, Building, Face, Solid
from ..write.meshes.viewed import choose_look

# degrees; from the front left and above, so that two walls and the roof show
TURN_DEG, TILT_DEG = -35.0, 35.0


@dataclass(frozen=True)
class SeenFace:
    """A face on the page (y downwards): rings (m, 2), colour, and lightness of 0 to 1."""

    rings: tuple[np.ndarray, ...]
    colour: str
    light: float
    is_roof: bool


def project_points(xyz: np.ndarray, turn_deg: float, tilt_deg: float) -> np.ndarray:
    """Return page coordinates and nearness (n, 3), seen from `tilt_deg`, after `turn_deg`."""
    a, t = math.radians(turn_deg), math.radians(tilt_deg)
    x = xyz[:, 0] * math.cos(a) - xyz[:, 1] * math.sin(a)
    y = xyz[:, 0] * math.sin(a) + xyz[:, 1] * math.cos(a)
    return np.column_stack(
        [x, -(y * math.sin(t) + xyz[:, 2] * math.cos(t)), xyz[:, 2] * math.sin(t) - y * math.cos(t)]
    )


def bound_sphere(solid: Solid) -> tuple[np.ndarray, float]:
    """Return the middle (3,) of a solid and the distance (m) of its farthest corner."""
    smallest, largest = solid.vertices.min(axis=0), solid.vertices.max(axis=0)
    middle = (smallest + largest) / 2
    return middle, float(np.linalg.norm(solid.vertices - middle, axis=1).max())


def choose_turn(building: Building) -> float:
    """Return the degrees that turn a building, however it lies, to be seen from a corner."""
    return TURN_DEG - math.degrees(building.parts[building.model.main].kappa)


def list_colours(building: Building) -> list[str]:
    """Return one colour a face: that of its part's type for roofs."""
    types = {number: part.type for number, part in enumerate(building.parts)}
    return [choose_look(face, types).colour for face in building.solid.faces]


def select_seen_faces(
    solid: Solid, colours: list[str], turn_deg: float = TURN_DEG, tilt_deg: float = TILT_DEG
) -> list[SeenFace]:
    """Return the faces that look towards the eye, the farthest first."""
    page = project_points(solid.vertices - bound_sphere(solid)[0], turn_deg, tilt_deg)
    visited = []
    for face, colour in zip(solid.faces, colours, strict=True):
        outer = page[list(face.rings[0])]
        ahead = np.roll(outer, -1, axis=0)
        area = float((outer[:, 0] * ahead[:, 1] - ahead[:, 0] * outer[:, 1]).sum())
        if area < -1e-9:  # y points down, so what is counter-clockwise in space turns the other way
            rings = tuple(page[list(ring), :2] for ring in face.rings)
            visited.append(
                (
                    float(outer[:, 2].mean()),
                    SeenFace(rings, colour, lightness(solid, face), face.kind == ROOF),
                )
            )
    return [face for _, face in sorted(visited, key=lambda pair: pair[0])]


def lightness(solid: Solid, face: Face) -> float:
    """Return how light a face is under a lamp high in the south-west."""
    normal = ring_normal(solid.vertices[list(face.rings[0])])
    normal /= max(float(np.linalg.norm(normal)), 1e-12)
    return float(0.72 + 0.28 * normal @ np.array([-0.4, -0.5, 0.77]))


def shade_colour(colour: str, light: float) -> str:
    """Darken a colour (#rrggbb).

    >>> shade_colour("#ff8000", 0.5)
    '#804000'
    """
    return "#" + "".join(
        f"{round(int(colour[k : k + 2], 16) * max(min(light, 1.0), 0.0)):02x}" for k in (1, 3, 5)
    )
