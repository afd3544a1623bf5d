"""Models in PostGIS, with the columns of the GeoPackage.

A building is a polyhedral surface with all attributes, a roof surface a polygon, and a part the
area where it shows.

The surfaces of buildings are triangles: PostGIS computes exactly, and in exact numbers the corners
of a face that are stored to a tenth of a millimetre lie in no plane. Roof surfaces stay whole in a
table of their own. The tables of a prefix hold one run or, loaded with `append`, several, each
under its name in the column `run`. A load is one transaction, so that readers see either state.
"""

from __future__ import annotations

import re
import struct
import tempfile
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, OutputError
from ...frames import Units
from ...model import Solid
from ...read.models.damage import Damaged, refuse
from ...read.outlines.attribute_columns import quote
from ...read.outlines.database import TIMEOUT_S, import_psycopg, refuse_half_a_password
from ..attribute_list import PREFIX
from ..fragments import Sheet
from ..meshes.triangles import faces_triangles
from ..values import plain_text
from .rows import Rows, split_lines, table_rows
from .vector_layer import HISTORY, WaitingRows, column_kind, name_columns

# first half of the keys of our advisory locks ("hi"); the second is the prefix's, 0 for the
# extension
LOCKS = 0x6869
# Names of indexes add 15 characters, and PostgreSQL cuts at 63.
TABLE_PREFIX = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,47}")
MOST_POSTGRES_COLUMNS = 1600  # of a table in PostgreSQL, those that were dropped included
MOST_NAME_BYTES = 63  # of a column; PostgreSQL cuts longer names
POSTGRES_TYPES: dict[type, str] = {
    bool: "boolean",
    int: "bigint",
    float: "double precision",
    str: "text",
}
KIND_OF_TYPE = {name: kind for kind, name in POSTGRES_TYPES.items()}
OWN_COLUMNS = ("run", "geom")
# Codes of well-known binary: ISO's of surfaces in space, those in plan, and PostGIS's flag
WKB_POLYHEDRAL_Z = 1015
WKB_POLYGON_Z = 1003
WKB_POLYGON = 3
WKB_MULTIPOLYGON = 6
WKB_HAS_SRID = 0x20000000


class PostgisTable(NamedTuple):
    """A table of PostGIS.

    It has the layer of the GeoPackage whose columns it has, the end of its name, the kind of its
    geometry and the columns that name a row of a run.
    """

    layer: str
    ending: str
    geometry: str
    key: tuple[str, ...]


POSTGIS_TABLES = (
    PostgisTable("buildings", "buildings", "PolyhedralSurfaceZ", ("id",)),
    PostgisTable("parts", "parts", "MultiPolygon", ("building_id", "part")),
    PostgisTable("roof_surfaces", "roofs", "PolygonZ", ("building_id", "number")),
    PostgisTable(HISTORY, HISTORY, "MultiPolygon", ("id", "valid_to")),
)


@dataclass(frozen=True)
class Load:
    """The run that is loaded, and its tables.

    It has its `name`, the `folder` from which it came, the `prefix` of the tables, and the `srid`
    of its coordinates. Other runs in the tables are removed with `replace` and stay with `append`;
    without either they are a reason to refuse.
    """

    name: str
    folder: str
    prefix: str = "hiproof"
    srid: int = 0
    replace: bool = False
    append: bool = False


def load_tables(dsn: str, buildings: Iterable[Sheet], run: Load, damaged: Damaged = refuse) -> int:
    """Load `buildings` of a `run` into its tables, and return how many.

    They are PREFIX_buildings, PREFIX_parts and PREFIX_roofs of the database at `dsn`. A building
    whose id comes again is told to `damaged` and left out. Raises InputError for a prefix that
    makes no names of tables, OutputError for a database that cannot be written or holds another
    run.
    """
    if not TABLE_PREFIX.fullmatch(run.prefix):
        raise InputError(
            "expected a table prefix of at most 48 letters (a to z), digits and underscores, got "
            f"{run.prefix!r:.80}; choose another --prefix"
        )
    psycopg = import_psycopg()
    with ExitStack() as stack:
        try:
            connection = stack.enter_context(
                psycopg.connect(refuse_half_a_password(dsn), connect_timeout=TIMEOUT_S)
            )
            cursor = stack.enter_context(connection.cursor())
            # One load adds PostGIS at a time: PostgreSQL does not wait by itself.
            cursor.execute("select pg_advisory_xact_lock(%s, 0)", (LOCKS,))
            cursor.execute("create extension if not exists postgis")
            connection.commit()
            return Loading(cursor, run).load(stack, buildings, damaged)
        except (psycopg.Error, UnicodeError) as error:
            raise explain_not_written(error) from error


def explain_not_written(error: Exception) -> OutputError:
    """Return a database's error, with advice where it could not be reached."""
    reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
    is_reached = isinstance(error, UnicodeError) or getattr(error, "sqlstate", None)
    advice = "" if is_reached else "; check the address"
    return OutputError(f"expected a PostGIS database that can be written, got: {reason}{advice}")


