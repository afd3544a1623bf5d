"""Finished models read back from CityJSON: what evaluation, the report and the conversions start from."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..frames import METRES, Units
from ..model import ROOF, WALL, Face, Solid
from ..write.naming import units_named

RUN_MODELS = "buildings.city.jsonl"


@dataclass(frozen=True)
class BuildingModel:
    """One building of a file: its `attributes`, and its `solid` in world metres (None where the file has none)."""

    id: str
    attributes: dict[str, Any] = field(default_factory=dict)
    solid: Solid | None = None

    @property
    def roof_type(self) -> str:
        """hiproof's roof type where the model says one, else "unknown"."""
        return self.attributes.get("hiproof_roof_type") or "unknown"

    @property
    def status(self) -> str:
        """Code of what became of the building; of a foreign file, whether it has a solid."""
        return self.attributes.get("hiproof_status") or ("modelled" if self.solid is not None else "no_model")


def run_models(folder: Path) -> Path:
    """Path of the models in the output folder of a run. Raises InputError where there are none."""
    path = Path(folder) / RUN_MODELS
    if not path.is_file():
        raise InputError(f"expected the output folder of `hiproof reconstruct`, got {folder} without {RUN_MODELS}")
    return path


def read_models(path: str | Path, otherwise: Units = METRES) -> Iterator[BuildingModel]:
    """Yield the buildings of a CityJSON or CityJSONSeq file in its order, the solids of their parts joined, in metres.

    Of several solids of one object that with the highest level of detail counts. `otherwise` are the units of a file
    that names no CRS. Raises InputError for files that cannot be read as CityJSON, or that are in degrees.
    """
    path = Path(path)
    try:
        transform, units = {"scale": [1, 1, 1], "translate": [0, 0, 0]}, otherwise
        for document in _documents(path):
            transform = document.get("transform", transform)
            if name := document.get("metadata", {}).get("referenceSystem"):
                units = units_named(name, otherwise)
            yield from _buildings(document, transform, units)
    except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"expected a CityJSON file at {path}, got: {error}; check the path") from error
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f"expected CityJSON in {path}, got a document without its members ({error!r})") from error


def _documents(path: Path) -> Iterator[dict[str, Any]]:
    if path.suffix != ".jsonl":
        yield json.loads(path.read_text(encoding="utf-8"))
        return
    with path.open(encoding="utf-8") as file:
        yield from (json.loads(line) for line in file if line.strip())


def _buildings(document: dict[str, Any], transform: dict[str, Any], units: Units) -> Iterator[BuildingModel]:
    vertices = np.asarray(document["vertices"], float).reshape(-1, 3) * transform["scale"] + transform["translate"]
    vertices = units.to_metres(vertices)
    objects = document["CityObjects"]
    for id, city_object in objects.items():
        if city_object["type"] != "Building":
            continue
        family = [city_object, *(objects[child] for child in city_object.get("children", ()) if child in objects)]
        faces = tuple(face for member in family for face in _faces(member))
        yield BuildingModel(id, city_object.get("attributes", {}), _compact(vertices, faces) if faces else None)


def _faces(city_object: dict[str, Any]) -> Iterator[Face]:
    solids = [geometry for geometry in city_object.get("geometry", ()) if geometry["type"] == "Solid"]
    if not solids:
        return
    solid = max(solids, key=lambda geometry: float(geometry["lod"]))
    semantics = solid.get("semantics") or {"surfaces": [], "values": None}
    kinds = semantics["values"][0] if semantics["values"] else [None] * len(solid["boundaries"][0])
    for rings, kind in zip(solid["boundaries"][0], kinds, strict=True):
        name = WALL if kind is None else semantics["surfaces"][kind]["type"]
        yield Face(tuple(tuple(ring) for ring in rings), name, 0 if name == ROOF else -1)


def _compact(vertices: np.ndarray, faces: tuple[Face, ...]) -> Solid:
    """A solid with only the vertices its faces use."""
    used = sorted({index for face in faces for ring in face.rings for index in ring})
    place = {index: i for i, index in enumerate(used)}
    renumbered = (
        Face(tuple(tuple(place[i] for i in ring) for ring in face.rings), face.kind, face.part) for face in faces
    )
    return Solid(vertices[used], tuple(renumbered))
