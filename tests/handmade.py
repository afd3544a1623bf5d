"""Solids made by hand, small enough to check with a pencil, and buildings around them."""

from __future__ import annotations

import numpy as np
import shapely

from hiproof.frames import LocalFrame
from hiproof.model import (
    GROUND,
    ROOF,
    WALL,
    Building,
    Face,
    Model,
    Part,
    Piece,
    Quality,
    Roof,
    Solid,
)
from hiproof.status import Grade, Status

RD_ORIGIN = np.array([85000.0, 446000.0, 0.0])


def prism(rings: list[list[tuple[float, float]]], z_bottom: float, z_top: float) -> Solid:
    """A flat block over plan `rings` (outer counter-clockwise, holes clockwise) between two
    heights.
    """
    plan = [xy for ring in rings for xy in ring]
    n = len(plan)
    vertices = np.array([(*xy, z_bottom) for xy in plan] + [(*xy, z_top) for xy in plan], float)
    numbers, start = [], 0
    for ring in rings:
        numbers.append(tuple(range(start, start + len(ring))))
        start += len(ring)
    faces = [
        Face(tuple(tuple(reversed(ring)) for ring in numbers), GROUND),
        Face(tuple(tuple(i + n for i in ring) for ring in numbers), ROOF, 0),
    ]
    for ring in numbers:
        for a, b in zip(ring, ring[1:] + ring[:1], strict=True):
            faces.append(Face(((a, b, b + n, a + n),), WALL))
    return Solid(vertices, tuple(faces))


def box(
    width: float = 4.0, length: float = 5.0, z_bottom: float = 0.0, z_top: float = 3.0
) -> Solid:
    return prism([[(0, 0), (width, 0), (width, length), (0, length)]], z_bottom, z_top)


def courtyard(side: float = 10.0, yard: float = 4.0, height: float = 5.0) -> Solid:
    """A square block around a square yard."""
    a, b = (side - yard) / 2, (side + yard) / 2
    outer = [(0, 0), (side, 0), (side, side), (0, side)]
    return prism([outer, [(a, a), (a, b), (b, b), (b, a)]], 0.0, height)


def gable_house(
    width: float = 8.0, length: float = 12.0, eave: float = 3.0, ridge: float = 7.0
) -> Solid:
    """Ridge along y at x = width / 2."""
    w, l, m = width, length, width / 2
    vertices = [
        (0, 0, 0),
        (w, 0, 0),
        (w, l, 0),
        (0, l, 0),
        (0, 0, eave),
        (w, 0, eave),
        (w, l, eave),
        (0, l, eave),
    ]
    vertices += [(m, 0, ridge), (m, l, ridge)]
    faces = (
        Face(((3, 2, 1, 0),), GROUND),
        Face(((4, 8, 9, 7),), ROOF, 0),
        Face(((5, 6, 9, 8),), ROOF, 0),
        Face(((0, 1, 5, 8, 4),), WALL),
        Face(((1, 2, 6, 5),), WALL),
        Face(((2, 3, 7, 9, 6),), WALL),
        Face(((3, 0, 4, 7),), WALL),
    )
    return Solid(np.array(vertices, float), faces)


def make_building(
    solid: Solid,
    id: str = "a",
    kinds: tuple[str, ...] = ("gable",),
    origin: np.ndarray = RD_ORIGIN,
    **changes,
) -> Building:
    """A building of `solid`, moved to `origin`, whose roof has a part of each of `kinds`."""
    outline = shapely.box(*solid.vertices[:, :2].min(axis=0), *solid.vertices[:, :2].max(axis=0))
    planes = np.array([[1.0, 0.0, 3.0], [-1.0, 0.0, 11.0]])
    parts = tuple(
        Part(
            kind,
            (Piece(outline, planes),),
            {"width": 8.0, "height": 4.0},
            0.25,
            np.array([0.1, -0.2, 3.0]),
        )
        for kind in kinds
    )
    values = {
        "quality": Quality(
            points=321, density=4.5, psd_mean=0.05, rmse=0.06, share_within_20cm=0.99
        ),
        "grade": Grade.GOOD,
        "z_ground": float(origin[2]),
        "ground_source": "ground class",
        "types": {kinds[0]: 0.97},
        "terrain_intersection": (
            np.array([[0, 0, 0], [1, 0, 0.1], [1, 1, 0], [0, 0, 0.0]]) + origin,
        ),
        "attributes": {"bouwjaar": 1930, "naam": "Café <&>"},
    }
    roof = Roof(parts, outline, LocalFrame(np.asarray(origin, float)))
    return Building(id, Status.MODELLED, "", Model(roof, solid.move(origin)), **(values | changes))


def make_lost_building(id: str = "lost", **changes) -> Building:
    """A building asked for that got no model."""
    return Building(id, Status.NO_POINTS, **({"attributes": {"bouwjaar": None}} | changes))
