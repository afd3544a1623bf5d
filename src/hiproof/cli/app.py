"""The command `hiproof`: commands are imported when named, so that its help shows at once."""

from __future__ import annotations

import functools
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import groupby
from typing import Any

import click

from .. import __version__
from ..early import INTERRUPTED
from ..masking import mask
from .command import Command, make_command, make_print_option, write_example, write_parameters
from .parameters import COMMANDS

LONGEST_COMPLAINT = 500  # characters of a complaint about wrong usage: a few lines of a terminal


import_command = functools.cache(make_command)


class Commands(click.Group):
    """The commands in groups; complaints about wrong usage hold no password of an argument."""

    def get_command(self, ctx: Any, name: str) -> Command | None:
        return import_command(name) if name in COMMANDS else None

    def list_commands(self, ctx: Any) -> list[str]:
        return list(COMMANDS)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the groups of commands, then the options."""
        self.format_usage(ctx, formatter)
        self.format_help_text(ctx, formatter)
        for group, names in groupby(COMMANDS, lambda name: COMMANDS[name]["group"]):
            with formatter.section(group):
                formatter.write_dl([(name, COMMANDS[name]["line"]) for name in names])
        write_parameters(formatter, "Options", self.get_params(ctx), ctx)
        write_example(formatter, "reconstruct")

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        with mask_complaints():
            return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        with mask_complaints():
            return super().invoke(ctx)


@contextmanager
def mask_complaints() -> Iterator[None]:
    """Mask click's complaints about wrong usage, which name arguments as they are.

    Ctrl-C ends the program, of which click would say that it was aborted.
    """
    try:
        yield
    except KeyboardInterrupt:
        raise SystemExit(INTERRUPTED) from None
    except click.ClickException as error:
        message = mask(error.format_message())
        if len(message) > LONGEST_COMPLAINT:  # it repeats a value
            message = textwrap.shorten(message, LONGEST_COMPLAINT, placeholder=" ...")
        error.format_message = lambda: message  # type: ignore[method-assign]
        raise


app = Commands(
    name="hiproof",
    commands=COMMANDS,  # type: ignore[arg-type]
    help="Turn airborne LiDAR point clouds into watertight, semantic, parametric LoD2 models.",
    no_args_is_help=True,
    params=[
        make_print_option(
            "version", "print the version", lambda: click.echo(f"hiproof {__version__}")
        )
    ],
)
