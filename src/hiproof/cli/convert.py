"""`hiproof convert`: the models of a run as files that 3D viewers open."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Format(StrEnum):
    glb = "glb"
    obj = "obj"


def convert(
    folder: Annotated[Path, typer.Argument(help="output folder of a run")],
    format: Annotated[Format, typer.Option(help="glb (binary glTF 2.0) or obj (with .mtl)")] = Format.glb,
    out: Annotated[
        Path | None, typer.Option(help="file to write [default: buildings.glb or .obj in the folder]")
    ] = None,
) -> None:
    """Convert the models of a run to glTF binary or OBJ, with building ids and roof types as properties."""
    from ..evaluate.models import read_models, run_models
    from ..evaluate.run import run_record, run_units
    from ..read.cityjson_text import documents, reference_system
    from ..write.gltf import write_glb
    from ..write.obj import write_obj

    models = run_models(folder)
    path = out or Path(folder) / f"buildings.{format.value}"
    write = {Format.glb: write_glb, Format.obj: write_obj}[format]
    found = read_models(models, run_units(run_record(folder)))
    buildings = ((m.id, m.roof_type, m.solid, m.attributes) for m in found if m.solid is not None)
    header, _ = next(documents(models))
    count = write(path, buildings, crs=reference_system(header))
    typer.echo(f"{path}: {count} buildings")
