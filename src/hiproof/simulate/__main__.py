"""`python -m hiproof.simulate`: the bundled neighbourhood, or a city."""

from pathlib import Path
from typing import Annotated

import typer

from ..errors import HiproofError
from ..log import count_things

app = typer.Typer(
    add_completion=False, no_args_is_help=True, help="Simulated towns with their truth."
)


@app.command()
def neighbourhood(
    out: Annotated[
        Path,
        typer.Argument(help="folder for cloud.laz, footprints.gpkg, terrain.tif and truth.json"),
    ],
    seed: Annotated[int, typer.Option(help="the same seed gives the same neighbourhood")] = 5,
) -> None:
    """Make the demo's neighbourhood: every roof type and several compounds."""
    from .neighbourhood import write_neighbourhood

    try:
        counts = write_neighbourhood(out, seed)
    except HiproofError as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(2) from error
    typer.echo(
        f"{count_things(counts['buildings'], 'building')}, "
        f"{count_things(counts['points'], 'point')} in {out}"
    )


@app.command()
def city(
    out: Annotated[
        Path, typer.Argument(help="new folder for tiles/*.laz, footprints.gpkg and truth.jsonl")
    ],
    buildings: Annotated[int, typer.Option(help="how many buildings")] = 10000,
    density: Annotated[float, typer.Option(help="points per square metre")] = 5.0,
    tile: Annotated[float, typer.Option(help="side of a tile in metres")] = 500.0,
    seed: Annotated[int, typer.Option(help="the same seed gives the same city")] = 0,
) -> None:
    """Make a city of any size, tile by tile."""
    from .city import City, write_city

    total = 0
    try:
        for counts in write_city(out, City(buildings, seed, density, tile)):
            total += counts.points
            typer.echo(
                f"{counts.tile}: {count_things(counts.buildings, 'building')}, "
                f"{count_things(counts.points, 'point')}"
            )
    except HiproofError as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(2) from error
    typer.echo(f"{count_things(buildings, 'building')}, {count_things(total, 'point')} in {out}")


if __name__ == "__main__":
    app()
