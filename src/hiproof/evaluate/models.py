"""Finished models read back from CityJSON: what evaluation, the report and the conversions start from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..formats import FORMATS, TILE_FOLDER
from ..frames import METRES, Units
from ..model import GROUND, ROOF, WALL, Face, Solid
from ..read.cityjson import UNUSABLE, features
from ..read.plausible import is_plausible
from ..write.attribute_list import OWN

RUN_MODELS = FORMATS["cityjson"].file
PART, PART_TYPE = f"{OWN}part", f"{OWN}part_type"
"""What hiproof tells of a roof surface: its part's number and type."""


@dataclass(frozen=True)
class BuildingModel:
    """One building of a file: its `attributes`, its `solid` in world metres (None where the file has none), and the roof types of its
    parts by number (`Face.part`)."""

    id: str
    attributes: dict[str, Any] = field(default_factory=dict)
    solid: Solid | None = None
    part_types: dict[int, str] = field(default_factory=dict)

    @property
    def roof_type(self) -> str:
        """hiproof's roof type where the model says one, else "unknown"."""
        return self.text("hiproof_roof_type") or "unknown"

    @property
    def status(self) -> str:
        """Code of what became of the building; of a foreign file, whether it has a solid."""
        return self.text("hiproof_status") or ("modelled" if self.solid is not None else "no_model")

    def text(self, name: str) -> str:
        """An attribute that is text, else ""."""
        value = self.attributes.get(name)
        return value if isinstance(value, str) else ""


def run_models(folder: Path) -> Path:
    """Path of the models in the output folder of a run. Raises InputError where there are none."""
    path, tiles = Path(folder) / RUN_MODELS, Path(folder) / TILE_FOLDER
    if not path.is_file() and any(tiles.glob(f"*{FORMATS['cityjson'].tile_ending}")):
        raise InputError(
            f"expected models of the whole area in {folder}, got those of work tiles alone, in {tiles}; "
            f"`hiproof build {Path(folder) / FORMATS['parameters'].file} --out OTHER` makes them"
        )
    if not path.is_file():
        raise InputError(
            f"expected the output folder of `hiproof reconstruct`, got {folder} without {RUN_MODELS}; "
            "give what --out named"
        )
    return path


def read_models(path: str | Path, otherwise: Units = METRES, known: Units | None = None) -> Iterator[BuildingModel]:
    """Yield the buildings of a CityJSON or CityJSONSeq file in its order, the solids of their parts joined, in metres.

    Solids of the highest level of detail count, and building parts that hiproof cut come as the whole that they were. `otherwise` are the units of a file
    that names no CRS, `known` those of one of which more is known than it names. Raises InputError for files that cannot be read as CityJSON, or that are in degrees.
    """
    for feature in features(Path(path), otherwise, known):
        try:
            yield from buildings_of(feature.objects, feature.vertices)
        except UNUSABLE as error:
            raise InputError(
                f"expected CityJSON whose solids can be used in {feature.place}, got {error!r}; `hiproof check` may tell more"
            ) from error


def buildings_of(objects: dict[str, Any], vertices: np.ndarray) -> Iterator[BuildingModel]:
    for id, city_object in objects.items():
        if city_object["type"] != "Building":
            continue
        family = [city_object, *(objects[child] for child in city_object.get("children", ()) if child in objects)]
        level = max((level_of_detail(solid) for member in family for solid in solids_of(member)), default=0.0)
        faces = tuple(face for member in family for face in faces_of(member, level))
        attributes = city_object.get("attributes") or {}
        if not isinstance(attributes, dict):
            raise TypeError(f"attributes of {id!r} that are no object")
        solid = compact(vertices, faces) if faces else None
        model = BuildingModel(id, attributes, joined(solid, family) if solid is not None else None)
        yield replace(model, part_types={0: model.roof_type} | part_types_of(family))


def joined(solid: Solid, family: list[dict[str, Any]]) -> Solid:
    """`solid` as one shell where it is several, those of building parts that hiproof cut: without the walls between them."""
    own = [member for member in family if f"{OWN}primitives" in (member.get("attributes") or {})]
    if not own or len(solid.of_kind(GROUND)) < 2:
        return solid
    from ..compose.building_parts import whole_of

    return whole_of(solid)


def solids_of(city_object: dict[str, Any]) -> list[dict[str, Any]]:
    return [geometry for geometry in city_object.get("geometry") or () if geometry["type"] == "Solid"]


def faces_of(city_object: dict[str, Any], level: float) -> Iterator[Face]:
    solid = next((solid for solid in solids_of(city_object) if level_of_detail(solid) == level), None)
    if solid is None:
        return
    semantics = solid.get("semantics") or {"surfaces": [], "values": None}
    kinds = semantics["values"][0] if semantics["values"] else [None] * len(solid["boundaries"][0])
    for rings, kind in zip(solid["boundaries"][0], kinds, strict=True):
        surface = {"type": WALL} if kind is None else semantics["surfaces"][kind]
        part = part_of(surface) if surface["type"] == ROOF else -1
        yield Face(tuple(tuple(ring) for ring in rings), surface["type"], part)


def part_of(surface: dict[str, Any]) -> int:
    """The number of the part that a roof surface belongs to, 0 where the file does not tell."""
    return int(np.int32(surface.get(PART, 0)))  # NumPy's own, for it refuses what is beyond all bounds


def part_types_of(family: list[dict[str, Any]]) -> dict[int, str]:
    """The roof type of each part that a roof surface belongs to, as far as the file tells."""
    solids = (solid for member in family for solid in solids_of(member))
    surfaces = (surface for solid in solids for surface in (solid.get("semantics") or {}).get("surfaces", ()))
    return {part_of(surface): str(surface[PART_TYPE]) for surface in surfaces if PART_TYPE in surface}


def level_of_detail(geometry: dict[str, Any]) -> float:
    try:
        return float(geometry["lod"])
    except (KeyError, TypeError, ValueError):
        return 0.0


def compact(vertices: np.ndarray, faces: tuple[Face, ...]) -> Solid:
    """A solid with only the vertices its faces use, each of which must be a place; ValueError or IndexError otherwise."""
    rings = [ring for face in faces for ring in (face.rings or ((),))]
    least = min(len(set(ring)) for ring in rings)
    if least < 3:
        raise ValueError(f"a ring of {least} points")
    used = sorted({index for ring in rings for index in ring})
    if used[0] < 0 or used[-1] >= len(vertices):
        raise IndexError(f"vertex {used[0] if used[0] < 0 else used[-1]} of {len(vertices)}")
    if not is_plausible(vertices[used]).all():
        raise ValueError("coordinates of no place on Earth")
    place = {index: i for i, index in enumerate(used)}
    renumbered = (
        Face(tuple(tuple(place[i] for i in ring) for ring in face.rings), face.kind, face.part) for face in faces
    )
    return Solid(vertices[used], tuple(renumbered))
