"""A GeoPackage 1.2 file (OGC 12-128r14), written by the standard library's SQLite.

A file holds tables of features with a spatial index each, and plain tables. GDAL would write the
same, but takes 30 MB of memory and a tenth of a second to load.
"""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Iterable, Sequence
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
import shapely
from pyproj import CRS
from pyproj.exceptions import CRSError

from ...read.crs import epsg_code, parse_crs
from ...read.sql import quote

# GeoPackage notes when a table last changed; a fixed date keeps the same input giving the same
# file.
FIXED_DATE = "2000-01-01T00:00:00.000Z"
SQL_TYPES = {bool: "BOOLEAN", int: "INTEGER", float: "REAL", str: "TEXT"}
# ids that the standard gives an unknown plane, and that GDAL gives a CRS without an EPSG code
UNDEFINED_SRS, CUSTOM_SRS = -1, 100_000
# "GP", version 0, the flags, the id of the CRS, and the envelope (xmin, xmax, ymin, ymax)
BLOB_HEADER = struct.Struct("<2sBBi4d")
BLOB_FLAGS = 0b0000_0011  # bits: an envelope in plan follows, and numbers are little endian

FILE_SCHEMA = """
PRAGMA journal_mode = OFF;  -- the file is seen once it is whole
PRAGMA synchronous = OFF;
PRAGMA application_id = 0x47504B47;  -- "GPKG"
PRAGMA user_version = 10200;
BEGIN;
CREATE TABLE gpkg_spatial_ref_sys (
  srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY, organization TEXT NOT NULL,
  organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL, description TEXT);
CREATE TABLE gpkg_contents (
  table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
  description TEXT DEFAULT '',
  last_change DATETIME NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')),
  min_x DOUBLE, min_y DOUBLE, max_x DOUBLE, max_y DOUBLE, srs_id INTEGER,
  CONSTRAINT fk_gc_r_srs_id FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (
  table_name TEXT NOT NULL, column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL,
  srs_id INTEGER NOT NULL, z TINYINT NOT NULL, m TINYINT NOT NULL,
  CONSTRAINT pk_geom_cols PRIMARY KEY (table_name, column_name),
  CONSTRAINT uk_gc_table_name UNIQUE (table_name),
  CONSTRAINT fk_gc_tn FOREIGN KEY (table_name) REFERENCES gpkg_contents(table_name),
  CONSTRAINT fk_gc_srs FOREIGN KEY (srs_id) REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_extensions (
  table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL, definition TEXT NOT NULL,
  scope TEXT NOT NULL, CONSTRAINT ge_tce UNIQUE (table_name, column_name, extension_name));
"""

INDEX_TRIGGERS = """
CREATE TRIGGER "rtree_{table}_geom_insert" AFTER INSERT ON "{table}"
  WHEN (NEW.geom NOT NULL AND NOT ST_IsEmpty(NEW.geom))
  BEGIN {insert}; END;
CREATE TRIGGER "rtree_{table}_geom_update1" AFTER UPDATE OF geom ON "{table}"
  WHEN OLD.fid = NEW.fid AND (NEW.geom NOT NULL AND NOT ST_IsEmpty(NEW.geom))
  BEGIN {insert}; END;
CREATE TRIGGER "rtree_{table}_geom_update2" AFTER UPDATE OF geom ON "{table}"
  WHEN OLD.fid = NEW.fid AND (NEW.geom ISNULL OR ST_IsEmpty(NEW.geom))
  BEGIN {delete}; END;
CREATE TRIGGER "rtree_{table}_geom_update3" AFTER UPDATE ON "{table}"
  WHEN OLD.fid != NEW.fid AND (NEW.geom NOT NULL AND NOT ST_IsEmpty(NEW.geom))
  BEGIN {delete}; {insert}; END;
CREATE TRIGGER "rtree_{table}_geom_update4" AFTER UPDATE ON "{table}"
  WHEN OLD.fid != NEW.fid AND (NEW.geom ISNULL OR ST_IsEmpty(NEW.geom))
  BEGIN DELETE FROM "rtree_{table}_geom" WHERE id IN (OLD.fid, NEW.fid); END;
CREATE TRIGGER "rtree_{table}_geom_delete" AFTER DELETE ON "{table}"
  WHEN OLD.geom NOT NULL
  BEGIN {delete}; END;
"""
"""Keep the index of a table up to date where another program edits it, as the standard asks for.

The functions ST_... are that program's; SQLite alone has none.
"""

