"""Footprints from PostGIS.

An address is
`postgresql://user:password@host/database?table=schema.name[&geometry=column][&where=condition]`.

GDAL's wheels come without its PostgreSQL driver, so rows are read with psycopg and their geometries
as WKB. The condition is the user's own SQL: it is sent as part of one statement in a read-only
transaction, and can change nothing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from urllib.parse import parse_qs, urlencode, urlsplit, urlunsplit

import numpy as np
import shapely

from ...errors import InputError
from ...extras import import_extra
from ...masking import mask, remember
from .polygons import Features, decode_geometries

TIMEOUT_S = 10  # to reach a server; libpq would wait for minutes
SCHEMES = ("postgresql", "postgres")
# whose user and password, where it has any, are whole
ADDRESS = re.compile(r"\w+://[^/?#]*(:[^/?#]*)?@")


def is_database(source: Any) -> bool:
    """Return whether a footprint source names a database rather than a file."""
    return isinstance(source, str) and source.partition(":")[0].lower() in SCHEMES


def read_table(source: str, where: str | None = None) -> Features:
    """Read the table that a source names, in the shape that pyogrio gives.

    That is metadata (fields, crs), row numbers, geometries and columns. `where` is a condition
    beside the source's own. Raises InputError in a full sentence when the database, the table or
    the geometry column cannot be used.
    """
    with open_source(source, where) as table:
        rows = table.rows()
    if not rows:
        raise InputError(
            f"expected footprints in {table.name}, got a table without rows; name another, or "
            "relax the condition"
        )
    wkb, attributes = zip(*rows, strict=True)
    geometries = decode_geometries(wkb)
    names = sorted({name for row in attributes for name in row})
    columns = [np.array([row.get(name) for row in attributes], object) for name in names]
    srids = set(shapely.get_srid(geometries).tolist())
    meta = {"fields": names, "crs": find_crs(srids, table.name)}
    return meta, np.arange(len(rows)), geometries, columns


def table_crs(source: str) -> str | None:
    """Return a table's CRS without reading its rows; raises InputError as `read_table`."""
    with open_source(source) as table:
        return find_crs(table.srids(), table.name)


def find_crs(srids: set[int], table: str) -> str | None:
    srids = srids - {-1, 0}  # of no geometry, and unknown
    if len(srids) > 1:
        raise InputError(
            f"expected one reference system in {table}, got SRIDs {sorted(srids)}; choose "
            "rows with &where="
        )
    return f"EPSG:{srids.pop()}" if srids else None


@dataclass(frozen=True)
class DatabaseTable:
    """A table with geometries in an open database, and its selected rows."""

    cursor: Any
    name: str
    geometry: str
    where: str | None

    def query(self, text: str, columns: Sequence[str] = ()) -> None:
        """Run `text` with {g}, {c} and {t}: the geometry column, other `columns`, the table."""
        from psycopg import sql

        others = sql.SQL(", ").join(sql.Identifier("t", name) for name in columns)
        names = {"g": sql.Identifier(self.geometry), "c": others}
        # a line of its own: a comment at the condition's end must not swallow what follows it
        condition = sql.SQL(f" where {self.where}\n" if self.where else "")
        table = sql.SQL("{} t").format(sql.Identifier(*self.name.split("."))) + condition
        # asking for binary results takes the extended protocol, whose messages hold one statement
        # each
        self.cursor.execute(sql.SQL(text).format(t=table, **names), binary=True)

    def rows(self) -> list[tuple]:
        """Return each row's geometry (WKB or None) and attributes, ordered by content."""
        # PostGIS makes no JSON of geometries
        self.cursor.execute("select oid from pg_type where typname in ('geometry', 'geography')")
        shapes = {oid for (oid,) in self.cursor}
        self.query("select * from {t} limit 0")
        names = [one.name for one in self.cursor.description if one.type_code not in shapes]
        self.query(
            "select ST_AsEWKB(ST_CurveToLine({g})) as ewkb, (select to_jsonb(a) from (select {c}) "
            "a) as attributes from {t} order by 2, 1",
            names,
        )
        return self.cursor.fetchall()

    def srids(self) -> set[int]:
        self.query("select distinct ST_SRID({g}) from {t}")
        return {srid for (srid,) in self.cursor if srid is not None}


@contextmanager
def open_source(source: str, condition: str | None = None) -> Iterator[DatabaseTable]:
    """Open the table of a source for the block; database errors become InputErrors."""
    dsn, table, geometry, where = parse_source(source)
    # each on lines of its own: a comment at its end must not swallow the bracket
    where = f"({where}\n) and ({condition}\n)" if where and condition else where or condition
    psycopg = import_psycopg()
    try:
        with (
            psycopg.connect(dsn, connect_timeout=TIMEOUT_S) as connection,
            connection.cursor() as cursor,
        ):
            connection.read_only = True
            yield DatabaseTable(cursor, table, geometry or geometry_column(cursor, table), where)
    except psycopg.Error as error:
        reason = str(error).strip().splitlines()[0]
        raise InputError(
            f"expected a PostGIS table at {source}, got: {reason}; check address and table"
        ) from error


def parse_source(source: str) -> tuple[str, str, str | None, str | None]:
    """Split a source into dsn, table, and, if any, geometry column and condition."""
    try:
        url = urlsplit(refuse_half_a_password(source))
        query = parse_qs(url.query)
    except ValueError as error:
        raise InputError(
            f"expected a PostGIS table at {source}, got: {error}; check the address"
        ) from error
    options = {name: query.pop(name, [None])[0] for name in ("table", "geometry", "where")}
    if not options["table"]:
        raise InputError(
            f"expected a table in {source}, got none; add ?table=schema.name to the address"
        )
    dsn = urlunsplit(url._replace(query=urlencode(query, doseq=True)))
    return dsn, options["table"], options["geometry"], options["where"]


def refuse_half_a_password(address: str) -> str:
    """Return `address`; refuse a password with / ? or #, the rest of which would be shown."""
    remember(address)
    if ADDRESS.match(mask(address)) and not ADDRESS.match(address):
        raise InputError(
            f"expected %2F, %3F and %23 for / ? and # in the password of {address}, got the signs "
            "themselves"
        )
    return address


def geometry_column(cursor: Any, table: str) -> str:
    schema, _, name = table.rpartition(".")
    cursor.execute(
        "select f_geometry_column from geometry_columns where f_table_name = %s and (%s = '' or "
        "f_table_schema = %s)",
        (name, schema, schema),
    )
    result = [column for (column,) in cursor]
    if len(result) != 1:
        raise InputError(
            f"expected one geometry column in {table}, got {', '.join(result) or 'none'}; name it "
            "with &geometry="
        )
    return result[0]


def import_psycopg() -> Any:
    """Import psycopg. Raises InputError where it is missing."""
    return import_extra("psycopg", "postgis", "databases")
