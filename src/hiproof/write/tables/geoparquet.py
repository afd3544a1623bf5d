"""GeoParquet 1.0 of buildings, parts and surfaces for data frames (needs pyarrow)."""

from __future__ import annotations

import json
import os
from typing import Any

from ...read.outlines.geoparquet import import_pyarrow
from ..head import FileHead
from .geopackage import BUILDINGS, AttributesWriter
from .vector_layer import name_columns

GEOMETRY = "geometry"
PLAN_TYPES = ["Polygon", "MultiPolygon"]
GEOMETRY_TYPES = {BUILDINGS: PLAN_TYPES, "parts": PLAN_TYPES, "roof_surfaces": ["Polygon Z"]}


class GeoParquetWriter(AttributesWriter):
    """Writer of the rows of the GeoPackage's `layer`; raises InputError without pyarrow."""

    reserved = (*AttributesWriter.reserved, GEOMETRY)

    def __init__(self, path: str | os.PathLike, head: FileHead, layer: str = BUILDINGS) -> None:
        import_pyarrow()
        super().__init__(path, head)
        self.layers = (layer,)

    def finish(self) -> None:
        import pyarrow.parquet

        (waiting,) = self.waiting.values()
        kinds = waiting.kinds(self.head.prefix)
        schema = self.schema(kinds)
        with pyarrow.parquet.ParquetWriter(self.hidden, schema, compression="zstd") as file:
            for rows in waiting.batches(kinds):
                columns = zip(*([*values, wkb] for wkb, values in rows), strict=True)
                values = [list(column) for column in columns] or [[] for _ in schema]
                file.write_table(pyarrow.table(values, schema=schema))

    def schema(self, kinds: dict[str, type]) -> Any:
        """Return Arrow's schema of `kinds` and the geometry, which GeoParquet describes."""
        import pyarrow
        from pyproj import CRS

        types = {
            bool: pyarrow.bool_(),
            int: pyarrow.int64(),
            float: pyarrow.float64(),
            str: pyarrow.string(),
        }
        columns = name_columns(kinds.items(), self.reserved)
        fields = [pyarrow.field(name, types[kind]) for name, kind in columns.items()]
        crs = None if self.plan_wkt is None else CRS.from_wkt(self.plan_wkt).to_json_dict()
        geometry = {"encoding": "WKB", "geometry_types": GEOMETRY_TYPES[self.layers[0]], "crs": crs}
        geo = {"version": "1.0.0", "primary_column": GEOMETRY, "columns": {GEOMETRY: geometry}}
        return pyarrow.schema(
            [*fields, pyarrow.field(GEOMETRY, pyarrow.binary())], {"geo": json.dumps(geo)}
        )


writer = GeoParquetWriter
