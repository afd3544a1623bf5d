"""All commands, each in a file of its name; the work is done elsewhere."""

from __future__ import annotations

from typing import Annotated

import typer

from .. import __version__
from .attributes import attributes
from .build import build
from .check import check
from .classify import classify
from .convert import convert
from .demo import demo
from .edit import edit
from .evaluate import evaluate
from .load import load
from .reconstruct import reconstruct
from .report import report
from .segment import segment
from .settings import settings
from .status import status
from .train import train
from .view import view
from .warm import warm

app = typer.Typer(
    name="hiproof",
    help="Airborne LiDAR point clouds into watertight, semantic, parametric LoD2 building models.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


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


for command in (
    reconstruct,
    demo,
    warm,
    check,
    settings,
    attributes,
    status,
    load,
    build,
    edit,
    evaluate,
    report,
    convert,
    view,
    classify,
    segment,
    train,
):
    app.command()(command)
