"""`hiproof footprints`: building footprints of the clouds' extent, kept as a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..errors import SettingsError
from ..progress import show_progress


def footprints(
    clouds: list[str],
    *,
    out: Path,
    layer: str | None = None,
    crs: str | None = None,
    config: Path | None = None,
) -> None:
    """Fetch building footprints from Overture Maps (extra `parquet`).

    The file holds all footprints in the extent of the clouds. Pass it to `hiproof reconstruct
    --footprints`, which then needs no network connection.
    """
    if out.suffix.lower() != ".gpkg":
        raise SettingsError(f"expected --out to name a GeoPackage such as f.gpkg, got {out}")
    with show_progress("fetch"):
        note = fetch_footprints(clouds, out, layer, crs, config)
    sources = ", ".join(source["dataset"] for source in note["sources"])
    click.echo(
        f"{out}: {note['footprints']:,} footprints of {note['name']} {note['release']} "
        f"({note['licence']}; from {sources or 'unnamed sources'}). Attribute them as "
        f"{note['attribution']}."
    )


def fetch_footprints(
    clouds: list[str], out: Path, layer: str | None, crs: str | None, config: Path | None
) -> dict[str, Any]:
    """Write the footprints of the clouds' extent to `out`; returns their source."""
    from ..city.plan.from_overture import keep_footprints
    from ..city.plan.prepare import read_headers
    from ..city.request import Request
    from ..read.points.pointcloud import expand_paths
    from ..settings import Settings
    from ..write.files import refuse_overwriting, refuse_run_file
    from .reconstruct import find_settings_file

    config = config or find_settings_file(*clouds)
    settings = Settings.from_toml(config) if config else Settings()
    files = tuple(map(str, expand_paths(tuple(clouds))))
    refuse_overwriting([out], files)
    refuse_run_file(out)
    request = Request(
        files, out, layer=layer, settings=settings.replace({"read": {"crs": crs}} if crs else {})
    )
    return keep_footprints(request, read_headers(files), out)