class Loading:
    """One load, in the transaction of `cursor`."""

    def __init__(self, cursor: Any, run: Load) -> None:
        self.cursor, self.run = cursor, run
        self.prefix = run.prefix.lower()  # as PostgreSQL reads names

    def name(self, ending: str) -> str:
        return f"{self.prefix}_{ending}"

    def load(self, stack: ExitStack, buildings: Iterable[Sheet], damaged: Damaged) -> int:
        """Load the run; returns its number of buildings."""
        self.cursor.execute("select pg_advisory_xact_lock(%s, hashtext(%s))", (LOCKS, self.prefix))
        self.refuse_other_runs()
        waiting = [
            WaitingRows(table.layer, stack.enter_context(tempfile.TemporaryFile()))  # noqa: SIM115
            for table in POSTGIS_TABLES
        ]
        count = collect_rows(waiting, buildings, damaged)
        if self.run.replace:
            names = ", ".join(self.name(t.ending) for t in reversed(POSTGIS_TABLES))
            self.cursor.execute(f"drop table if exists {names}, {self.name('runs')}")
        for table, rows in zip(POSTGIS_TABLES, waiting, strict=True):
            if rows.is_needed or self.table_exists(table.ending):
                self.fill_table(table, rows)
        self.note_run()
        return count

    def refuse_other_runs(self) -> None:
        """Raise OutputError where tables hold other runs, or this name from elsewhere."""
        if self.run.replace or not self.table_exists("buildings"):
            return
        others = self.list_runs()
        own = (self.run.name, self.run.folder)
        clashing = [other for other in others if other[0] == own[0] and other != own]
        lost = [] if self.run.append else [other for other in others if other != own]
        if not (clashing or lost):
            return
        name, folder = (clashing or lost)[0]
        tables = f"the tables {self.prefix}_*"
        if self.run.append:
            advice = "name this run with --run, or replace all runs with --replace"
        else:
            advice = "pass --replace to replace it, --append to keep both, or another --prefix"
        raise OutputError(
            f"expected {tables} to hold this run or none, got the run {name} of {folder}; {advice}"
        )

    def list_runs(self) -> list[tuple[str, str]]:
        """Return (name, folder) of every run in the tables, None as that of unnoted ones."""
        if not self.table_exists("runs"):
            return [("without a name", "another program")]
        self.cursor.execute(f"select run, folder from {self.name('runs')} order by run")
        return list(self.cursor.fetchall())

    def table_exists(self, ending: str) -> bool:
        self.cursor.execute("select to_regclass(%s) is not null", (self.name(ending),))
        return bool(self.cursor.fetchone()[0])

    def fill_table(self, table: PostgisTable, rows: WaitingRows) -> None:
        """Make the table or the columns that it lacks, and replace this run's rows in it."""
        kinds = rows.kinds(PREFIX)
        # room for a number within PostgreSQL's limit
        cut = (
            (name.encode()[: MOST_NAME_BYTES - 4].decode(errors="ignore") or "column", kind)
            for name, kind in kinds.items()
        )
        columns = name_columns(cut, OWN_COLUMNS)
        if self.table_exists(table.ending):
            columns = self.widen_table(table, columns)
        else:
            self.refuse_too_many(table, len(columns) + len(OWN_COLUMNS))
            self.make_table(table, columns)
        self.copy_rows(table, rows, kinds, columns)

    def make_table(self, table: PostgisTable, columns: dict[str, type]) -> None:
        name, key = self.name(table.ending), ", ".join(table.key)
        defined = "".join(f", {quote(c)} {POSTGRES_TYPES[kind]}" for c, kind in columns.items())
        self.cursor.execute(
            f"create table {name} (run text not null{defined}, "
            f"geom geometry({table.geometry}, {self.run.srid}), primary key (run, {key}))"
        )
        self.cursor.execute(f"create index {name}_geom on {name} using gist (geom)")
        if "type" in columns:
            self.cursor.execute(f"create index {name}_type on {name} (type)")

    def widen_table(self, table: PostgisTable, columns: dict[str, type]) -> dict[str, type]:
        """Remove this run's rows and add missing columns; returns them with the table's types."""
        name = self.name(table.ending)
        self.cursor.execute(f"delete from {name} where run = %s", (self.run.name,))
        self.settle_srid(table, name)
        self.cursor.execute(
            "select attname, format_type(atttypid, null), attisdropped from pg_attribute "
            "where attrelid = %s::regclass and attnum > 0",
            (name,),
        )
        rows = self.cursor.fetchall()
        present = {c: KIND_OF_TYPE.get(t, str) for c, t, dropped in rows if not dropped}
        additions = {c: kind for c, kind in columns.items() if c not in present}
        self.refuse_too_many(table, len(rows) + len(additions))
        changes = [f"add column {quote(c)} {POSTGRES_TYPES[kind]}" for c, kind in additions.items()]
        for c, kind in columns.items():
            common = column_kind({kind, present.get(c, kind)}, "text")
            if c in present and common is not present[c]:
                sql_type = POSTGRES_TYPES[common]
                changes.append(
                    f"alter column {quote(c)} type {sql_type} using {quote(c)}::{sql_type}"
                )
            columns[c] = common
        if changes:
            self.cursor.execute(f"alter table {name} {', '.join(changes)}")
        return columns

    def settle_srid(self, table: PostgisTable, name: str) -> None:
        """Give the run's CRS to an empty table; OutputError for one with runs in another."""
        self.cursor.execute("select Find_SRID(current_schema()::text, %s, 'geom')", (name,))
        (srid,) = self.cursor.fetchone()
        if srid == self.run.srid:
            return
        self.cursor.execute(f"select exists (select from {name})")
        if self.cursor.fetchone()[0]:
            raise OutputError(
                f"expected a run in EPSG:{srid} as those in {name}, got one in "
                f"EPSG:{self.run.srid}; choose another --prefix"
            )
        kind = f"geometry({table.geometry}, {self.run.srid})"
        self.cursor.execute(f"alter table {name} alter column geom type {kind}")

    def refuse_too_many(self, table: PostgisTable, columns: int) -> None:
        if columns > MOST_POSTGRES_COLUMNS:
            raise OutputError(
                f"expected at most {MOST_POSTGRES_COLUMNS} columns in {self.name(table.ending)}, "
                f"which is PostgreSQL's limit, got {columns}; choose another --prefix, or give the "
                "footprints fewer attributes"
            )

    def copy_rows(
        self,
        table: PostgisTable,
        rows: WaitingRows,
        kinds: dict[str, type],
        columns: dict[str, type],
    ) -> None:
        """Send rows, `kinds` their values by name, to the table's `columns` in that order."""
        names = ", ".join(map(quote, ("run", *columns, "geom")))
        with self.cursor.copy(f"copy {self.name(table.ending)} ({names}) from stdin") as copy:
            for batch in rows.batches(dict(zip(kinds, columns.values(), strict=True))):
                for wkb, values in batch:
                    place = None if wkb is None else encode_place(wkb, self.run.srid)
                    copy.write_row((self.run.name, *values, place))

    def note_run(self) -> None:
        """Say in PREFIX_runs which run the tables hold now."""
        name = self.name("runs")
        self.cursor.execute(
            f"create table if not exists {name} (run text primary key, folder text)"
        )
        self.cursor.execute(f"delete from {name} where run = %s", (self.run.name,))
        self.cursor.execute(f"insert into {name} values (%s, %s)", (self.run.name, self.run.folder))


