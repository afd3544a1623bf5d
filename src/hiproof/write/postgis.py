"""Models into PostGIS: a polyhedral surface a building with all attributes, a polygon a roof surface, the area where a part shows.

The surfaces of buildings are triangles: PostGIS computes exactly, and in exact numbers the corners of a face that are
stored to a tenth of a millimetre lie in no plane. Roof surfaces stay whole in a table of their own.
A prefix's tables hold one run: loading replaces what they held, in one transaction, so that readers see either run.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, OutputError
from ..frames import METRES, Units
from ..model import GROUND, ROOF, Face, Solid
from ..read.cityjson import documents
from ..read.crs import units_named
from ..read.database import import_psycopg, refuse_half_a_password
from ..rings import ring_normal
from .attribute_list import OWN, PARTS_LAYER
from .roof_figures import FLAT_SLOPE_DEG
from .triangles import faces_triangles

PARTS_AT_ONCE = 5000  # rows read of the GeoPackage at once: memory stays small for any city
KINDS = {"number": "double precision", "text": "text"}  # of columns from `area_m2` on
MEASURES = ", ".join(f"{a.name} {KINDS[a.kind]}" for a in PARTS_LAYER[3:])
SCHEMA = """
create extension if not exists postgis;
create table if not exists {buildings} (
    id text primary key, status text, roof_type text, attributes jsonb, geom geometry(PolyhedralSurfaceZ, {srid}));
create table if not exists {roofs} (
    building_id text references {buildings} (id) on delete cascade, number integer, part integer, type text,
    slope_deg double precision, azimuth_deg double precision, area_m2 double precision,
    geom geometry(PolygonZ, {srid}), primary key (building_id, number));
create table if not exists {parts} (
    building_id text references {buildings} (id) on delete cascade, part integer, type text,
    {measures}, geom geometry(MultiPolygon, {srid}), primary key (building_id, part));
create index if not exists {prefix}_buildings_geom on {buildings} using gist (geom);
create index if not exists {prefix}_roofs_geom on {roofs} using gist (geom);
create index if not exists {prefix}_roofs_type on {roofs} (type);
create index if not exists {prefix}_parts_geom on {parts} using gist (geom);
"""


@dataclass(frozen=True)
class Row:
    """A building as the tables hold it: its faces over `vertices` (n, 3) in `units`, each with its semantics."""

    id: str
    attributes: dict[str, Any]
    vertices: np.ndarray
    faces: tuple[Face, ...]
    semantics: tuple[dict[str, Any], ...]
    units: Units = METRES


def load_postgis(folder: Path, dsn: str, prefix: str = "hiproof", batch: int = 500, known: Units | None = None) -> int:
    """Replace the tables PREFIX_buildings, PREFIX_roofs and PREFIX_parts of the database at `dsn` by the models of `folder`.

    `known` are the units of models of which more is known than their CRS tells: slopes and areas are measured where the run was
    made. Returns the number of buildings loaded. Raises InputError for a folder without models, OutputError for a database
    that cannot be written.
    """
    path = Path(folder) / "buildings.city.jsonl"
    if not path.is_file():
        raise InputError(
            f"expected the output folder of a run, got {folder} without buildings.city.jsonl; check the path, or have "
            "`hiproof build` make that file of a run's parameters.jsonl"
        )
    if not prefix.isidentifier():
        raise InputError(
            f"expected a table prefix of letters, digits and underscores, got {prefix!r}; choose another --prefix"
        )
    psycopg = import_psycopg()
    names = {"prefix": prefix} | {table: f"{prefix}_{table}" for table in ("buildings", "roofs", "parts")}
    try:
        with psycopg.connect(refuse_half_a_password(dsn)) as connection, connection.cursor() as cursor:
            header, features = open_sequence(path)
            srid = srid_of(header)
            empty_tables(cursor, names, srid)
            named = header.get("metadata", {}).get("referenceSystem")
            units = known or units_named(named, units_of_run(path.parent))
            rows = (building_row(header["transform"], feature, units) for feature in features)
            count = sum(insert(cursor, some, names, srid) for some in batched(rows, batch))
            insert_parts(cursor, path.with_name("buildings.gpkg"), names["parts"], srid)
            return count
    except psycopg.Error as error:
        reason = str(error).strip().splitlines()[0]
        raise OutputError(
            f"expected a PostGIS database that can be written, got: {reason}; check the address"
        ) from error


def empty_tables(cursor: Any, names: dict[str, str], srid: int) -> None:
    """Make the tables, or empty those that are there and give them the run's reference system."""
    cursor.execute(SCHEMA.format(srid=srid, measures=MEASURES, **names))
    cursor.execute("delete from {buildings}".format(**names))
    for key, kind in (("buildings", "PolyhedralSurfaceZ"), ("roofs", "PolygonZ"), ("parts", "MultiPolygon")):
        table = names[key]
        cursor.execute("select srid from geometry_columns where f_table_name = %s", (table,))
        if {known for (known,) in cursor.fetchall()} != {srid}:
            cursor.execute(f"alter table {table} alter column geom type geometry({kind}, {srid})")


