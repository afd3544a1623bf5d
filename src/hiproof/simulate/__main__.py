"""`python -m hiproof.simulate`: the bundled neighbourhood, or a city."""

from pathlib import Path

import click

from ..errors import HiproofError
from ..log import count_things


class Simulator(click.Group):
    """Commands whose errors are sentences."""

    def invoke(self, ctx: click.Context) -> None:
        try:
            super().invoke(ctx)
        except HiproofError as error:
            click.echo(f"error: {error}", err=True)
            raise click.exceptions.Exit(2) from error


@click.group(cls=Simulator, no_args_is_help=True)
def app() -> None:
    """Simulated towns with their truth."""


@app.command()
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--seed", default=5, help="the same seed gives the same neighbourhood")
def neighbourhood(out: Path, seed: int) -> None:
    """Make the demo's neighbourhood in OUT: every roof type and several compounds.

    It is cloud.laz, footprints.gpkg, terrain.tif and truth.json.
    """
    from .neighbourhood import write_neighbourhood

    counts = write_neighbourhood(out, seed)
    click.echo(
        f"{count_things(counts['buildings'], 'building')}, "
        f"{count_things(counts['points'], 'point')} in {out}"
    )


@app.command()
@click.argument("out", type=click.Path(path_type=Path))
@click.option("--buildings", default=10000, help="how many buildings")
@click.option("--density", default=5.0, help="points per square metre")
@click.option("--tile", default=500.0, help="side of a tile in metres")
@click.option("--seed", default=0, help="the same seed gives the same city")
def city(out: Path, buildings: int, density: float, tile: float, seed: int) -> None:
    """Make a city of any size in OUT, a new folder, tile by tile.

    It is tiles/*.laz, footprints.gpkg and truth.jsonl.
    """
    from .city import City, write_city

    total = 0
    for counts in write_city(out, City(buildings, seed, density, tile)):
        total += counts.points
        click.echo(
            f"{counts.tile}: {count_things(counts.buildings, 'building')}, "
            f"{count_things(counts.points, 'point')}"
        )
    click.echo(f"{count_things(buildings, 'building')}, {count_things(total, 'point')} in {out}")


if __name__ == "__main__":
    app()
