"""Models into PostGIS: a polyhedral surface a building with all attributes, a polygon a roof
surface, the area where a part shows.

The surfaces of buildings are triangles: PostGIS computes exactly, and in exact numbers the corners
of a face that are stored to a tenth of a millimetre lie in no plane. Roof surfaces stay whole in a
table of their own. A prefix's tables hold one run: loading replaces what they held, in one
transaction, so that readers see either run.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from ...errors import InputError, OutputError
from ...frames import METRES, Units
from ...geometry.rings import ring_normal
from ...model import ROOF, Solid
from ...read.database import TIMEOUT_S, import_psycopg, refuse_half_a_password
from ..attribute_list import PARTS_LAYER
from ..meshes.triangles import faces_triangles
from ..roof_figures import FLAT_SLOPE_DEG

BATCH = 500  # buildings sent at once
# first half of the keys of our advisory locks ("hi"); the second is the prefix's, 0 for the
# extension
LOCKS = 0x6869
# Names of indexes add 15 characters, and PostgreSQL cuts at 63.
TABLE_PREFIX = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,47}")
COLUMN_TYPES = {"number": "double precision", "text": "text"}  # of columns from `area_m2` on
MEASURE_COLUMNS = ", ".join(f"{a.name} {COLUMN_TYPES[a.kind]}" for a in PARTS_LAYER[3:])
TABLE_SCHEMA = """
create table if not exists {buildings} (
    id text primary key, status text, quality text, roof_type text, attributes jsonb,
    geom geometry(PolyhedralSurfaceZ, {srid}));