def batched(rows: Iterator[Row], size: int) -> Iterator[list[Row]]:
    while batch := list(islice(rows, size)):
        yield batch


def open_sequence(path: Path) -> tuple[dict, Iterator[dict]]:
    """The first line of a CityJSONSeq and an iterator over its features."""
    lines = (document for document, _ in documents(path))
    return next(lines), lines


def srid_of(header: dict) -> int:
    """EPSG code of the metadata's reference system; 0 (unknown to PostGIS) without one."""
    code = str(header.get("metadata", {}).get("referenceSystem", "")).rsplit("/", 1)[-1]
    return int(code) if code.isdigit() else 0


def units_of_run(folder: Path) -> Units:
    """Units that the record of a run tells of, metres where there is no record."""
    record = folder / "run.json"
    told = json.loads(record.read_text(encoding="utf-8")).get("units", {}) if record.is_file() else {}
    return Units(told.get("metres_in_plan_unit", 1.0), told.get("metres_in_height_unit", 1.0))


def building_row(transform: dict, feature: dict, units: Units = METRES) -> Row:
    """The building of a CityJSON feature whose coordinates are integers by `transform`."""
    vertices = np.asarray(feature["vertices"], float).reshape(-1, 3) * transform["scale"] + transform["translate"]
    city_object = feature["CityObjects"][feature["id"]]
    solids = [g for o in feature["CityObjects"].values() for g in o.get("geometry", []) if g["type"] == "Solid"]
    level = max((geometry["lod"] for geometry in solids), default="")
    faces, semantics = [], []
    for geometry in (solid for solid in solids if solid["lod"] == level):
        surfaces, values = geometry["semantics"]["surfaces"], geometry["semantics"]["values"][0]
        for rings, index in zip(geometry["boundaries"][0], values, strict=True):
            semantics.append(surfaces[index])
            faces.append(Face(tuple(map(tuple, rings)), surfaces[index]["type"]))
    if sum(face.kind == GROUND for face in faces) > 1:
        vertices, faces, semantics = in_one_shell(vertices, faces, semantics, units)
    return Row(feature["id"], city_object.get("attributes", {}), vertices, tuple(faces), tuple(semantics), units)


def in_one_shell(
    vertices: np.ndarray, faces: list[Face], semantics: list[dict[str, Any]], units: Units
) -> tuple[np.ndarray, list[Face], list[dict[str, Any]]]:
    """Vertices, faces and semantics of a building in parts, without the walls between them."""
    from ..compose.building_parts import whole_of

    whole = whole_of(Solid(units.to_metres(vertices), tuple(faces)))
    roofs = [said for face, said in zip(faces, semantics, strict=True) if face.kind == ROOF]
    others = [{"type": face.kind} for face in whole.faces if face.kind != ROOF]
    return units.from_metres(whole.vertices), list(whole.faces), [*roofs, *others]


