"""Shells of CityJSON geometries, every number in them checked before it is used.

What is wrong is raised as a ValueError whose text completes "got ...": the caller knows the
building and the file.
"""

from __future__ import annotations

from itertools import chain, repeat
from typing import Any, NamedTuple

import numpy as np

from ...model import GROUND, ROOF, WALL
from .damage import excerpt

Rings = tuple[tuple[int, ...], ...]

KINDS = {
    **{kind: kind for kind in (ROOF, WALL, GROUND)},
    "OuterFloorSurface": ROOF,
    "OuterCeilingSurface": GROUND,
    "ClosureSurface": WALL,
    "Window": WALL,
    "Door": WALL,
}
"""What CityJSON's surfaces of a building's shell are, of the three that a model of ours has."""


class ShellSurface(NamedTuple):
    """A face of a shell: its rings of vertex numbers, and its semantics."""

    rings: Rings
    kind: str
    semantics: dict[str, Any]


def read_shell(shell: Any, values: Any, surfaces: Any, count: int) -> list[ShellSurface]:
    """Read the faces of one shell over `count` vertices.

    `values` are the numbers of the faces' semantics among `surfaces`, None where a file has none; a
    face beyond their end has none either.
    """
    faces = [
        tuple(tuple(read_ring(ring, count)) for ring in require_list(face, "a face"))
        for face in require_list(shell, "a shell")
    ]
    numbers = require_list([] if values is None else values, "semantic values")
    surface_semantics = require_list(surfaces, "semantic surfaces")
    semantics_list = (
        {} if number is None else surface_at(number, surface_semantics)
        for number in chain(numbers, repeat(None))
    )
    return [
        ShellSurface(rings, KINDS[semantics.get("type", WALL)], semantics)
        for rings, semantics in zip(faces, semantics_list)  # noqa: B905
    ]


def read_ring(ring: Any, count: int) -> list[int]:
    """Read a ring of vertex numbers below `count`."""
    for number in require_list(ring, "a ring"):
        if type(number) is not int:
            raise ValueError(f"the vertex {excerpt(number)}, which is no number of one")
        if not 0 <= number < count:
            raise ValueError(f"vertex {excerpt(number)} of {count}")
    return ring


def surface_at(number: Any, surfaces: list[Any]) -> dict[str, Any]:
    """Look up the semantics of a face."""
    if type(number) is not int or not 0 <= number < len(surfaces):
        raise ValueError(f"semantic surface {excerpt(number)} of {len(surfaces)}")
    semantics = surfaces[number]
    if not isinstance(semantics, dict) or str(semantics.get("type", WALL)) not in KINDS:
        raise ValueError(f"{excerpt(semantics)} as a semantic surface")
    return semantics


def require_list(value: Any, subject: str) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError(f"{excerpt(value)} as {subject}")
    return value


def read_geometries(city_object: Any) -> list[dict[str, Any]]:
    """Read the geometries of a city object, each an object of its own."""
    if not isinstance(city_object, dict):
        raise ValueError(f"{excerpt(city_object)} as a city object")
    result = require_list(city_object.get("geometry") or [], "its geometries")
    for geometry in result:
        if not isinstance(geometry, dict):
            raise ValueError(f"{excerpt(geometry)} as a geometry")
        if not isinstance(geometry.get("semantics") or {}, dict):
            raise ValueError(f"{excerpt(geometry['semantics'])} as semantics")
    return result


def read_vertices(vertices: Any) -> np.ndarray:
    """Read the vertices (n, 3) of a document, in the numbers of the file."""
    result = np.array(require_list(vertices, "vertices"), float)
    if result.size and (result.ndim != 2 or result.shape[1] != 3):
        raise ValueError(f"vertices of {excerpt(vertices[0])}, where each is three numbers")
    return result.reshape(-1, 3)
