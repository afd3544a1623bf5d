"""`hiproof reconstruct`: the options become a request."""

from __future__ import annotations

import dataclasses
import functools
from pathlib import Path
from typing import Any

from ..errors import SettingsError
from ..log import LOGGER, console_level, start
from ..settings import Changes, EnrichSettings, Settings, format_value
from .enrich import enrich_folder, with_terrain

SETTINGS_FILE = "hiproof.toml"


def reconstruct(
    clouds: list[str] | None = None,
    *,
    out: Path,
    epoch: list[str] | None = None,
    footprints: str | None = None,
    layer: str | None = None,
    where: str | None = None,
    bbox: str | None = None,
    id_attribute: str | None = None,
    terrain: str | None = None,
    overrides: str | None = None,
    underpasses: str | None = None,
    config: Path | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    restart: bool = False,
    enrich: bool = False,
    log_file: Path | None = None,
    changes: Changes | None = None,
) -> int:
    """Model the buildings of point clouds as CityGML, CityJSON, parameters and tables.

    Run the same command again to resume an interrupted run. Exit code: 0 every building has a model
    or a reason why not, 1 an internal error, 2 unusable input.
    """
    from .running import run_request

    if log_file is not None:
        from ..write.files import refuse_replacing

        given = [*(clouds or ()), footprints, terrain, overrides, underpasses, config]
        refuse_replacing([log_file], given)
    start(console_level(), log_file)
    box = None if bbox is None else parse_box(bbox)
    refuse_lone_options(epoch, enrich, changes or {})

    @functools.cache
    def read_settings() -> Settings:
        paths = [text.partition("=")[2] for text in epoch or ()]
        file = config or find_settings_file(*(clouds or ()), *paths, footprints)
        return (Settings.from_toml(file) if file else Settings()).replace(changes or {})

    def make_request() -> Any:
        from ..city.request import Request
        from ..update.dates import choose_clouds

        found, epochs = choose_clouds(clouds or (), epoch or ())
        settings = read_settings()
        if enrich:  # what would end it after the run is refused before
            from ..enrich.cadastre import refuse_unusable
            from ..enrich.energy import refuse_other_citygml

            refuse_unusable(settings.enrich)
            refuse_other_citygml(settings)
        return Request(
            clouds=found,
            epochs=epochs,
            use_attribute=settings.enrich.use_attribute or None if enrich else None,
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
    return code


def refuse_lone_options(epoch: list[str] | None, enrich: bool, changes: Changes) -> None:
    """Raise SettingsError for options that mean something beside others alone."""
    if not enrich and "enrich" in changes:
        raise SettingsError("expected --enrich with options of `hiproof enrich`, got none; add it")
    if not epoch and "shift" in changes.get("read", {}):
        raise SettingsError(
            "expected surveys (--epoch) with --shift, which puts one on another, got none; name "
            "each with --epoch DATE=CLOUD, or leave out --shift"
        )


def find_settings_file(*inputs: str | None) -> Path | None:
    """Return the settings file in the folder of any input, None without one.

    The log names it. Raises SettingsError where there are two: which of them counts is not to be
    guessed.
    """
    from ..read.outlines.overture import is_overture

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


def parse_box(text: str) -> tuple[float, float, float, float]:
    """Parse the box that `--bbox` names.

    Raises SettingsError for anything else than four numbers in order.

    >>> parse_box("85000,446000, 85100,446050")
    (85000.0, 446000.0, 85100.0, 446050.0)
    """
    try:
        xmin, ymin, xmax, ymax = map(float, text.replace(",", " ").split())
    except ValueError:
        pass
    else:
        if xmin < xmax and ymin < ymax:
            return xmin, ymin, xmax, ymax
    raise SettingsError(
        "expected --bbox as xmin,ymin,xmax,ymax with xmin < xmax and ymin < ymax, got "
        f"{format_value(text)}; try --bbox 85000,446000,85500,446500"
    )
