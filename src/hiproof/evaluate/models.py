"""Finished models, read back from CityJSON for evaluation, the report and conversions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..compose.building_parts import join_parts
from ..compose.check import check_solid
from ..errors import InputError
from ..formats import FORMATS, TILE_FOLDER
from ..frames import METRES, Units
from ..model import GROUND, ROOF, Face, Solid
from ..read.models.cityjson import (
    UNUSABLE,
    Feature,
    ShellSurface,
    features,
    read_geometries,
    read_shell,
    require_list,
    unusable,
)
from ..read.models.damage import Damaged, excerpt, finite, refuse
from ..read.plausible import is_plausible
from ..write.attribute_list import OWN
from ..write.meshes.triangles import faces_triangles

RUN_MODELS = FORMATS["cityjsonseq"].file
# What hiproof tells of a roof surface: its part's number and type.
PART_ATTRIBUTE, PART_TYPE = f"{OWN}part", f"{OWN}part_type"

SUN_ATTRIBUTE = f"{OWN}sun_kwh_m2"  # of a surface that `hiproof enrich --sun` describes
# Of a building, so that their numbers fit the columns and tables of all formats.
MOST_PART_NUMBER = 2**31


@dataclass(frozen=True)
class BuildingModel:
    """One building of a file.

    It has `attributes`, its `solid` in world metres (None where the file has none), and the roof
    types of its parts by number (`Face.part`). `is_damaged` where the file's text of it cannot be
    read. `suns` are the irradiations (kWh/m2 in a year) of the solid's faces, NaN where unknown;
    none in a file without the sun.
    """

    id: str
    attributes: dict[str, Any] = field(default_factory=dict)
    solid: Solid | None = None
    part_types: dict[int, str] = field(default_factory=dict)
    is_damaged: bool = False
    suns: tuple[float, ...] = ()

    @property
    def roof_type(self) -> str:
        """hiproof's roof type where the model says one, else "unknown"."""
        return self.text("hiproof_roof_type") or "unknown"

    @property
    def status(self) -> str:
        """Code of what became of the building; of a foreign file, whether it has a solid."""
        if self.is_damaged:
            return "damaged"
        return self.text("hiproof_status") or ("modelled" if self.solid is not None else "no_model")

    @property
    def grade(self) -> str:
        """Code of the verdict on the model, empty where there is none."""
        return self.text(f"{OWN}quality")

    def text(self, name: str) -> str:
        """Return an attribute that is text, else ""."""
        value = self.attributes.get(name)
        return value if isinstance(value, str) else ""


def run_models(folder: Path) -> Path:
    """Return the path of the models in a run's folder; raises InputError without any."""
    path, tiles = Path(folder) / RUN_MODELS, Path(folder) / TILE_FOLDER
    if not path.is_file() and any(tiles.glob(f"*{FORMATS['cityjson'].tile_ending}")):
        raise InputError(
            f"expected models of the whole area in {folder}, got those of work tiles alone, in "
            f"{tiles}; "
            f"`hiproof build {Path(folder) / FORMATS['parameters'].file} --out OTHER` makes them"
        )
    if not path.is_file():
        raise InputError(
            f"expected the output folder of `hiproof reconstruct`, got {folder} without "
            f"{RUN_MODELS}; give what --out named"
        )
    return path


def read_models(
    path: str | Path,
    alternative: Units = METRES,
    crs_units: Units | None = None,
    damaged: Damaged = refuse,
    must_be_valid: bool = False,
) -> Iterator[BuildingModel]:
    """Yield the buildings of a CityJSON or CityJSONSeq file in its order.

    The solids of their parts are joined. Coordinates are metres.

    Solids of the highest level of detail count, and building parts that hiproof cut come as the
    whole that they were. `alternative` are the units of a file that names no CRS, `crs_units`
    those of one of which more is known than it names. A building whose text or solid is of no use
    is told to `damaged`, which refuses the file by default, and comes without a solid, so that the
    order stays; with `must_be_valid` so does one whose solid is invalid by ISO 19107. Raises
    InputError for files that cannot be read as CityJSON, or that are in degrees.
    """
    for feature in features(Path(path), alternative, crs_units, damaged):
        if feature.is_damaged:
            yield BuildingModel(feature.place, is_damaged=True)
        for id, city_object in feature.objects.items():
            try:
                if isinstance(city_object, dict) and city_object.get("type") != "Building":
                    continue
                yield usable(read_building(id, city_object, feature), must_be_valid)
            except (*UNUSABLE, shapely.GEOSException) as error:
                damaged(unusable(id, feature, error))
                yield BuildingModel(id, is_damaged=True)


