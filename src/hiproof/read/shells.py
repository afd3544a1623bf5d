"""Shells of CityJSON geometries, every number in them checked before it is used.

What is wrong is raised as a ValueError whose text completes "got ...": the caller knows the
building and the file.
"""

from __future__ import annotations

from itertools import chain, repeat
from typing import Any, NamedTuple

import numpy as np

from ..model import WALL
from .damage import excerpt

Rings = tuple[tuple[int, ...], ...]


class Surface(NamedTuple):
    """A face of a shell: its rings of vertex numbers, and what its semantics say of it."""

    rings: Rings
    kind: str
    semantics: dict[str, Any]


def read_shell(shell: Any, values: Any, surfaces: Any, count: int) -> list[Surface]:
    """Read the faces of one shell over `count` vertices.

    `values` are the numbers of the faces' semantics among `surfaces`, None where a file has none; a
    face beyond their end has none either.
    """
    faces = [read_rings(face, count) for face in list_of(shell, "a shell")]
    numbers = list_of([] if values is None else values, "semantic values")
    known = list_of(surfaces, "semantic surfaces")
    told = (
        {} if number is None else surface_at(number, known)
        for number in chain(numbers, repeat(None))
    )
    return [
        Surface(rings, semantics.get("type", WALL), semantics)
        for rings, semantics in zip(faces, told)  # noqa: B905
    ]


def read_rings(face: Any, count: int) -> Rings:
    return tuple(tuple(read_ring(ring, count)) for ring in list_of(face, "a face"))


def read_ring(ring: Any, count: int) -> list[int]:
    """Read a ring of vertex numbers below `count`."""
    for number in list_of(ring, "a ring"):
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
    if not isinstance(semantics, dict) or not isinstance(semantics.get("type", WALL), str):
        raise ValueError(f"{excerpt(semantics)} as a semantic surface")
    return semantics


def list_of(value: Any, what: str) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError(f"{excerpt(value)} as {what}")
    return value


def read_geometries(city_object: Any) -> list[dict[str, Any]]:
    """Read the geometries of a city object, each an object of its own."""
    if not isinstance(city_object, dict):
        raise ValueError(f"{excerpt(city_object)} as a city object")
    found = list_of(city_object.get("geometry") or [], "its geometries")
    for geometry in found:
        if not isinstance(geometry, dict):
            raise ValueError(f"{excerpt(geometry)} as a geometry")
        if not isinstance(geometry.get("semantics") or {}, dict):
            raise ValueError(f"{excerpt(geometry['semantics'])} as semantics")
    return found


def read_vertices(vertices: Any) -> np.ndarray:
    """Read the vertices (n, 3) of a document, in the numbers of the file."""
    found = np.array(list_of(vertices, "vertices"), float)
    if found.size and (found.ndim != 2 or found.shape[1] != 3):
        raise ValueError(f"vertices of {excerpt(vertices[0])}, where each is three numbers")
    return found.reshape(-1, 3)
