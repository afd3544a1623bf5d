"""CityJSON and CityJSONSeq files document by document, with their vertices in place, or a sentence that says why not."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..frames import METRES, Units
from .crs import units_named

UNUSABLE = (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError)
"""What comes of taking a document apart that is JSON, but not what CityJSON says it is."""


class Feature(NamedTuple):
    """A CityJSON document or a line of CityJSONSeq: its city `objects` by id, their vertices (n, 3) in world metres, its place in
    the file, and what its coordinates count in."""

    objects: dict[str, Any]
    vertices: np.ndarray
    place: str
    units: Units


def features(path: Path, otherwise: Units = METRES, known: Units | None = None) -> Iterator[Feature]:
    """Every document of a file, each by the transform and the CRS of the line before it that has them.

    `otherwise` are the units where no CRS is named, `known` those of one of which more is known than a name tells, if there is one. Raises
    InputError as `documents` does, and for vertices that are none.
    """
    transform, units = None, known or otherwise
    for document, place in documents(path):
        transform = document.get("transform", transform)
        if name := reference_system(document):
            units = known or units_named(name, otherwise)
        try:
            vertices = np.array(document["vertices"], float).reshape(-1, 3)
            with np.errstate(invalid="ignore", over="ignore"):  # numbers beyond all bounds are the business of who asks
                if transform:
                    vertices = vertices * np.array(transform["scale"], float) + np.array(transform["translate"], float)
                vertices = units.to_metres(vertices)
            objects = document["CityObjects"]
            objects.items()
        except UNUSABLE as error:
            raise InputError(
                f"expected CityJSON with vertices, a transform and boundaries in {place}, got {error!r}; "
                "validate the file first"
            ) from error
        yield Feature(objects, vertices, place, units)


def documents(path: Path) -> Iterator[tuple[dict[str, Any], str]]:
    """(document, its place in the file): of CityJSON the one, of CityJSONSeq (`.jsonl`) each line, the header first.

    Raises InputError for what is no text, no JSON, no object, or of another type.
    """
    if path.suffix.lower() != ".jsonl":
        document = parsed(read_text(path), str(path))
        if document.get("type") != "CityJSON":
            raise InputError(
                f'expected "type": "CityJSON" in {path}, got {document.get("type")!r}; is this another kind of JSON?'
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
                document = parsed(line, place)
                kind = document.get("type")
                if kind != "CityJSON" and not (seen_header and kind == "CityJSONFeature"):
                    raise InputError(
                        f"expected a CityJSON line followed by CityJSONFeatures, got one of type {kind!r} in {place}; is this another "
                        "kind of JSON?"
                    )
                seen_header = True
                yield document, place
    except (OSError, UnicodeDecodeError) as error:
        raise unreadable(path, error) from error
    if not seen_header:
        raise InputError(f"expected a CityJSON line at the start of {path}, got an empty file; write it anew")


def parsed(text: str, place: str) -> dict[str, Any]:
    """A JSON object. Raises InputError naming the place."""
    try:
        value = json.loads(text, parse_constant=refuse_constant)
    except (ValueError, RecursionError) as error:  # a ValueError too for numbers of thousands of digits
        if text.lstrip("\ufeff \t\r\n").startswith("<"):
            raise InputError(f"expected JSON in {place}, got XML, such as CityGML; name a CityJSON file") from error
        raise InputError(f"expected JSON in {place}, got: {error}; the file is damaged or cut off") from error
    if not isinstance(value, dict):
        raise InputError(f"expected a JSON object in {place}, got {type(value).__name__}; is this the right file?")
    return value


def refuse_constant(name: str) -> None:
    """NaN and Infinity, which Python reads but JSON does not know."""
    raise ValueError(f"{name}, which is no number")


def read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise unreadable(path, error) from error


def unreadable(path: Path, error: Exception) -> InputError:
    """What to say of a file that is not there, or whose bytes are no text."""
    found = "none" if isinstance(error, FileNotFoundError) else f"one that is not: {error}"
    return InputError(f"expected a readable text file at {path}, got {found}; check the path")


def reference_system(document: dict[str, Any]) -> str | None:
    """The CRS that a document's metadata name."""
    metadata = document.get("metadata")
    name = metadata.get("referenceSystem") if isinstance(metadata, dict) else None
    return name if isinstance(name, str) and name else None
