"""CityJSON and CityJSONSeq files, document by document, or an InputError that says why not.

Every number of a shell is checked before it is used. What is wrong there is a ValueError whose text
completes "got ...": the caller knows the building and the file.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from itertools import chain, repeat
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...frames import METRES, Units
from ...model import GROUND, ROOF, WALL
from ..crs import find_named_units, refuse_other_crs
from ..plausible import is_plausible
from .damage import Damaged, excerpt, explain_unreadable, readable, refuse

Rings = tuple[tuple[int, ...], ...]

# What CityJSON's surfaces of a building's shell are, of the three that a model of ours has.
KINDS = {
    **{kind: kind for kind in (ROOF, WALL, GROUND)},
    "OuterFloorSurface": ROOF,
    "OuterCeilingSurface": GROUND,
    "ClosureSurface": WALL,
    "Window": WALL,
    "Door": WALL,
}


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
    require_list(surfaces, "semantic surfaces")
    result = []
    for rings, number in zip(faces, chain(numbers, repeat(None)), strict=False):
        semantics = {} if number is None else surface_at(number, surfaces)
        result.append(ShellSurface(rings, KINDS[semantics.get("type", WALL)], semantics))
    return result


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


def require(value: Any, kind: type, subject: str) -> Any:
    if not isinstance(value, kind):
        raise ValueError(f"{excerpt(value)} as {subject}")
    return value


def require_list(value: Any, subject: str) -> list[Any]:
    return require(value, list, subject)


def read_geometries(city_object: Any) -> list[dict[str, Any]]:
    """Read the geometries of a city object, each an object of its own."""
    require(city_object, dict, "a city object")
    result = require_list(city_object.get("geometry") or [], "its geometries")
    for geometry in result:
        require(geometry, dict, "a geometry")
        require(geometry.get("semantics") or {}, dict, "semantics")
    return result


def read_vertices(vertices: Any) -> np.ndarray:
    """Read the vertices (n, 3) of a document, in the numbers of the file."""
    result = np.array(require_list(vertices, "vertices"), float)
    if result.size and (result.ndim != 2 or result.shape[1] != 3):
        raise ValueError(f"vertices of {excerpt(vertices[0])}, where each is three numbers")
    return result.reshape(-1, 3)


# What comes of taking a document apart that is JSON, but not what CityJSON says it is.
UNUSABLE = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError)

ESCAPED = re.compile(
    r"\\u(?:[dD][89a-fA-F]|0000)"
)  # in JSON: half a character, of which two may make a whole one, or NUL


class Feature(NamedTuple):
    """A CityJSON document or a line of CityJSONSeq: its city `objects` by id and its vertices.

    Vertices (n, 3) are in world metres, and `units` those of the file's coordinates. A feature that
    `is_damaged` cannot be read and has no objects.
    """

    objects: dict[str, Any]
    vertices: np.ndarray
    place: str
    units: Units
    is_damaged: bool = False


def features(
    path: Path,
    alternative: Units = METRES,
    crs_units: Units | None = None,
    damaged: Damaged = refuse,
) -> Iterator[Feature]:
    """Yield every document of a file, placed by its transform and CRS.

    A line without these has those of the line before. `alternative` are the units where no CRS is
    named, `crs_units` those of one of which more is known than a name tells, if there is one. A
    feature that cannot be read is told to `damaged` and comes without objects. Raises InputError as
    `documents` does.
    """
    transform, units, first_name = None, crs_units or alternative, None
    for number, (document, place) in enumerate(documents(path, damaged)):
        nothing = Feature({}, np.empty((0, 3)), place, units, True)
        if not document:
            yield nothing
            continue
        name = reference_system(document)
        if number:
            refuse_other_crs(first_name, name, place)
        else:
            first_name, units = name, crs_units or find_named_units(name, alternative)
        try:
            transform = read_transform(document) or transform
            objects = require(document.get("CityObjects"), dict, "its CityObjects")
            yield Feature(objects, world_vertices(document, transform, units), place, units)
        except UNUSABLE as error:
            damage = InputError(
                f"expected CityJSON that can be read in {place}, got {explain_error(error)}; mend "
                "it there"
            )
            (refuse if document["type"] == "CityJSON" else damaged)(damage)
            yield nothing


def read_transform(document: dict[str, Any]) -> tuple[np.ndarray, np.ndarray] | None:
    """Read a document's scale (3,) and translation (3,), None if it has none."""
    transform = document.get("transform")
    if transform is None:
        return None
    require(transform, dict, "its transform")
    scale, translate = (read_vertices([transform.get(name)])[0] for name in ("scale", "translate"))
    if not (np.isfinite(scale).all() and is_plausible(translate[None]).all()):
        raise ValueError(f"a transform to no place on Earth ({excerpt(transform)})")
    return scale, translate


