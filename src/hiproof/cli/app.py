"""The command `hiproof`.

Its commands are imported when they are named, so that its help shows at once.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from itertools import groupby
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from .. import __version__
from ..masking import mask
from .command import Command, with_log_options, write_example, write_parameters
from .commands import COMMANDS


class CommandTable(Mapping[str, Any]):
    """All commands by name; each is imported when it is looked up."""

    def __getitem__(self, name: str) -> Any:
        if name not in COMMANDS:
            raise KeyError(name)
        return import_command(name)

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)


@functools.cache
def import_command(name: str) -> Any:
    """Return the command `name`, whose module and function have its name."""
    function = getattr(import_module(f".{name}", __package__), name)
    single = typer.Typer(
        add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None
    )
    entry = COMMANDS[name]
    single.command(name, cls=Command)(with_log_options(function))
    command: Any = typer.main.get_command(single)
    command.first_options, command.example = entry.first_options, entry.example
    return command


class Commands(TyperGroup):
    """The commands in groups.

    Complaints about wrong usage hold no password of an argument.
    """

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = CommandTable()  # type: ignore[assignment]

    def list_commands(self, ctx: Any) -> list[str]:
        return list(COMMANDS)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the groups of commands, then the options."""
        self.format_usage(ctx, formatter)
        self.format_help_text(ctx, formatter)
        for group, names in groupby(COMMANDS, lambda name: COMMANDS[name].group):
            with formatter.section(group):
                formatter.write_dl([(name, COMMANDS[name].help) for name in names])
        write_parameters(formatter, "Options", self.get_params(ctx), ctx)
        write_example(formatter, COMMANDS["reconstruct"].example)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        with mask_complaints():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        with mask_complaints():
            return super().invoke(ctx)


@contextmanager
def mask_complaints() -> Iterator[None]:
    """Mask click's complaints about wrong usage.

    They name arguments as they are. Some versions of typer hold click inside.
    """
    try:
        yield
    except Exception as error:
        if hasattr(error, "format_message"):
            message = mask(error.format_message())
            error.format_message = lambda: message
        raise


app = typer.Typer(
    cls=Commands,
    name="hiproof",
    help="Turn airborne LiDAR point clouds into watertight, semantic, parametric LoD2 models.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def print_version(is_asked_for: bool) -> None:
    if is_asked_for:
        print(f"hiproof {__version__}")
        raise typer.Exit


@app.callback()
def common(
    version: Annotated[
        bool,
        typer.Option("--version", callback=print_version, is_eager=True, help="print the version"),
    ] = False,
) -> None:
    pass
