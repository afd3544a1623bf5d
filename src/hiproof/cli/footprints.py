"""`hiproof footprints`: building footprints of the clouds' extent, kept as a file."""

from __future__ import annotations

from pathlib import Path

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
        from ..city.plan.from_overture import keep_footprints
        from ..city.plan.prepare import read_headers
        from ..city.request import Request
        from ..read.points.pointcloud import expand_paths
        from ..settings import Settings
        from ..write.files import refuse_replacing
        from .reconstruct import find_settings_file

        config = config or find_settings_file(*clouds)
        settings = Settings.from_toml(config) if config else Settings()
        files = tuple(map(str, expand_paths(tuple(clouds))))
        refuse_replacing([out], files)
        settings = settings.replace({"read": {"crs": crs}} if crs else {})
        request = Request(files, out, layer=layer, settings=settings)
        note = keep_footprints(request, read_headers(files), out)
    sources = ", ".join(source["dataset"] for source in note["sources"])
    click.echo(
        f"{out}: {note['footprints']:,} footprints of {note['name']} {note['release']} "
        f"({note['licence']}; from {sources or 'unnamed sources'}). Attribute them as "
        f"{note['attribution']}."
    )
