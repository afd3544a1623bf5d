"""`python -m hiproof.simulate`: make the bundled neighbourhood, or a city of any size."""

from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(add_completion=False, no_args_is_help=True, help="Simulated towns with their truth.")


@app.command()
def neighbourhood(
    out: Annotated[Path, typer.Argument(help="folder for cloud.laz, footprints.gpkg, terrain.tif and truth.json")],
    seed: Annotated[int, typer.Option(help="the same seed gives the same neighbourhood")] = 5,
) -> None:
    """The demo's neighbourhood: every roof type and several compounds."""
    from .neighbourhood import write_neighbourhood

    counts = write_neighbourhood(out, seed)
    typer.echo(f"{counts['buildings']} buildings, {counts['points']} points in {out}")


@app.callback()
def main() -> None:
    pass


if __name__ == "__main__":
    app()
