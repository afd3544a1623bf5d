"""Checks of a request before any file is read.

What is wrong is reported at once, and not after an hour.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ...errors import InputError, SettingsError
from ...formats import list_requested_files
from ...settings import Settings, format_value
from ...stages.arguments import refuse_without_network
from ...write.files import refuse_overwriting

MOST_PROCESSES = 1024  # processes; more is a slip of the hand, and would fill any machine's memory


def refuse_unusable(request: Any) -> None:
    """Raise SettingsError or InputError for options of a `run.Request` that cannot be met."""
    processes = request.processes
    if processes is not None and not (type(processes) is int and 1 <= processes <= MOST_PROCESSES):
        raise SettingsError(
            f"expected --jobs between 1 and {MOST_PROCESSES}, got {format_value(processes)}; a "
            "process a core is enough, as it is without this option"
        )
    for name in ("layer", "where", "id_attribute", "use_attribute"):
        if getattr(request, name) is not None and request.footprints is None:
            option = "--" + name.replace("_", "-")
            raise SettingsError(
                f"expected footprints with {option}, got none; name them with --footprints"
            )
    refuse_settings(request.settings)
    out = Path(request.out)
    outputs = [*list_requested_files(request.settings, out).values(), out / "run.json"]
    refuse_overwriting(outputs, list_inputs(request))
    refuse_missing_packages(request)


def refuse_missing_use(attributes: Iterable[str], name: str | None) -> None:
    """Raise InputError for an attribute of the use that is none of the buildings' `attributes`."""
    names = list(dict.fromkeys(attributes))
    if name and name not in names:
        raise InputError(
            f"expected an attribute of the buildings ({', '.join(names) or 'none'}) as "
            f"--use-attribute, got {name!r}; name one of these"
        )


def list_inputs(request: Any) -> list[str]:
    """Return the files that a request names, that of overrides included."""
    fields = [f.name for f in dataclasses.fields(request) if f.metadata.get("names") == "files"]
    values = [getattr(request, name) for name in (*fields, "overrides")]
    lists = (value if isinstance(value, tuple) else (value,) for value in values)
    return [str(path) for paths in lists for path in paths if path]


def refuse_missing_packages(request: Any) -> None:
    """Raise InputError where a package is missing that this request needs.

    Most requests do not need it.
    """
    from ...read.outlines import geoparquet
    from ...read.outlines.database import import_psycopg, is_database
    from ...read.outlines.geoparquet import is_parquet
    from ...read.outlines.overture import is_overture
    from ...read.remote import import_fsspec, is_url

    if request.scheduler:
        from ..work.executors import import_distributed

        import_distributed()
    if any(map(is_url, request.clouds)):
        import_fsspec()
    if is_database(request.footprints):
        import_psycopg()
    if request.terrain:
        from ...read.terrain.raster import import_rasterio

        import_rasterio()
    if is_overture(request.footprints) or is_parquet(request.footprints or ""):
        geoparquet.import_pyarrow()
        if is_overture(request.footprints) or is_url(request.footprints):
            geoparquet.import_fsspec()
    if request.settings.write.parquet:
        geoparquet.import_pyarrow()


def refuse_settings(settings: Settings) -> None:
    """Raise SettingsError or InputError for well-formed values that cannot be used."""
    from ...read.crs import find_units, parse_crs

    refuse_unknown_types(settings.fit)
    try:
        find_units(parse_crs(settings.read.crs), "the point clouds", settings.read.unit)
    except InputError as error:  # the clouds' CRS is unknown, not projected, or of another unit
        raise SettingsError(str(error)) from error
    refuse_without_network(settings)
    segment = settings.segment
    if segment.network != "never" and (segment.weights or segment.device != "cpu"):
        from ...segment.inference import SHIPPED_WEIGHTS, load

        load(segment.weights or str(SHIPPED_WEIGHTS), segment.device)


def refuse_unknown_types(fit: Any) -> None:
    """Raise SettingsError for roof types outside the catalogue."""
    from ...primitives import CATALOGUE

    allowed = tuple(CATALOGUE)
    unknown = [name for name in fit.types if name not in allowed]
    if unknown:
        import difflib

        got = []
        for name in unknown:
            nearby = difflib.get_close_matches(name.lower(), allowed, n=1, cutoff=0.5)
            got.append(" ".join([format_value(name), *(f"(did you mean {k}?)" for k in nearby)]))
        raise SettingsError(f"expected roof types among {', '.join(allowed)}, got {', '.join(got)}")
