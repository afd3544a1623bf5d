"""Models into PostGIS: a polyhedral surface a building, a polygon a roof surface, with all attributes.

Loading is idempotent: rows are keyed by building id, so loading a folder again replaces its rows and adds none.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, OutputError
from ..read.database import import_psycopg

SCHEMA = """
create extension if not exists postgis;
create table if not exists {buildings} (
    id text primary key, status text, roof_type text, attributes jsonb, geom geometry(PolyhedralSurfaceZ, {srid}));
create table if not exists {roofs} (
    building_id text references {buildings} (id) on delete cascade, number integer, roof_type text,
    slope_deg double precision, azimuth_deg double precision, area_m2 double precision,
    geom geometry(PolygonZ, {srid}), primary key (building_id, number));
create index if not exists {prefix}_buildings_geom on {buildings} using gist (geom);
create index if not exists {prefix}_roofs_geom on {roofs} using gist (geom);
create index if not exists {prefix}_roofs_type on {roofs} (roof_type);
"""


def load_postgis(folder: Path, dsn: str, prefix: str = "hiproof", batch: int = 500) -> int:
    """Load `folder`/buildings.city.jsonl into tables PREFIX_buildings and PREFIX_roofs of the database at `dsn`.

    Returns the number of buildings loaded. Raises InputError for a folder without models, OutputError for a database
    that cannot be written.
    """
    path = Path(folder) / "buildings.city.jsonl"
    if not path.is_file():
        raise InputError(
            f"expected the output folder of a run, got {folder} without buildings.city.jsonl; check the path"
        )
    if not prefix.isidentifier():
        raise InputError(f"expected a table prefix of letters, digits and underscores, got {prefix!r}")
    psycopg = import_psycopg()
    names = {"buildings": f"{prefix}_buildings", "roofs": f"{prefix}_roofs", "prefix": prefix}
    try:
        with psycopg.connect(dsn) as connection, connection.cursor() as cursor:
            header, features = open_sequence(path)
            cursor.execute(SCHEMA.format(srid=srid_of(header), **names))
            loaded, rows = 0, []
            for feature in features:
                rows.append(building_row(header, feature))
                if len(rows) == batch:
                    loaded += insert(cursor, rows, names, srid_of(header))
                    rows = []
            return loaded + insert(cursor, rows, names, srid_of(header))
    except psycopg.Error as error:
        raise OutputError(f"expected a PostGIS database that can be written, got: {str(error).strip()}") from error


def open_sequence(path: Path) -> tuple[dict, Iterator[dict]]:
    """The first line of a CityJSONSeq and an iterator over its features."""
    lines = path.open(encoding="utf-8")
    return json.loads(next(lines)), (json.loads(line) for line in lines if line.strip())


def srid_of(header: dict) -> int:
    """EPSG code of the metadata's reference system; 0 (unknown to PostGIS) without one."""
    code = str(header.get("metadata", {}).get("referenceSystem", "")).rsplit("/", 1)[-1]
    return int(code) if code.isdigit() else 0


def building_row(header: dict, feature: dict) -> tuple[str, dict, list[tuple[str, list[np.ndarray], dict]]]:
    """(id, attributes, surfaces) of a feature, each surface as (semantic type, rings (m, 3), semantic attributes)."""
    transform = header["transform"]
    vertices = np.asarray(feature["vertices"], float).reshape(-1, 3) * transform["scale"] + transform["translate"]
    city_object = feature["CityObjects"][feature["id"]]
    surfaces = []
    for geometry in city_object.get("geometry", []):
        if geometry["type"] != "Solid":
            continue
        semantics = geometry["semantics"]
        for rings, index in zip(geometry["boundaries"][0], semantics["values"][0], strict=True):
            semantic = semantics["surfaces"][index]
            surfaces.append((semantic["type"], [vertices[ring] for ring in rings], semantic))
    return feature["id"], city_object.get("attributes", {}), surfaces


def insert(cursor: Any, rows: list, names: dict[str, str], srid: int) -> int:
    """Insert or replace buildings together with their roof surfaces."""
    ids = [id for id, _, _ in rows]
    cursor.execute(f"delete from {names['buildings']} where id = any(%s)", (ids,))
    geometry = f"ST_GeomFromEWKT('SRID={srid};' || %s::text)"
    cursor.executemany(
        f"insert into {names['buildings']} values (%s, %s, %s, %s, {geometry})",
        [
            (id, a.get("status"), a.get("roof_type", a.get("rf_roof_type")), json.dumps(a), polyhedral_wkt(surfaces))
            for id, a, surfaces in rows
        ],
    )
    cursor.executemany(
        f"insert into {names['roofs']} values (%s, %s, %s, %s, %s, %s, {geometry})",
        [roof for id, _, surfaces in rows for roof in roof_rows(id, surfaces)],
    )
    return len(rows)


def roof_rows(id: str, surfaces: list) -> Iterator[tuple]:
    """A row a roof surface: (building, number, type, slope, azimuth, area, WKT)."""
    number = 0
    for kind, rings, semantic in surfaces:
        if kind == "RoofSurface":
            slope, azimuth, area = lie_of(rings)
            yield id, number, semantic.get("roof_type"), slope, azimuth, area, f"POLYGON Z {rings_wkt(rings)}"
            number += 1


def lie_of(rings: list[np.ndarray]) -> tuple[float, float | None, float]:
    """Slope (deg), azimuth of the fall line (deg clockwise from north, None where flat) and true area (m2)."""
    normal = sum(0.5 * np.cross(ring - ring[0], np.roll(ring, -1, axis=0) - ring[0]).sum(axis=0) for ring in rings)
    area = float(np.linalg.norm(normal))
    slope = float(np.degrees(np.arctan2(np.hypot(*normal[:2]), abs(normal[2]))))
    azimuth = float(np.degrees(np.arctan2(normal[0], normal[1])) % 360) if slope > 0.01 else None
    return slope, azimuth, area


def polyhedral_wkt(surfaces: list) -> str | None:
    if not surfaces:
        return None
    return f"POLYHEDRALSURFACE Z ({', '.join(rings_wkt(rings) for _, rings, _ in surfaces)})"


def rings_wkt(rings: list[np.ndarray]) -> str:
    closed = (np.vstack([ring, ring[:1]]) for ring in rings)
    return (
        "(" + ", ".join("(" + ", ".join(f"{x:.4f} {y:.4f} {z:.4f}" for x, y, z in ring) + ")" for ring in closed) + ")"
    )