def read_building(id: str, city_object: Any, feature: Feature) -> BuildingModel:
    """Read a building with its parts. Raises one of UNUSABLE."""
    geometries = read_geometries(city_object)
    children = require_list(city_object.get("children") or [], "children")
    family = [
        city_object,
        *(feature.objects[child] for child in children if is_part(child, feature)),
    ]
    solids = [
        select_solids(geometries),
        *(select_solids(read_geometries(child)) for child in family[1:]),
    ]
    level = max((read_level(solid) for geometries in solids for solid in geometries), default=0.0)
    surfaces = [
        surface
        for geometries in solids
        for surface in surfaces_at(geometries, level, len(feature.vertices))
    ]
    attributes = city_object.get("attributes") or {}
    if not isinstance(attributes, dict):
        raise ValueError(f"{excerpt(attributes)} as its attributes")
    part_types = {
        read_part_number(s): str(s.semantics[PART_TYPE])
        for s in surfaces
        if PART_TYPE in s.semantics
    }
    faces = tuple(
        Face(s.rings, s.kind, read_part_number(s) if s.kind == ROOF else -1) for s in surfaces
    )
    solid = compact(feature.vertices, faces) if faces else None
    joined = join_shells(solid, family) if solid is not None else None
    suns = read_suns(surfaces) if joined is solid else ()
    # a number beyond all bounds is none
    model = BuildingModel(id, finite(attributes), joined, suns=suns)
    return replace(model, part_types={0: model.roof_type} | part_types)


def read_suns(surfaces: list[ShellSurface]) -> tuple[float, ...]:
    """Read the sun on the faces of a solid, NaN where a face has none."""
    values = [surface.semantics.get(SUN_ATTRIBUTE) for surface in surfaces]
    suns = tuple(float(v) if isinstance(v, (int, float)) else math.nan for v in values)
    return suns if any(map(math.isfinite, suns)) else ()


def is_part(child: Any, feature: Feature) -> bool:
    """Return whether a child of a building is there and belongs to its shell."""
    found = feature.objects.get(child)
    return found is not None and not (
        isinstance(found, dict) and found.get("type") == "BuildingInstallation"
    )


def usable(model: BuildingModel, must_be_valid: bool) -> BuildingModel:
    """Return a usable model; raises ValueError if it cannot be drawn, or must be valid."""
    if model.solid is None:
        return model
    findings = check_solid(model.solid) if must_be_valid else []
    try:
        if not findings:
            faces_triangles(model.solid.vertices, model.solid.faces)
            return model
    except (shapely.GEOSException, KeyError):
        findings = check_solid(model.solid)
    message = findings[0].message if findings else "faces that cannot be cut into triangles"
    raise ValueError(f"an invalid solid: {message}")


def join_shells(solid: Solid, family: list[dict[str, Any]]) -> Solid:
    """Join the shells of building parts into one, without the walls between them."""
    part_solids = [
        member for member in family if f"{OWN}primitives" in (member.get("attributes") or {})
    ]
    if not part_solids or len(solid.select_faces(GROUND)) < 2:
        return solid
    return join_parts(solid)


def select_solids(geometries: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [geometry for geometry in geometries if geometry.get("type") == "Solid"]


def surfaces_at(solids: list[dict[str, Any]], level: float, vertices: int) -> list[ShellSurface]:
    """Read the surfaces of the first of `solids` of the level of detail `level`."""
    solid = next((solid for solid in solids if read_level(solid) == level), None)
    if solid is None:
        return []
    semantics = solid.get("semantics") or {}
    values = require_list(semantics.get("values") or [None], "semantic values")[0]
    outer = require_list(
        require_list(solid.get("boundaries"), "the boundaries of a solid")[0], "its outer shell"
    )
    if not outer or (
        values is not None and len(require_list(values, "semantic values")) != len(outer)
    ):
        raise ValueError(
            f"a solid of {len(outer)} faces"
            + (f", and semantics of {len(values)}" if values else "")
        )
    return read_shell(outer, values, semantics.get("surfaces") or [], vertices)


def read_part_number(surface: ShellSurface) -> int:
    """Return the number of a roof surface's part, 0 where there is none."""
    number = surface.semantics.get(PART_ATTRIBUTE, 0)
    if type(number) is not int or not 0 <= number < MOST_PART_NUMBER:
        raise ValueError(f"{excerpt(number)} as the number of a part")
    return number


def read_level(geometry: dict[str, Any]) -> float:
    try:
        level = float(geometry["lod"])
    except (KeyError, TypeError, ValueError, OverflowError):
        return 0.0
    return level if math.isfinite(level) else 0.0


def compact(vertices: np.ndarray, faces: tuple[Face, ...]) -> Solid:
    """Return a solid of the vertices that faces use; ValueError if one is no place."""
    smallest = min(len(set(ring)) for face in faces for ring in (face.rings or ((),)))
    if smallest < 3:
        raise ValueError(f"a ring of {smallest} points")
    solid = Solid(vertices, faces).drop_unused_vertices()
    if not is_plausible(solid.vertices).all():
        raise ValueError("coordinates of no place on Earth")
    return solid
