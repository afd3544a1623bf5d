"""The models of a run's folder into the tables of PostGIS."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..evaluate.models import read_models, run_models
from ..evaluate.run import run_record, run_units, way_to_models
from ..formats import FORMATS
from ..read.cityjson import documents, reference_system
from ..read.crs import find_named_units
from ..read.damage import Damaged, refuse
from ..write.attribute_list import OWN, PARTS_LAYER
from ..write.tables.postgis import DatabaseRow, load_rows

PARTS_AT_ONCE = 5000  # rows read of the GeoPackage at once: memory stays small for any city
MOST_SRID = 998_999  # of a reference system of PostGIS


def load_postgis(folder: Path, dsn: str, prefix: str = "hiproof", damaged: Damaged = refuse) -> int:
    """Replace the tables PREFIX_buildings, PREFIX_roofs and PREFIX_parts of the database at `dsn`
    by the models of `folder`.

    Returns the number of buildings loaded. A damaged building is told to `damaged`, which refuses
    the run by default, and left out. Raises InputError for a folder without models, OutputError for
    a database that cannot be written.
    """
    rows = database_rows(folder, damaged)
    srid = find_srid(next(documents(run_models(folder)))[0])
    return load_rows(dsn, rows, part_rows(Path(folder) / FORMATS["gpkg"].file), srid, prefix)


def database_rows(folder: Path, damaged: Damaged = refuse) -> Iterator[DatabaseRow]:
    """Yield the rows of a run's buildings, coordinates in the units of its files; those that are
    damaged, or whose id comes again, are told to `damaged` and left out."""
    path, record = run_models(folder), run_record(folder)
    header, _ = next(documents(path))
    units = way_to_models(record) or find_named_units(reference_system(header), run_units(record))
    models = read_models(path, crs_units=units, damaged=damaged, must_be_valid=True)
    visited: set[str] = set()
    for model in models:
        if model.id in visited:
            damaged(
                InputError(
                    f"expected buildings of different ids in {path}, got {model.id!r:.80} again"
                )
            )
        elif not model.is_damaged:
            visited.add(model.id)
            status, roof_type = (
                model.text(f"{OWN}{name}") or None for name in ("status", "roof_type")
            )
            contents = model.attributes, model.solid, model.part_types, units, model.grade or None
            yield DatabaseRow(model.id, status, roof_type, *contents)


def find_srid(header: dict[str, Any]) -> int:
    """Return the EPSG code of the metadata's reference system; 0 (unknown to PostGIS) without
    one."""
    code = (reference_system(header) or "").rpartition("/")[2]
    return (
        int(code)
        if code.isascii() and code.isdigit() and len(code) < 7 and int(code) <= MOST_SRID
        else 0
    )


def part_rows(path: Path) -> Iterator[list[tuple]]:
    """Yield the rows of the layer `parts` of the GeoPackage at `path`, some at a time; nothing
    where there is none.

    Raises InputError for a file that is no GeoPackage of a run.
    """
    import pyogrio

    if not path.is_file():
        return
    try:
        if "parts" not in pyogrio.list_layers(path)[:, 0]:
            return
        start = 0
        while True:
            subset = read_some(path, start)
            yield subset
            start += len(subset)
            if len(subset) < PARTS_AT_ONCE:
                return
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError, ValueError) as error:
        raise InputError(
            f"expected tables that hiproof wrote at {path}, got: {error}; make them anew with "
            "`hiproof build`, or remove them"
        ) from error


def read_some(path: Path, start: int) -> list[tuple]:
    """Read rows of the layer `parts` from `start` on: values of PARTS_LAYER and the geometry.
    Raises ValueError for others."""
    import pyogrio

    columns = [attribute.name for attribute in PARTS_LAYER]
    meta, _, wkb, result = pyogrio.raw.read(
        path, layer="parts", columns=columns, skip_features=start, max_features=PARTS_AT_ONCE
    )
    by_name = dict(zip(meta["fields"], result, strict=True))
    if missing := [name for name in columns if name not in by_name]:
        raise ValueError(f"no column {missing[0]} in the layer parts")
    for attribute in PARTS_LAYER:
        if (by_name[attribute.name].dtype.kind in "OUS") != (attribute.kind == "text"):
            raise ValueError(
                f"other than {attribute.kind}s in the column {attribute.name} of the layer parts"
            )
    return list(zip(*(by_name[name] for name in columns), wkb, strict=True))
