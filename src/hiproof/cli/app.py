"""All commands, with their options; the work is done elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import __version__
from ..log import Level, start
from .build import build
from .classify import classify
from .convert import convert
from .evaluate import evaluate
from .report import report
from .segment import segment
from .train import train

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
def reconstruct(
    clouds: Clouds,
    out: Annotated[Path, typer.Option(help="folder for the results")],
    footprints: Annotated[str | None, typer.Option(help="building polygons; without them the cloud is split")] = None,
    layer: Annotated[str | None, typer.Option(help="layer of the footprints, where a file has several")] = None,
    terrain: Annotated[str | None, typer.Option(help="terrain model (GeoTIFF); else the cloud's ground class")] = None,
    crs: Annotated[str | None, typer.Option(help="CRS of the clouds, such as EPSG:7415 [default: as they say]")] = None,
    unit: Annotated[str | None, typer.Option(help="metre, foot or us-survey-foot, for clouds without a CRS")] = None,
    id_attribute: Annotated[str | None, typer.Option(help="footprint attribute that names buildings")] = None,
    building_class: Annotated[list[int] | None, typer.Option(help="LAS class of roof points [default: 6]")] = None,
    ground_class: Annotated[list[int] | None, typer.Option(help="LAS class of terrain points [default: 2]")] = None,
    roofs: Annotated[str | None, typer.Option(help="found by class, by shape, or auto [default: auto]")] = None,
    types: Annotated[str | None, typer.Option(help="roof types to choose among, such as gable,hip")] = None,
    objective: Annotated[str | None, typer.Option(help="likelihood or paper [default: likelihood]")] = None,
    detail: Annotated[str | None, typer.Option(help="full, or main: without dormers and small parts")] = None,
    parts: Annotated[str | None, typer.Option(help="compound, or one: one primitive a building")] = None,
    align: Annotated[str | None, typer.Option(help="auto, or off: footprints beside their roofs stay there")] = None,
    network: Annotated[
        bool | None, typer.Option(help="ask the network of every building, or of none [default: with --parts one]")
    ] = None,
    overrides: Annotated[
        str | None, typer.Option(help="what is known better of some buildings (JSONL or a table); the fit obeys it")
    ] = None,
    config: Annotated[Path | None, typer.Option(help="settings file (see `hiproof settings`)")] = None,
    parquet: Annotated[bool | None, typer.Option(help="write the attributes as GeoParquet too (extra `city`)")] = None,
    models: Annotated[str | None, typer.Option(help="models merged, by work tiles, or both [default: merged]")] = None,
    jobs: Annotated[int, typer.Option(help="processes on this machine")] = 1,
    scheduler: Annotated[str | None, typer.Option(help="address of a Dask scheduler (extra `city`)")] = None,
    restart: Annotated[bool, typer.Option("--restart", help="begin anew in a folder that holds another run")] = False,
    log_file: Annotated[Path | None, typer.Option(help="keep the log from progress on here, added at the end")] = None,
    log_level: Annotated[Level, typer.Option(help="what of the log to show; debug also in the file")] = Level.warning,
) -> None:
    """Reconstruct the buildings of point clouds into CityGML, CityJSON, parameters and attributes.

    Exit code: 0 all buildings were modelled or explained by their data, 1 an internal error, 2 unusable input.
    """
    from .reconstruct import run

    start(log_level, log_file)
    options = {
        "read": {
            "building_classes": building_class,
            "ground_classes": ground_class,
            "roofs": roofs,
            "crs": crs,
            "unit": unit,
        },
        "fit": {
            "types": [name.strip() for name in types.split(",")] if types else None,
            "objective": objective,
            "parts": parts,
        },
        "compound": {"detail": detail},
        "reconstruct": {"align": align},
        "segment": {"enabled": network, "always": network},
        "city": {"parquet": parquet, "models": models},
    }
    inputs = {"footprints": footprints, "layer": layer, "terrain": terrain, "id_attribute": id_attribute}
    inputs["overrides"] = overrides
    raise typer.Exit(run(clouds, out, inputs, options, config, jobs, scheduler, restart))


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


for command in (build, evaluate, report, convert, classify, segment, train):
    app.command()(command)