def insert(cursor: Any, rows: list[Row], names: dict[str, str], srid: int) -> int:
    """Insert buildings together with their roof surfaces."""
    geometry = f"ST_GeomFromEWKT('SRID={srid};' || %s::text)"
    cursor.executemany(
        f"insert into {names['buildings']} values (%s, %s, %s, %s, {geometry})",
        [
            (r.id, r.attributes.get(f"{OWN}status"), r.attributes.get(f"{OWN}roof_type"), json.dumps(r.attributes),
             polyhedral_wkt(r))
            for r in rows
        ],
    )  # fmt: skip
    cursor.executemany(
        f"insert into {names['roofs']} values (%s, %s, %s, %s, %s, %s, %s, {geometry})",
        [roof for row in rows for roof in roof_rows(row)],
    )
    return len(rows)


def insert_parts(cursor: Any, path: Path, table: str, srid: int) -> None:
    """Insert the layer `parts` of the GeoPackage at `path`; nothing where there is none."""
    import pyogrio

    if not path.is_file() or "parts" not in pyogrio.list_layers(path)[:, 0]:
        return
    columns = [attribute.name for attribute in PARTS_LAYER]
    values = ", ".join(["%s"] * len(columns))
    sql = f"insert into {table} ({', '.join(columns)}, geom) values ({values}, ST_SetSRID(%s::geometry, {srid}))"
    start = 0
    while True:
        _, _, wkb, found = pyogrio.raw.read(
            path, layer="parts", columns=columns, skip_features=start, max_features=PARTS_AT_ONCE
        )
        cursor.executemany(sql, [(*map(known, row), geometry) for *row, geometry in zip(*found, wkb, strict=True)])
        start += len(wkb)
        if len(wkb) < PARTS_AT_ONCE:
            return


def known(value: Any) -> Any:
    """A value of a table as the database takes it; NaN, which stands for what is not known, as null."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and math.isnan(value) else value


def roof_rows(row: Row) -> Iterator[tuple]:
    """A row a roof surface: (building, number, part, type, slope, azimuth, area, WKT)."""
    roofs = [(face, said) for face, said in zip(row.faces, row.semantics, strict=True) if face.kind == ROOF]
    for number, (face, said) in enumerate(roofs):
        rings = [row.vertices[list(ring)] for ring in face.rings]
        yield (
            row.id,
            number,
            said.get(f"{OWN}part"),
            said.get(f"{OWN}part_type"),
            *lie_of([row.units.to_metres(ring) for ring in rings]),
            f"POLYGON Z {rings_wkt(rings)}",
        )


def lie_of(rings: list[np.ndarray]) -> tuple[float, float | None, float]:
    """Slope (deg), azimuth of the fall line (deg clockwise from north, None where flat), true area (m2) of rings in metres."""
    normal = np.sum([ring_normal(ring) for ring in rings], axis=0)
    area = float(np.linalg.norm(normal))
    slope = float(np.degrees(np.arctan2(np.hypot(*normal[:2]), abs(normal[2]))))
    azimuth = float(np.degrees(np.arctan2(normal[0], normal[1])) % 360) if slope >= FLAT_SLOPE_DEG else None
    return slope, azimuth, area


def polyhedral_wkt(row: Row) -> str | None:
    """The shell as triangles over the solid's own vertices, so that neighbours stay joined; None without one."""
    triangles = [t for face in faces_triangles(row.vertices, row.faces) for t in row.vertices[face]]
    return f"POLYHEDRALSURFACE Z ({', '.join(rings_wkt([t]) for t in triangles)})" if triangles else None


def rings_wkt(rings: list[np.ndarray]) -> str:
    closed = (np.vstack([ring, ring[:1]]) for ring in rings)
    return (
        "(" + ", ".join("(" + ", ".join(f"{x:.4f} {y:.4f} {z:.4f}" for x, y, z in ring) + ")" for ring in closed) + ")"
    )
