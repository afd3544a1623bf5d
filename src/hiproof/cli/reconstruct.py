"""`hiproof reconstruct`: the options become a request."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import SettingsError
from ..log import LOGGER, Level, start
from ..settings import Settings
from .options import parse_box, with_settings

SETTINGS_FILE = "hiproof.toml"


@with_settings()
def reconstruct(
    clouds: Annotated[
        list[str],
        typer.Argument(help="point files (LAS, LAZ, COPC, XYZ, CSV, PLY) or folders of them"),
    ],
    out: Annotated[Path, typer.Option(help="folder for the results")],
    footprints: Annotated[
        str | None,
        typer.Option(
            help="building polygons: a file, an address, a PostGIS table, or overture for those of "
            "Overture Maps (extra `parquet`); without them the cloud is split"
        ),
    ] = None,
    layer: Annotated[
        str | None, typer.Option(help="layer of the footprints, where a file has several")
    ] = None,
    where: Annotated[
        str | None, typer.Option(help='SQL condition on the footprints, such as "year < 1950"')
    ] = None,
    bbox: Annotated[
        str | None,
        typer.Option(
            help="only buildings in this box: xmin,ymin,xmax,ymax in the clouds' coordinates"
        ),
    ] = None,
    id_attribute: Annotated[
        str | None, typer.Option(help="footprint attribute that names buildings")
    ] = None,
    terrain: Annotated[
        str | None,
        typer.Option(
            help="terrain model (GeoTIFF; extra `terrain`); else the cloud's ground class"
        ),
    ] = None,
    overrides: Annotated[
        str | None,
        typer.Option(
            help="what is known better of some buildings (JSONL or a table); the fit obeys it"
        ),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            help="settings file, see `hiproof settings` (default: hiproof.toml beside the data)"
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(help="processes on this machine (default: as many as pay, a core each)"),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="address of a Dask scheduler (extra `city`)")
    ] = None,
    restart: Annotated[
        bool, typer.Option("--restart", help="begin anew in a folder that holds another run")
    ] = False,
    log_file: Annotated[
        Path | None, typer.Option(help="keep the log from progress on here, added at the end")
    ] = None,
    log_level: Annotated[
        Level, typer.Option(help="what of the log to show; debug also in the file")
    ] = Level.warning,
    changes: dict[str, dict[str, Any]] | None = None,
) -> None:
    """Reconstruct the buildings of point clouds into CityGML, CityJSON, parameters and attributes.

    Exit code: 0 all buildings were modelled or explained by their data, 1 an internal error, 2
    unusable input.
    """
    from ..city.request import Request
    from ..read.pointcloud import expand_paths
    from .running import run_request

    start(log_level, log_file)
    box = None if bbox is None else parse_box(bbox)
    config = config or find_settings_file(*clouds, footprints)
    request = Request(
        clouds=tuple(map(str, expand_paths(tuple(clouds)))),
        out=out,
        footprints=footprints,
        layer=layer,
        where=where,
        bbox=box,
        id_attribute=id_attribute,
        terrain=terrain,
        overrides=overrides,
        settings=(Settings.from_toml(config) if config else Settings()).replace(changes or {}),
        processes=jobs,
        scheduler=scheduler,
        restart=restart,
    )
    raise typer.Exit(run_request(request))


def find_settings_file(*inputs: str | None) -> Path | None:
    """The settings file in the folder of any input, which the log names; None where there is none.

    Raises SettingsError where there are two: which of them counts is not to be guessed.
    """
    from ..read.overture import is_overture

    named = [name for name in inputs if name and "://" not in name and not is_overture(name)]
    paths = [Path(name) for name in named]
    folders = dict.fromkeys((path if path.is_dir() else path.parent).absolute() for path in paths)
    result = [folder / SETTINGS_FILE for folder in folders if (folder / SETTINGS_FILE).is_file()]
    if len(result) > 1:
        names = ", ".join(map(str, result))
        raise SettingsError(
            f"expected one {SETTINGS_FILE} beside the data, got {names}; name one with --config"
        )
    if result:
        LOGGER.warning("settings are those of %s; name others with --config", result[0])
    return result[0] if result else None
