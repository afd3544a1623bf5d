"""`hiproof convert`: the models of a run as files that 3D viewers open."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ..formats import OF_MODELS, module_of

Made = StrEnum("Made", {name: name for name in OF_MODELS})
KINDS = ", ".join(f"{name} ({format.what})" for name, format in OF_MODELS.items())


def convert(
    folder: Annotated[Path, typer.Argument(help="output folder of a run")],
    format: Annotated[Made, typer.Option(help=f"what to make: {KINDS}")] = Made.glb,
    out: Annotated[
        Path | None, typer.Option(help="file to write [default: in the folder, named buildings as the run's own]")
    ] = None,
) -> None:
    """Convert the models of a run to a format of 3D viewers, with building ids and roof types as properties."""
    from ..evaluate.models import read_models, run_models
    from ..evaluate.run import run_record, run_units
    from ..read.cityjson_text import documents, reference_system

    models, made = run_models(folder), OF_MODELS[format.value]
    path = out or Path(folder) / made.file
    found = read_models(models, run_units(run_record(folder)))
    buildings = ((m.id, m.roof_type, m.solid, m.attributes) for m in found if m.solid is not None)
    header, _ = next(documents(models))
    count = module_of(made.module).write_models(path, buildings, crs=reference_system(header))
    typer.echo(f"{path}: {count} buildings")
