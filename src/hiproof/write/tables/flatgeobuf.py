"""buildings.fgb: the outlines with all attributes as FlatGeobuf.

Web maps read it by parts.
"""

from __future__ import annotations

import os
import warnings
from typing import Any

import numpy as np

from ...errors import OutputError
from .geopackage import BUILDINGS, AttributesWriter
from .waiting import column_names


class FlatGeobufWriter(AttributesWriter):
    """Incremental writer of the rows of the GeoPackage's buildings.

    Those without an outline are left out, since a spatial index cannot hold them. All rows are in
    memory at the end.
    """

    layers = (BUILDINGS,)

    def finish(self) -> None:
        import pyogrio

        (waiting,) = self.waiting.values()
        kinds = waiting.kinds(self.head.prefix)
        rows = [row for batch in waiting.batches() for row in batch if row[0]]
        columns = [column([values.get(name) for _, values in rows], kinds[name]) for name in kinds]
        try:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "'crs' was not provided")
                pyogrio.raw.write(
                    self.hidden,
                    objects([wkb for wkb, _ in rows]),
                    [values for values, _ in columns],
                    column_names(kinds),
                    [mask for _, mask in columns],
                    layer=BUILDINGS,
                    driver="FlatGeobuf",
                    geometry_type="MultiPolygon",
                    promote_to_multi=True,
                    crs=self.plan_wkt,
                )
        except (pyogrio.errors.DataSourceError, RuntimeError, OSError) as error:
            raise OutputError(
                f"expected to write {os.fspath(self.path)}, got: {error}; check the permissions "
                "and the space left"
            ) from error


writer = FlatGeobufWriter


def column(values: list[Any], kind: type) -> tuple[np.ndarray, np.ndarray]:
    """Return values (n,) of one type, and where they are unknown (n,)."""
    mask = np.array([value is None for value in values], dtype=bool)
    if kind is str:
        return objects([None if v is None else str(v) for v in values]), mask
    dtype = {bool: np.bool_, int: np.int64, float: np.float64}[kind]
    return np.array([kind(0) if v is None else kind(v) for v in values], dtype=dtype), mask


def objects(values: list[Any]) -> np.ndarray:
    """Return an array (n,) of the values themselves, whatever their types."""
    array = np.empty(len(values), dtype=object)
    array[:] = values
    return array