def collect_rows(waiting: list[WaitingRows], buildings: Iterable[Sheet], damaged: Damaged) -> int:
    """Put the rows of all buildings where they wait; returns how many buildings."""
    visited: set[str] = set()
    for sheet in buildings:
        id = plain_text(sheet.building.id)
        if id in visited:
            damaged(InputError(f"expected buildings of different ids, got {id!r:.80} again"))
            continue
        visited.add(id)
        lines = split_lines(database_rows(sheet).to_text())
        for rows in waiting:
            rows.put(lines[rows.layer])
    return len(visited)


def database_rows(sheet: Sheet) -> Rows:
    """Return a building's rows as in the GeoPackage, its solid in place of the outline."""
    building, rows = sheet.building, table_rows(sheet)
    units = sheet.head.units.table
    solid = None if building.built is None else polyhedral_wkb(building.solid, units)
    return rows._replace(buildings=tuple((solid, values) for _, values in rows.buildings))


def polyhedral_wkb(solid: Solid, units: Units) -> bytes:
    """Return the shell as triangles over its own vertices, so that neighbours stay joined."""
    places = np.round(units.from_metres(solid.vertices), 4)
    triangles = np.concatenate(faces_triangles(solid.vertices, solid.faces))
    rows = np.zeros(len(triangles), TRIANGLE_WKB)
    rows["order"], rows["type"], rows["rings"], rows["points"] = 1, WKB_POLYGON_Z, 1, 4
    rows["xyz"] = places[triangles[:, [0, 1, 2, 0]]]
    return struct.pack("<BII", 1, WKB_POLYHEDRAL_Z, len(rows)) + rows.tobytes()


TRIANGLE_WKB = np.dtype(
    [("order", "u1"), ("type", "<u4"), ("rings", "<u4"), ("points", "<u4"), ("xyz", "<f8", (4, 3))]
)


def encode_place(wkb: bytes, srid: int) -> str:
    """Return WKB as little-endian hexadecimal EWKB, polygons in plan as several."""
    order, kind = struct.unpack_from("<BI", wkb)
    if kind == WKB_POLYGON:
        kind, wkb = WKB_MULTIPOLYGON, struct.pack("<BII", 1, WKB_MULTIPOLYGON, 1) + wkb
    return (struct.pack("<BII", order, kind | WKB_HAS_SRID, srid) + wkb[5:]).hex()
