"""All commands, with their options; the work is done elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .. import __version__
from ..log import Level, start
from .build import build
from .classify import classify
from .convert import convert
from .edit import edit
from .evaluate import evaluate
from .options import box_of, with_settings
from .report import report
from .segment import segment
from .train import train
from .view import view

app = typer.Typer(
    name="hiproof",
    help="Airborne LiDAR point clouds into watertight, semantic, parametric LoD2 building models.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Clouds = Annotated[list[str], typer.Argument(help="point files (LAS, LAZ, COPC, XYZ, CSV, PLY) or folders of them")]


def version(wanted: bool) -> None:
    if wanted:
        print(f"hiproof {__version__}")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", callback=version, is_eager=True, help="print the version")
    ] = False,
) -> None:
    pass


@app.command()
@with_settings()
def reconstruct(
    clouds: Clouds,
    out: Annotated[Path, typer.Option(help="folder for the results")],
    footprints: Annotated[str | None, typer.Option(help="building polygons; without them the cloud is split")] = None,
    layer: Annotated[str | None, typer.Option(help="layer of the footprints, where a file has several")] = None,
    where: Annotated[str | None, typer.Option(help='SQL condition on the footprints, such as "year < 1950"')] = None,
    bbox: Annotated[
        str | None, typer.Option(help="only buildings in this box: xmin,ymin,xmax,ymax in the clouds' coordinates")
    ] = None,
    id_attribute: Annotated[str | None, typer.Option(help="footprint attribute that names buildings")] = None,
    terrain: Annotated[str | None, typer.Option(help="terrain model (GeoTIFF); else the cloud's ground class")] = None,
    overrides: Annotated[
        str | None, typer.Option(help="what is known better of some buildings (JSONL or a table); the fit obeys it")
    ] = None,
    config: Annotated[
        Path | None, typer.Option(help="settings file, see `hiproof settings` (default: hiproof.toml beside the data)")
    ] = None,
    jobs: Annotated[int, typer.Option(help="processes on this machine")] = 1,
    scheduler: Annotated[str | None, typer.Option(help="address of a Dask scheduler (extra `city`)")] = None,
    restart: Annotated[bool, typer.Option("--restart", help="begin anew in a folder that holds another run")] = False,
    log_file: Annotated[Path | None, typer.Option(help="keep the log from progress on here, added at the end")] = None,
    log_level: Annotated[Level, typer.Option(help="what of the log to show; debug also in the file")] = Level.warning,
    changes: dict[str, dict[str, Any]] | None = None,
) -> None:
    """Reconstruct the buildings of point clouds into CityGML, CityJSON, parameters and attributes.

    Exit code: 0 all buildings were modelled or explained by their data, 1 an internal error, 2 unusable input.
    """
    from .reconstruct import run

    start(log_level, log_file)
    inputs: dict[str, Any] = {"footprints": footprints, "layer": layer, "where": where, "id_attribute": id_attribute}
    inputs |= {"bbox": None if bbox is None else box_of(bbox), "terrain": terrain, "overrides": overrides}
    raise typer.Exit(run(clouds, out, inputs, changes or {}, config, jobs, scheduler, restart))


@app.command()
def demo(folder: Annotated[Path, typer.Argument(help="folder for the results")] = Path("demo")) -> None:
    """Run the main job on the bundled simulated neighbourhood, all roof types in it."""
    from .demo import run

    raise typer.Exit(run(folder))


@app.command()
def warm(
    everything: Annotated[
        bool, typer.Option("--all", help="also what only runs without footprints or with --parts one call")
    ] = False,
) -> None:
    """Compile what runs call, once for each version and machine, so that the first run starts at once."""
    from .warm import run

    raise typer.Exit(run(everything))


@app.command()
def check(
    files: Annotated[list[Path], typer.Argument(help="CityJSON, CityJSONSeq or CityGML files")],
    planarity: Annotated[
        float, typer.Option(min=0.0, help="largest distance of a vertex from its face's plane, m")
    ] = 0.01,
) -> None:
    """Check solids for validity by ISO 19107 (val3dity's codes); exit code 1 if any is invalid."""
    from .check import run

    raise typer.Exit(run(files, planarity))


@app.command()
def settings(
    config: Annotated[Path | None, typer.Option(help="start from this settings file")] = None,
    write: Annotated[Path | None, typer.Option(help="write the TOML here instead of printing it")] = None,
) -> None:
    """Print every setting as TOML, with default, unit, bounds and meaning."""
    from .settings import run

    raise typer.Exit(run(config, write))


@app.command()
def attributes() -> None:
    """Print every attribute and table that a run writes, with kind, unit and meaning, as Markdown."""
    from .attributes import run

    raise typer.Exit(run())


@app.command()
def status(folder: Annotated[Path, typer.Argument(help="output folder of a run")]) -> None:
    """Show how far a run is: progress, failures by kind, throughput and time left, while it runs or after."""
    from .status import run

    raise typer.Exit(run(folder))


@app.command()
def load(
    folder: Annotated[Path, typer.Argument(help="output folder of a run")],
    database: Annotated[str, typer.Argument(help="postgresql://user@host/database")],
    prefix: Annotated[str, typer.Option(help="first part of the table names")] = "hiproof",
) -> None:
    """Load the models of a run into PostGIS tables; loading again replaces them."""
    from .load import run

    raise typer.Exit(run(folder, database, prefix))


for command in (build, edit, evaluate, report, convert, view, classify, segment, train):
    app.command()(command)
