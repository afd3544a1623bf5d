"""All commands, each in a file of its name; the work is done elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from .. import __version__
from ..masking import mask
from .attributes import attributes
from .build import build
from .check import check
from .classify import classify
from .convert import convert
from .demo import demo
from .edit import edit
from .evaluate import evaluate
from .footprints import footprints
from .load import load
from .reconstruct import reconstruct
from .report import report
from .repro import repro
from .segment import segment
from .settings import settings
from .status import status
from .train import train
from .view import view
from .warm import warm


class MaskingGroup(TyperGroup):
    """The commands, whose complaints about wrong usage hold no password of an argument."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        with mask_complaints():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        with mask_complaints():
            return super().invoke(ctx)


@contextmanager
def mask_complaints() -> Iterator[None]:
    """Mask what click, which some versions of typer hold inside, says of wrong usage: it names
    arguments as they are.
    """
    try:
        yield
    except Exception as error:
        if hasattr(error, "format_message"):
            message = mask(error.format_message())
            error.format_message = lambda: message
        raise


app = typer.Typer(
    cls=MaskingGroup,
    name="hiproof",
    help="Airborne LiDAR point clouds into watertight, semantic, parametric LoD2 building models.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def version(targets: bool) -> None:
    if targets:
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
    repro,
    convert,
    view,
    classify,
    footprints,
    segment,
    train,
):
    app.command()(command)
