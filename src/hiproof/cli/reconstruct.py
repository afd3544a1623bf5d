"""`hiproof reconstruct`: the options become a request."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path
from typing import Annotated, Any

import click

from ..errors import SettingsError
from ..log import LOGGER, console_level, start
from ..settings import EnrichSettings, Settings
from .command import print_every_option
from .enrich import enrich_folder, with_terrain
from .options import parse_box, with_settings
from .parameters import Argument, Option

SETTINGS_FILE = "hiproof.toml"
FURTHER = "Further options"  # heading of those that fewer people need


@with_settings()
def reconstruct(
    out: Annotated[Path, Option(help="folder for the results")],
    clouds: Annotated[
        list[str] | None,
        Argument(help="point files (LAS, LAZ, COPC, XYZ, CSV, PLY) or folders of them"),
    ] = None,
    epoch: Annotated[
        list[str] | None,
        Option(
            help="instead of clouds, the clouds of several surveys: --epoch 2014=a/ --epoch "
            "2020=b/; each building is made of the newest that covers it, and of others that show "
            "the same roof",
            heading=FURTHER,
        ),
    ] = None,
    footprints: Annotated[
        str | None,
        Option(
            help="building polygons: a file, an address, a PostGIS table, or overture for those of "
            "Overture Maps (extra `parquet`); without this option hiproof finds the buildings"
        ),
    ] = None,
    layer: Annotated[
        str | None,
        Option(help="layer of the footprints, where a file has several", heading=FURTHER),
    ] = None,
    where: Annotated[
        str | None,
        Option(help='SQL condition on the footprints, such as "year < 1950"', heading=FURTHER),
    ] = None,
    bbox: Annotated[
        str | None,
        Option(
            help="model only buildings in this box: xmin,ymin,xmax,ymax in the coordinates of the "
            "clouds"
        ),
    ] = None,
    id_attribute: Annotated[
        str | None, Option(help="footprint attribute that holds the buildings' ids")
    ] = None,
    terrain: Annotated[
        str | None,
        Option(
            help="terrain model, a GeoTIFF (extra `terrain`); without it hiproof takes the "
            "ground points of the clouds"
        ),
    ] = None,
    overrides: Annotated[
        str | None,
        Option(
            help="values that you know of some buildings (JSONL or a table); hiproof keeps them "
            "and fits the rest"
        ),
    ] = None,
    underpasses: Annotated[
        str | None,
        Option(
            help="polygons of passages below buildings, a file or an address, with their "
            "clearance in a column (--clearance-column)",
            heading=FURTHER,
        ),
    ] = None,
    config: Annotated[
        Path | None,
        Option(
            help="settings file, see `hiproof settings` (default: hiproof.toml next to the data)",
            heading=FURTHER,
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        Option(
            help="number of worker processes (default: up to one per core, fewer for a small run)"
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        Option(help="address of a Dask scheduler (extra `city`)", heading=FURTHER),
    ] = None,
    restart: Annotated[
        bool, Option(name="--restart", help="discard an earlier run in this folder")
    ] = False,
    enrich: Annotated[
        bool,
        Option(
            name="--enrich",
            help="also add party walls, house types and more, as `hiproof enrich` does",
        ),
    ] = False,
    log_file: Annotated[
        Path | None, Option(help="append the log to this file", heading=FURTHER)
    ] = None,
    help_all: Annotated[
        bool,
        Option(
            name="--help-all",
            is_eager=True,
            callback=print_every_option,
            help="show all options, in groups",
        ),
    ] = False,
    changes: dict[str, dict[str, Any]] | None = None,
) -> None:
    """Model the buildings of point clouds as CityGML, CityJSON, parameters and tables.

    Run the same command again to resume an interrupted run.

    Exit code: 0 every building has a model or a reason why not, 1 an internal error, 2 unusable
    input.
    """
    from .running import run_request

    start(console_level(), log_file)
    box = None if bbox is None else parse_box(bbox)
    if jobs and jobs > 1 and not scheduler:
        from ..city.work.workers import start_server

        start_server()  # so that workers need not wait for imports
    if not enrich and "enrich" in (changes or {}):
        raise SettingsError("expected --enrich with options of `hiproof enrich`, got none; add it")

    @functools.cache
    def read_settings() -> Settings:
        paths = [text.partition("=")[2] for text in epoch or ()]
        file = config or find_settings_file(*(clouds or ()), *paths, footprints)
        return (Settings.from_toml(file) if file else Settings()).replace(changes or {})

    def make_request() -> Any:
        from ..city.request import Request
        from ..update.named import choose_clouds

        found, epochs = choose_clouds(clouds or (), epoch or ())
        settings = read_settings()
        if enrich:
            refuse_before(settings)
        return Request(
            clouds=found,
            epochs=epochs,
            out=out,
            footprints=footprints,
            layer=layer,
            where=where,
            bbox=box,
            id_attribute=id_attribute,
            terrain=terrain,
            overrides=overrides,
            underpasses=underpasses,
            # answers change no model, so that other answers resume the same run
            settings=dataclasses.replace(settings, enrich=EnrichSettings()),
            processes=jobs,
            scheduler=scheduler,
            restart=restart,
        )

    code = run_request(make_request)
    if enrich:
        answers = read_settings().enrich
        answers = with_terrain(answers, terrain if answers.sun else None)
        code = enrich_folder(out, None, answers, jobs) or code
    raise click.exceptions.Exit(code)


def refuse_before(settings: Settings) -> None:
    """Raise InputError before a run for what would end `hiproof enrich` after it."""
    from ..enrich.cadastre import refuse_unusable
    from ..enrich.energy import refuse_other_citygml

    refuse_unusable(settings.enrich)
    refuse_other_citygml(settings)


def find_settings_file(*inputs: str | None) -> Path | None:
    """Return the settings file in the folder of any input, None without one.

    The log names it.

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
