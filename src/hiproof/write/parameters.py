"""parameters.jsonl: the parametric models themselves.

A head, then one JSON object a line for each building asked for.

`hiproof build` makes all files of a run of it again; docs/parameters.md says how to edit it by
hand.
"""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from typing import Any

import numpy as np
import shapely

from ..compose.settle import DIGITS, round_number
from ..data_files import Values
from ..model import Building, Model, Part
from .attribute_list import TABLES
from .fragments import Fragment, Sheet
from .head import FileHead
from .values import dump, plain, plain_text
from .writer import BuildingWriter

VERSION = 1  # of the file's layout; one that is not known is refused


def write_parameters(
    path: str | os.PathLike[str],
    buildings: Iterable[Building],
    crs: Any = None,
    head: FileHead | None = None,
) -> None:
    """Write a head and one JSON object a building to `path`.

    Raises OutputError when it cannot be written. What stands in them is listed in
    docs/attributes.md. All lengths are metres, `origin` too, also where the files' CRS counts in
    feet; angles are degrees. What cannot be told is null.
    """
    with ParametersWriter(path, head or FileHead(crs)) as writer:
        for building in buildings:
            writer.put(Fragment(parameters_line(building)))


class ParametersWriter(BuildingWriter):
    """Incremental form of `write_parameters`."""

    def begin(self, stack: ExitStack) -> None:
        self.file.write(dump(head_record(self.head)) + b"\n")

    @staticmethod
    def fragment(sheet: Sheet) -> Fragment:
        return Fragment(parameters_line(sheet.building))

    def put(self, fragment: Fragment) -> None:
        self.file.write(fragment.text)


writer = ParametersWriter


def head_record(head: FileHead) -> Values:
    """Return the JSON object of the first line."""
    return {
        "hiproof_parameters": VERSION,
        "crs": crs_text(head.crs),
        "unit": head.unit,
        "cityjson_offset": None if head.offset is None else [float(value) for value in head.offset],
        "compose": dataclasses.asdict(head.compose),
        "write": dataclasses.asdict(head.write),
        **({} if head.update is None else {"update": dataclasses.asdict(head.update)}),
    }


def crs_text(crs: Any) -> str | None:
    """Return the shortest exact text of a CRS: "EPSG:7415" or WKT.

    >>> crs_text(7415)
    'EPSG:7415'
    """
    from pyproj import CRS

    from ..read.crs import epsg_code, parse_crs

    crs = parse_crs(crs)
    if crs is None:
        return None
    code = epsg_code(crs)
    is_same = code is not None and CRS.from_epsg(code).to_wkt() == crs.to_wkt()
    return f"EPSG:{code}" if is_same else crs.to_wkt()


def parameters_line(building: Building) -> bytes:
    return dump(building_record(building)) + b"\n"


def building_record(building: Building) -> Values:
    """Return the JSON object of one building; see `write_parameters`."""
    quality, roof = building.quality, None if building.built is None else building.roof
    record = {
        "id": plain_text(building.id),
        "status": building.status.code,
        "quality": None if building.grade is None else building.grade.code,
        "detail": building.detail or building.status.value,
        "type": building.type,
        "origin": None if roof is None else roof.frame.origin,
        "parts": [part_record(part) for part in building.parts],
        "outline": building.footprint if roof is None else roof.outline,
        "shift": [float(value) for value in building.shift],
        "z_ground": building.z_ground,
        "ground_source": building.ground_source or None,
        "terrain_line": building.terrain_intersection,
        **({} if building.built is None else list_further_values(building.built)),
        "attributes": {
            plain_text(name): plain(value) for name, value in building.attributes.items()
        },
        "points": int(quality.points),
        "residuals": {
            name: getattr(quality, name)
            for name in ("psd_mean", "psd_std", "rmse", "p95", "share_within_20cm", "outline_iou")
        },
        "density": quality.density,
        "nodata_share": quality.nodata_share,
        "unexplained_area_m2": quality.unexplained_area_m2,
        "objective": building.objective,
        "recognised": building.recognised,
        "types": building.types,
    }
    if building.epochs_used:
        record["survey_date"] = building.survey_date
        record["epochs_used"] = list(building.epochs_used)
    if building.change is not None:
        record["change"] = building.change
    return make_record("building", record)