INSERT_BOX = (
    'INSERT OR REPLACE INTO "rtree_{table}_geom" VALUES (NEW.fid, ST_MinX(NEW.geom), '
    "ST_MaxX(NEW.geom), ST_MinY(NEW.geom), ST_MaxY(NEW.geom))"
)
DELETE_BOX = 'DELETE FROM "rtree_{table}_geom" WHERE id = OLD.fid'


class GeometryType(NamedTuple):
    """The geometry of a table's features, with heights or without.

    It is `MULTIPOLYGON` or `POLYGON`.
    """

    name: str
    has_z: bool = False


class GeoPackage:
    """A new GeoPackage at `path`, in the plan CRS `wkt` (None: unknown).

    Call `close` at the end. Methods raise sqlite3.Error where the file cannot be written.
    """

    def __init__(self, path: str | PathLike, wkt: str | None) -> None:
        self.database = sqlite3.connect(path, isolation_level=None)
        self.types: dict[str, str] = {}
        self.boxes: dict[str, np.ndarray] = {}
        self.database.executescript(FILE_SCHEMA)
        self.srs_id = self.add_reference_systems(wkt)

    def add_reference_systems(self, wkt: str | None) -> int:
        """Add the CRSs that every file has, and that of the features.

        Returns the id of the latter.
        """
        undefined = "undefined {} coordinate reference system"
        rows = [
            ("Undefined Cartesian SRS", -1, "NONE", -1, "undefined", undefined.format("Cartesian")),
            ("Undefined geographic SRS", 0, "NONE", 0, "undefined", undefined.format("geographic")),
            describe_reference_system("EPSG:4326"),
        ]
        if wkt is not None and (own_row := describe_reference_system(wkt)) != rows[-1]:
            rows.append(own_row)
        self.insert("gpkg_spatial_ref_sys", rows)
        return UNDEFINED_SRS if wkt is None else int(rows[-1][1])

    def create_table(
        self, table: str, columns: dict[str, type], geometry: GeometryType | None, key: str = "fid"
    ) -> None:
        """Create a table of features, or a plain one where they have no `geometry`."""
        geometry_column = [] if geometry is None else [f"geom {geometry.name}"]
        own_columns = [f"{quote(name)} {SQL_TYPES[kind]}" for name, kind in columns.items()]
        key_column = f"{key} INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL"
        definitions = ", ".join([key_column, *geometry_column, *own_columns])
        self.database.execute(f"CREATE TABLE {quote(table)} ({definitions})")
        kind, srs_id = ("attributes", 0) if geometry is None else ("features", self.srs_id)
        box = (None,) * 4  # until the rows are there
        self.insert("gpkg_contents", [(table, kind, table, "", FIXED_DATE, *box, srs_id)])
        if geometry is not None:
            flags = int(geometry.has_z), 0
            self.insert(
                "gpkg_geometry_columns", [(table, "geom", geometry.name, self.srs_id, *flags)]
            )
            self.types[table] = geometry.name
            self.create_index(table)

    def create_index(self, table: str) -> None:
        """Create the empty spatial index of a table."""
        self.database.execute(
            f'CREATE VIRTUAL TABLE "rtree_{table}_geom" USING rtree(id, minx, maxx, miny, maxy)'
        )
        definition = "http://www.geopackage.org/spec120/#extension_rtree"
        self.insert(
            "gpkg_extensions", [(table, "geom", "gpkg_rtree_index", definition, "write-only")]
        )
        self.boxes[table] = np.array([np.inf, np.inf, -np.inf, -np.inf])

    def insert_features(
        self, table: str, first: int, wkb: Sequence[bytes | None], rows: Iterable[tuple]
    ) -> None:
        """Insert features with numbers from `first` on, geometries as WKB."""
        geometries = shapely.from_wkb(np.array(wkb, dtype=object))
        if self.types[table] == "MULTIPOLYGON":
            geometries = promote_to_multi(geometries)
        bounds = shapely.bounds(geometries)
        blobs = encode_blobs(geometries, bounds, self.srs_id)
        numbers = range(first, first + len(blobs))
        self.insert(
            table, [(n, blob, *row) for n, blob, row in zip(numbers, blobs, rows, strict=True)]
        )
        boxes = [
            (n, *box)
            for n, box in zip(numbers, bounds[:, [0, 2, 1, 3]].tolist(), strict=True)
            if wkb[n - first] is not None
        ]
        self.insert(f"rtree_{table}_geom", boxes)
        if boxes:
            whole = self.boxes[table]
            np.fmin(whole[:2], np.nanmin(bounds[:, :2], axis=0), out=whole[:2])
            np.fmax(whole[2:], np.nanmax(bounds[:, 2:], axis=0), out=whole[2:])

    def insert(self, table: str, rows: Sequence[tuple]) -> None:
        """Insert whole rows into a table."""
        if rows:
            places = ", ".join("?" * len(rows[0]))
            self.database.executemany(f"INSERT INTO {quote(table)} VALUES ({places})", rows)

    def finish(self) -> None:
        """Note the extent of each table, and let its index follow what others edit."""
        for table, box in self.boxes.items():
            if np.isfinite(box).all():
                self.database.execute(
                    "UPDATE gpkg_contents SET min_x = ?, min_y = ?, max_x = ?, max_y = ? "
                    "WHERE table_name = ?",
                    (*box.tolist(), table),
                )
        triggers = "".join(map(format_triggers, self.boxes))
        self.database.executescript(f"BEGIN; {triggers} COMMIT;")  # which ends what began before

    def close(self) -> None:
        self.database.close()


