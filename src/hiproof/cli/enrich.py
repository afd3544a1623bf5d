"""`hiproof enrich`: answers about the buildings of a finished run."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..errors import escape_unseen
from ..log import Level, console_level, count_things
from ..progress import show_progress
from ..settings import Changes, EnrichSettings, Settings

if TYPE_CHECKING:
    from ..enrich.run import Enriched


def enrich(
    run: Path,
    *,
    out: Path | None = None,
    terrain: str = "",
    jobs: int | None = None,
    changes: Changes | None = None,
) -> int:
    """Add party walls, areas, house types and the sun to the models of a run.

    The run's own files stay as they are. A second call replaces the results of the first; run the
    same command again to resume an interrupted one. Exit code: 0 every building with a model has
    answers, 1 an internal error, 2 some parameters make no valid solid, or unusable input.
    """
    settings = Settings().replace(changes or {}).enrich
    return enrich_folder(run, out, with_terrain(settings, terrain), jobs)


def with_terrain(settings: EnrichSettings, terrain: str | None) -> EnrichSettings:
    """Return settings with a terrain model, unless they name one."""
    return dataclasses.replace(settings, shading_terrain=settings.shading_terrain or terrain or "")


def enrich_folder(run: Path, out: Path | None, settings: EnrichSettings, jobs: int | None) -> int:
    """Enrich the run in a folder and print the result; returns the exit code."""
    with show_progress("enrich") as update:
        from ..enrich.run import enrich_run

        result = enrich_run(
            run, out, settings, jobs, lambda done, total: update("enrich", done, total)
        )
    for failure in result.failures:
        text = f"not enriched: building {failure.id}: {failure.reason}"
        click.echo(escape_unseen(text), err=True)
    if console_level() is not Level.error:
        print_result(result, settings)
    return result.exit_code


def print_result(result: Enriched, settings: EnrichSettings) -> None:
    """Print how many buildings have answers, under which sky, and the files."""
    failed = len(result.failures)
    enriched = f"{result.buildings - failed:,} of " if failed else ""
    click.echo(f"{enriched}{count_things(result.buildings, 'building')} enriched")
    if settings.sun and settings.weather:
        click.echo(f"sun: weather of {settings.weather}")
    elif settings.sun:
        click.echo(
            "sun: a clear sky, more than any year has; --weather takes that of a typical one"
        )
    click.echo("files: " + ", ".join(map(str, result.files)))
