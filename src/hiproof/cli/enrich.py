"""`hiproof enrich`: answers about the buildings of a finished run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from ..log import count_things
from ..progress import show_progress


def enrich(
    run: Annotated[Path, typer.Argument(help="output folder of a run, or its parameters.jsonl")],
    out: Annotated[
        Path | None, typer.Option(help="folder for the results (default: enriched, in the run)")
    ] = None,
    touch: Annotated[
        float,
        typer.Option(help="distance up to which walls of neighbours touch, m", min=0.0, max=2.0),
    ] = 0.3,
    use_attribute: Annotated[
        str,
        typer.Option(
            help="attribute of the footprints that names the use of a building, such as "
            "residential or office (default: all are residential)"
        ),
    ] = "",
    sun: Annotated[
        bool, typer.Option("--sun", help="add the sun on every roof surface (extra `sun`)")
    ] = False,
    weather: Annotated[
        Path | None,
        typer.Option(help="weather of a typical year (EPW), for --sun (default: a clear sky)"),
    ] = None,
    albedo: Annotated[
        float,
        typer.Option(help="share of light that the ground reflects, for --sun", min=0.0, max=1.0),
    ] = 0.2,
    jobs: Annotated[
        int | None,
        typer.Option(
            help="number of worker processes (default: up to one per core, fewer for a small run)",
            min=1,
        ),
    ] = None,
) -> None:
    """Add party walls, areas, house types and the sun to the models of a run.

    The run's own files stay as they are. A second call replaces the results of the first; run the
    same command again to resume an interrupted one.

    Exit code: 0 all buildings were written, 1 an internal error, 2 unusable input.
    """
    if weather is not None and not sun:
        raise InputError("expected --weather with --sun, got it alone; add --sun")
    with show_progress("enrich") as update:
        from ..enrich.cadastre import SunQuestions
        from ..enrich.run import Questions, enrich_run

        path = "" if weather is None else str(weather)
        asked = Questions(touch, use_attribute, SunQuestions(path, albedo) if sun else None)
        result = enrich_run(
            run,
            out,
            asked,
            jobs,
            lambda done, total: update("enrich", done, total),
        )
    typer.echo(f"{count_things(result.buildings, 'building')} enriched")
    typer.echo("files: " + ", ".join(map(str, result.files)))
