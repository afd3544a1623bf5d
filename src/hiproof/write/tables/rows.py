"""The rows of one building in a run's tables: outline, parts where they show, surfaces."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely

from ...compose.settle import round_number
from ...data_files import Values
from ...errors import OutputError
from ...frames import METRES, Units
from ...geometry.flat_shell import FlatShell
from ...model import ROOF, Building
from ...model.roof_figures import RoofFigures
from ..attribute_list import TABLES
from ..building_attributes import ROW_ENCODER, part_values
from ..fragments import Sheet
from ..surfaces import number_surfaces
from ..values import metres, plain_text

Row = tuple[bytes | None, Values]  # the geometry as WKB, the values by column


class Rows(NamedTuple):
    """The rows of one building by table."""

    buildings: tuple[Row, ...]
    parts: tuple[Row, ...] = ()
    roof_surfaces: tuple[Row, ...] = ()
    history: tuple[Row, ...] = ()

    def to_text(self) -> bytes:
        """Return the rows as JSON, a line a table, geometries in hexadecimal digits."""
        tables = ([[wkb and wkb.hex(), values] for wkb, values in table] for table in self)
        return b"\n".join(ROW_ENCODER.encode(table).encode() for table in tables)


def split_lines(text: bytes) -> dict[str, bytes]:
    """Split the text of `Rows.to_text` into each table's line.

    Raises OutputError for what another version did.

    >>> split_lines(Rows(((None, {"id": "a"}),)).to_text())["buildings"]
    b'[[null, {"id": "a"}]]'
    """
    lines = text.split(b"\n")
    if len(lines) != len(Rows._fields):
        raise OutputError(
            "expected the rows of a building as this version keeps them, got others; begin anew "
            "with --restart"
        )
    return dict(zip(Rows._fields, lines, strict=True))


def table_rows(sheet: Sheet) -> Rows:
    """Return the rows of a building, their geometry in the unit of tables."""
    building, units = sheet.building, sheet.head.units.table
    rows = []
    for model in (building.change or {}).get("history", ()):
        shell, *holes = model["outline"]
        values = {name: model.get(name) for name in TABLES["history"].names}
        values |= {"successor": plain_text(building.id), "parts": len(model["parts"])}
        rows.append((encode_geometry(shapely.Polygon(shell, holes), units), values))
    return Rows(
        (building_row(building, sheet.attributes, units),),
        part_rows(building, units),
        surface_rows(building, sheet.figures, units, sheet.surfaces),
        tuple(rows),
    )


def building_row(building: Building, attributes: Values, units: Units) -> Row:
    """Return the outline in `units`, None if unknown, and attributes by column."""
    outline = building.footprint if building.built is None else building.roof.world_outline
    names = {
        f"{name}_input" if name.lower() == "id" else name: value
        for name, value in attributes.items()
    }
    return encode_geometry(outline, units), {"id": plain_text(building.id), **names}


def part_rows(building: Building, units: Units = METRES) -> tuple[Row, ...]:
    """Return a row a part that shows: where, its type, parameters and deviations."""
    rows = []
    for number, visible in enumerate(building.compute_visible_areas()):
        if visible.is_empty:
            continue
        values = {"building_id": plain_text(building.id), **part_values(building, number, visible)}
        rows.append((encode_geometry(visible, units), values))
    return tuple(rows)


def surface_rows(
    building: Building,
    figures: RoofFigures | None,
    units: Units,
    attributes: dict[int, Values],
) -> tuple[Row, ...]:
    """Return a row a roof face: polygon, slope, azimuth, area, part and its `attributes`.

    Attributes are given by face. Facets of one curved surface have one number.
    """
    if figures is None:
        return ()
    solid = building.solid
    roofs = [(index, face) for index, face in enumerate(solid.faces) if face.kind == ROOF]
    shell = FlatShell(np.round(units.from_metres(solid.vertices), 4), *solid.flatten())
    drawn = shell.draw_faces(np.array([index for index, _ in roofs], int), shell.corners)
    polygons = shapely.to_wkb(drawn)
    numbers = number_surfaces(solid.faces, building.parts)
    place = {index: k for k, (index, _) in enumerate(roofs)}
    rows: list[Row] = []
    for (index, face), polygon in zip(roofs, polygons, strict=True):
        azimuth = float(figures.face_azimuth_deg[index])
        mask = 0 <= face.part < len(building.parts)
        values = {
            "building_id": plain_text(building.id),
            "number": place[numbers[index]],
            "part": face.part if mask else None,
            "type": building.parts[face.part].type if mask else None,
            "slope_deg": round_number(figures.face_slope_deg[index], 3),
            "azimuth_deg": round_number(azimuth, 3) if math.isfinite(azimuth) else None,
            "area_m2": metres(figures.face_area_m2[index]),
            **attributes.get(index, {}),
        }
        rows.append((polygon, values))
    return tuple(rows)


def encode_geometry(geometry: shapely.Geometry | None, units: Units) -> bytes | None:
    """Return a plan geometry (world metres) in `units` as WKB, None for an empty one."""
    if geometry is None or geometry.is_empty:
        return None
    return shapely.to_wkb(
        geometry if units == METRES else shapely.transform(geometry, units.from_metres)
    )
