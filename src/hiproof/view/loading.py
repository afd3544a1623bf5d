"""The models of a run into the tables of PostGIS."""

from __future__ import annotations

from pathlib import Path

from ..parametric.finished import open_run
from ..read.models.damage import Damaged, refuse
from ..write.naming import reference_system
from ..write.tables.postgis import Load, load_tables

MOST_SRID = 998_999  # of a reference system of PostGIS


def load_postgis(
    folder: Path,
    dsn: str,
    prefix: str = "hiproof",
    damaged: Damaged = refuse,
    name: str | None = None,
    **how: bool,
) -> int:
    """Replace a prefix's tables in a database by the models of `folder`.

    They are PREFIX_buildings, PREFIX_roofs and PREFIX_parts of the database at `dsn`. `name` is
    that of the run in the tables, its folder's by default; `how` is `replace` or `append` (see
    Load). A damaged building is told to `damaged`, which refuses the run by default, and left out.
    Raises InputError for a folder without models, OutputError for a database that cannot be written
    or holds another run.
    """
    run, place = open_run(folder), Path(folder).resolve()
    code = (reference_system(run.head.crs_of_files) or "").rpartition("/")[2]
    srid = int(code) if code.isdigit() and int(code) <= MOST_SRID else 0
    loaded = Load(name or place.name, str(place), prefix, srid, **how)
    return load_tables(dsn, run.describe(damaged), run.head.units, loaded, damaged)
