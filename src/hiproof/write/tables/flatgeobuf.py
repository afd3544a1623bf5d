"""buildings.fgb: outlines with all attributes as FlatGeobuf, which web maps read by parts."""

from __future__ import annotations

from .geopackage import BUILDINGS, AttributesWriter
from .vector_layer import name_columns, translate_write_errors, write_layer


class FlatGeobufWriter(AttributesWriter):
    """Incremental writer of the GeoPackage's buildings that have an outline.

    A spatial index cannot hold the others. All rows are in memory at the end.
    """

    layers = (BUILDINGS,)

    def finish(self) -> None:
        (waiting,) = self.waiting.values()
        kinds = waiting.kinds(self.head.prefix)
        rows = [row for batch in waiting.batches(kinds) for row in batch if row[0]]
        with translate_write_errors(self.path):
            write_layer(
                self.hidden,
                BUILDINGS,
                name_columns(kinds.items()),
                [values for _, values in rows],
                [wkb for wkb, _ in rows],
                driver="FlatGeobuf",
                geometry_type="MultiPolygon",
                promote_to_multi=True,
                crs=self.plan_wkt,
            )


writer = FlatGeobufWriter