def list_further_values(model: Model) -> Values:
    """Return what a building has beside its roof; nothing where it is as usual."""
    values: Values = {}
    if model.installations:
        values["installations"] = [
            make_record(
                "installation",
                {
                    "type": item.type,
                    "parameters": {
                        name: getattr(item, name) for name in ("length", "width", "height")
                    },
                    "position": item.position,
                    "rotation": math.degrees(item.kappa),
                },
            )
            for item in model.installations
        ]
    if model.underside.terrain:
        values["walls"] = "terrain"
    if model.underside.passages:
        z_origin = float(model.roof.frame.origin[2])
        values["passages"] = [
            make_record(
                "passage", {"outline": passage.outline, "ceiling": passage.ceiling + z_origin}
            )
            for passage in model.underside.passages
        ]
    if model.eaves is not None:
        overhangs = map(dataclasses.asdict, model.eaves.overhangs)
        values["overhangs"] = [make_record("overhang", item) for item in overhangs]
        values["roof_thickness"] = model.eaves.thickness
        values["footprint_kind"] = model.eaves.footprint_kind
    return values


def part_record(part: Part) -> Values:
    """Return a part of a building's object, as `hiproof build` reads it."""
    sigma = {
        ("rotation" if n == "kappa" else n): (math.degrees(s) if n == "kappa" else s)
        for n, s in part.sigma.items()
    }
    return make_record(
        "part",
        {
            "type": part.type,
            "parameters": part.parameters,
            "position": part.translation,
            "rotation": math.degrees(part.kappa),
            "sigma": sigma,
            "outlines": part.outlines,
        },
    )


def make_record(table: str, values: Values) -> Values:
    """Return values as the object of a table, each written by its declared type."""
    return {
        name: WRITERS[type](values[name]) if type in WRITERS else values[name]
        for name, _, _, _, type in TABLES[table].attributes
        if name in values
    }


def outline_record(outline: shapely.Polygon | None) -> list[list[list[float]]] | None:
    """Return the rings of a polygon, the outer first; None where it is None."""
    if outline is None or outline.is_empty:
        return None
    return [
        shapely.get_coordinates(ring).tolist() for ring in (outline.exterior, *outline.interiors)
    ]


def by_name(values: dict[str, float]) -> dict[str, float | None]:
    """Return numbers by name, in the order that the primitive declares."""
    return {str(name): number(value) for name, value in values.items()}


def number(value: float, digits: int = DIGITS) -> float | None:
    """Round a number; None for NaN and infinities, which JSON does not know."""
    return round_number(value, digits) if math.isfinite(value) else None


def places(xyz: np.ndarray) -> list[list[float | None]]:
    """Return a line (m, 3) as `numbers` of vertices, at once where all are known."""
    if not np.isfinite(xyz).all():
        return [numbers(place) for place in xyz.tolist()]
    return (np.round(xyz, DIGITS) + 0.0).tolist()


def numbers(values: Iterable[float]) -> list[float | None]:
    return [number(value) for value in values]


# How values of a type are written; all others are as they are.
WRITERS: dict[str, Callable[[Any], Any]] = {
    **dict.fromkeys(("number", "number?", "length"), number),
    **dict.fromkeys(
        ("place", "place?"), lambda values: None if values is None else numbers(values)
    ),
    **dict.fromkeys(("polygon", "polygon?"), outline_record),
    **dict.fromkeys(("numbers", "parameters", "box", "shares", "figures"), by_name),
    "polygon[]": lambda outlines: [outline_record(outline) for outline in outlines],
    "place[][]": lambda lines: [places(line) for line in lines],
}