def format_triggers(table: str) -> str:
    """Return the triggers of a table's index."""
    insert, delete = (text.format(table=table) for text in (INSERT_BOX, DELETE_BOX))
    return INDEX_TRIGGERS.format(table=table, insert=insert, delete=delete)


def describe_reference_system(crs: Any) -> tuple[str, int, str, int, str, str]:
    """Return the row of a plan CRS in `gpkg_spatial_ref_sys`.

    Its second value is its id.
    """
    crs = parse_crs(crs)
    code = epsg_code(crs)
    organization, number = ("NONE", CUSTOM_SRS) if code is None else ("EPSG", code)
    return crs.name, number, organization, number, format_wkt(crs), ""


def format_wkt(crs: CRS) -> str:
    """Return the definition in the first version of WKT, as the standard asks.

    It is in the second where the first cannot express it.
    """
    try:
        return crs.to_wkt("WKT1_GDAL")
    except CRSError:
        return crs.to_wkt()


def promote_to_multi(geometries: np.ndarray) -> np.ndarray:
    """Make a multipolygon of each polygon among `geometries` (n,)."""
    result = geometries.copy()
    polygons = np.flatnonzero(shapely.get_type_id(geometries) == shapely.GeometryType.POLYGON)
    if len(polygons):
        result[polygons] = shapely.multipolygons(
            geometries[polygons], indices=np.arange(len(polygons))
        )
    return result


def encode_blobs(geometries: np.ndarray, bounds: np.ndarray, srs_id: int) -> list[bytes | None]:
    """Encode geometries (n,) with their bounds (n, 4) for a GeoPackage.

    They become a header, then ISO WKB.
    """
    envelopes = bounds[:, [0, 2, 1, 3]].tolist()
    return [
        wkb and BLOB_HEADER.pack(b"GP", 0, BLOB_FLAGS, srs_id, *envelope) + wkb
        for wkb, envelope in zip(
            shapely.to_wkb(geometries, flavor="iso").tolist(), envelopes, strict=True
        )
    ]