alter table {buildings} add column if not exists quality text;
create table if not exists {roofs} (
    building_id text references {buildings} (id) on delete cascade,
    number integer, part integer, type text,
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
class DatabaseRow:
    """A building as the tables hold it: its `solid` in metres, None without a model, the types of
    its parts by number, and the `units` in which the tables hold coordinates."""

    id: str
    status: str | None
    roof_type: str | None
    attributes: dict[str, Any]
    solid: Solid | None
    part_types: Mapping[int, str]
    units: Units = METRES
    quality: str | None = None


def load_rows(
    dsn: str,
    rows: Iterator[DatabaseRow],
    parts: Iterable[Sequence[tuple]],
    srid: int = 0,
    prefix: str = "hiproof",
) -> int:
    """Replace the tables PREFIX_buildings, PREFIX_roofs and PREFIX_parts of the database at `dsn`;
    returns the number of buildings.

    `parts` are rows of values of PARTS_LAYER and a geometry as WKB, some at a time; those of
    buildings that are not among `rows` are left out. Raises InputError for a prefix that makes no
    names of tables, OutputError for a database that cannot be written.
    """
    if not TABLE_PREFIX.fullmatch(prefix):
        raise InputError(
            "expected a table prefix of at most 48 letters (a to z), digits and underscores, got "
            f"{prefix!r:.80}; "
            "choose another --prefix"
        )
    psycopg = import_psycopg()
    prefix = prefix.lower()  # as PostgreSQL reads names
    names = {"prefix": prefix} | {
        table: f"{prefix}_{table}" for table in ("buildings", "roofs", "parts")
    }
    try:
        with (
            psycopg.connect(refuse_half_a_password(dsn), connect_timeout=TIMEOUT_S) as connection,
            connection.cursor() as cursor,
        ):
            add_extension(connection, cursor)
            cursor.execute("select pg_advisory_xact_lock(%s, hashtext(%s))", (LOCKS, prefix))
            empty_tables(cursor, names, srid)
            loaded: set[str] = set()
            while batch := list(islice(rows, BATCH)):
                insert(cursor, batch, names, srid)
                loaded |= {row.id for row in batch}
            insert_parts(cursor, parts, loaded, names["parts"], srid)
            return len(loaded)
    except psycopg.OperationalError as error:
        raise explain_not_written(error, "; check the address") from error
    except (psycopg.Error, UnicodeError) as error:
        raise explain_not_written(error, "") from error


def explain_not_written(error: Exception, advice: str) -> OutputError:
    reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
    return OutputError(f"expected a PostGIS database that can be written, got: {reason}{advice}")


def add_extension(connection: Any, cursor: Any) -> None:
    """Add PostGIS to the database where it is missing, one load at a time: PostgreSQL does not wait
    by itself."""
    cursor.execute("select pg_advisory_xact_lock(%s, 0)", (LOCKS,))
    cursor.execute("create extension if not exists postgis")
    connection.commit()


def empty_tables(cursor: Any, names: dict[str, str], srid: int) -> None:
    """Make the tables, or empty those that are there and give them the run's reference system."""
    cursor.execute(TABLE_SCHEMA.format(srid=srid, measures=MEASURE_COLUMNS, **names))
    cursor.execute("delete from {buildings}".format(**names))
    for key, kind in (
        ("buildings", "PolyhedralSurfaceZ"),
        ("roofs", "PolygonZ"),
        ("parts", "MultiPolygon"),
    ):
        table = names[key]
        cursor.execute("select Find_SRID(current_schema()::text, %s, 'geom')", (table,))
        if cursor.fetchone() != (srid,):
            cursor.execute(f"alter table {table} alter column geom type geometry({kind}, {srid})")


def insert(cursor: Any, rows: list[DatabaseRow], names: dict[str, str], srid: int) -> None:
    """Insert buildings together with their roof surfaces."""
    geometry = f"ST_GeomFromEWKT('SRID={srid};' || %s::text)"
    cursor.executemany(
        f"insert into {names['buildings']} (id, status, quality, roof_type, attributes, geom)"
        f" values (%s, %s, %s, %s, %s, {geometry})",
        [
            (r.id, r.status, r.quality, r.roof_type, json.dumps(r.attributes), polyhedral_wkt(r))
            for r in rows
        ],
    )
    cursor.executemany(
        f"insert into {names['roofs']} values (%s, %s, %s, %s, %s, %s, %s, {geometry})",
        [roof for row in rows for roof in roof_rows(row)],
    )


def insert_parts(
    cursor: Any, parts: Iterable[Sequence[tuple]], loaded: set[str], table: str, srid: int
) -> None:
    """Insert the rows of parts whose building is among those `loaded`."""
    columns = [attribute.name for attribute in PARTS_LAYER]
    values = ", ".join(["%s"] * len(columns))
    sql = (
        f"insert into {table} ({', '.join(columns)}, geom) values ({values}, "
        f"ST_SetSRID(%s::geometry, {srid}))"
    )
    for part in parts:
        cursor.executemany(
            sql, [tuple(map(convert_value, row)) for row in part if row[0] in loaded]
        )


def convert_value(value: Any) -> Any:
    """A value of a table as the database takes it; NaN, which stands for what is not known, as
    null."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and math.isnan(value) else value


def roof_rows(row: DatabaseRow) -> Iterator[tuple]:
    """A row a roof surface: (building, number, part, type, slope, azimuth, area, WKT)."""
    if row.solid is None:
        return
    for number, face in enumerate(row.solid.select_faces(ROOF)):
        rings = [row.solid.vertices[list(ring)] for ring in face.rings]
        wkt = f"POLYGON Z {rings_wkt([row.units.from_metres(ring) for ring in rings])}"
        yield (row.id, number, face.part, row.part_types.get(face.part), *measure_plane(rings), wkt)


def measure_plane(rings: list[np.ndarray]) -> tuple[float, float | None, float]:
    """Slope (deg), azimuth of the fall line (deg clockwise from north, None where flat), true area
    (m2) of rings in metres."""
    normal = np.sum([ring_normal(ring) for ring in rings], axis=0)
    area = float(np.linalg.norm(normal))
    slope = float(np.degrees(np.arctan2(np.hypot(*normal[:2]), abs(normal[2]))))
    azimuth = (
        float(np.degrees(np.arctan2(normal[0], normal[1])) % 360)
        if slope >= FLAT_SLOPE_DEG
        else None
    )
    return slope, azimuth, area


def polyhedral_wkt(row: DatabaseRow) -> str | None:
    """The shell as triangles over the solid's own vertices, so that neighbours stay joined; None
    without one."""
    if row.solid is None:
        return None
    places = row.units.from_metres(row.solid.vertices)
    triangles = [
        places[t] for face in faces_triangles(row.solid.vertices, row.solid.faces) for t in face
    ]
    return f"POLYHEDRALSURFACE Z ({', '.join(rings_wkt([t]) for t in triangles)})"


def rings_wkt(rings: list[np.ndarray]) -> str:
    closed = (np.vstack([ring, ring[:1]]) for ring in rings)
    return (
        "("
        + ", ".join(
            "(" + ", ".join(f"{x:.4f} {y:.4f} {z:.4f}" for x, y, z in ring) + ")" for ring in closed
        )
        + ")"
    )