def world_vertices(
    document: dict[str, Any], transform: tuple[np.ndarray, np.ndarray] | None, units: Units
) -> np.ndarray:
    """Read the vertices (n, 3) of a document in world metres."""
    vertices = read_vertices(document.get("vertices"))
    # Numbers beyond all bounds are the business of who asks.
    with np.errstate(invalid="ignore", over="ignore"):
        if transform:
            vertices = vertices * transform[0] + transform[1]
        return units.to_metres(vertices)


def unusable(id: str, feature: Feature, error: Exception) -> InputError:
    """Say in a sentence why the city object `id` of a feature cannot be used."""
    place = feature.place
    if f"building {id:.80} in " not in place:
        place = f"{id:.80} in {place}"
    return InputError(
        f"expected {place} to be one that can be used, got {explain_error(error)}; mend it there, "
        "or make the file anew with `hiproof build`"
    )


def explain_error(error: Exception) -> str:
    """Say what was found in a document, to complete "got ..."."""
    return str(error) if type(error) is ValueError else repr(error)


def documents(path: Path, damaged: Damaged = refuse) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield each document of a file with its place in the file.

    CityJSON has one document. CityJSONSeq (`.jsonl`) has one a line, the header first. A line after
    the header that cannot be read is told to `damaged` and comes as an empty document. Raises
    InputError for what is no text, no JSON, no object, or of another type.
    """
    if path.suffix.lower() != ".jsonl":
        document = parse_object(read_text(path), str(path))
        if document.get("type") != "CityJSON":
            raise InputError(
                f'expected "type": "CityJSON" in {path}, got {document.get("type")!r}; is this '
                "another kind of JSON?"
            )
        yield document, str(path)
        return
    seen_header = False
    try:
        with path.open(encoding="utf-8") as lines:
            for number, line in enumerate(lines, 1):
                if not line.strip():
                    continue
                place = f"line {number} of {path}"
                try:
                    document = parsed_line(line, place, seen_header)
                except InputError as error:
                    (damaged if seen_header else refuse)(error)
                    document = {}
                seen_header = True
                id = document.get("id")
                yield (
                    document,
                    f"building {id:.80} in {place}" if isinstance(id, str) and id else place,
                )
    except (OSError, UnicodeDecodeError) as error:
        raise explain_unreadable(path, "a readable text file", error) from error
    if not seen_header:
        raise InputError(
            f"expected a CityJSON line at the start of {path}, got an empty file; write it anew"
        )


def parsed_line(line: str, place: str, seen_header: bool) -> dict[str, Any]:
    """Read a line of CityJSONSeq; InputError for anything but a header and then features."""
    document = parse_object(line, place)
    kind = document.get("type")
    if kind != "CityJSON" and not (seen_header and kind == "CityJSONFeature"):
        raise InputError(
            "expected a CityJSON line followed by CityJSONFeatures, got one of type "
            f"{excerpt(kind)} in {place}; is this another kind of JSON?"
        )
    return document


def parse_object(text: str, place: str) -> dict[str, Any]:
    """Parse a JSON object. Raises InputError naming the place."""
    try:
        # Editors may begin a file with a mark of the encoding, and files are joined.
        value = json.loads(text.lstrip("\ufeff"), parse_constant=refuse_constant)
    # A ValueError too for numbers of thousands of digits.
    except (ValueError, RecursionError) as error:
        if text.lstrip("\ufeff \t\r\n").startswith("<"):
            raise InputError(
                f"expected JSON in {place}, got XML, such as CityGML; name a CityJSON file"
            ) from error
        raise InputError(
            f"expected JSON in {place}, got: {error}; the file is damaged or cut off"
        ) from error
    if not isinstance(value, dict):
        raise InputError(
            f"expected a JSON object in {place}, got {type(value).__name__}; is this the right "
            "file?"
        )
    return readable(value) if ESCAPED.search(text) else value


def refuse_constant(name: str) -> None:
    """Refuse NaN and Infinity, which Python reads but JSON does not know."""
    raise ValueError(f"{name}, which is no number")


def read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise explain_unreadable(path, "a readable text file", error) from error


def reference_system(document: dict[str, Any]) -> str | None:
    """Return the CRS that a document's metadata name."""
    metadata = document.get("metadata")
    name = metadata.get("referenceSystem") if isinstance(metadata, dict) else None
    return (name or None) if isinstance(name, str) else None
