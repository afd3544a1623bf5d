"""What commands have in common.

It is a help of the options that people need first, `--quiet` and `--verbose`.
"""

from __future__ import annotations

import copy
import inspect
import re
from collections.abc import Callable
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from ..early import interrupt_as_usual
from ..errors import SettingsError
from ..log import Level, start

ALL_OPTIONS = "hiproof.all_options"  # key of a context whose help shows every option


class Command(TyperCommand):
    """A command whose help shows its `first_options`.

    `--help-all` shows every option; without `first_options` help always does.
    """

    first_options: tuple[str, ...] = ()

    def format_help(self, ctx: Any, formatter: Any) -> None:
        if not self.first_options or ctx.meta.get(ALL_OPTIONS):
            super().format_help(ctx, formatter)
            return
        every = self.params
        by_name = {param.name: param for param in every}
        arguments = [param for param in every if param.param_type_name == "argument"]
        first = [copy.copy(by_name[name]) for name in self.first_options]
        for param in first:
            param.rich_help_panel = None  # type: ignore[attr-defined]
        self.params = [*arguments, *first]
        try:
            super().format_help(ctx, formatter)
        finally:
            self.params = every


def print_every_option(ctx: typer.Context, is_asked_for: bool) -> None:
    """Show the whole help and end, as a callback of `--help-all`."""
    if is_asked_for:
        ctx.meta[ALL_OPTIONS] = True
        typer.echo(ctx.get_help())
        raise typer.Exit


def with_log_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add `--quiet` and `--verbose` to a command.

    The log starts at the level that they choose.
    """
    signature = inspect.signature(command, eval_str=True)

    def run_command(*, quiet: bool, verbose: bool, **values: Any) -> None:
        interrupt_as_usual()
        start(choose_level(quiet, verbose))
        command(**values)

    switches = {
        "quiet": "print only errors and requested results",
        "verbose": "print every step and every building",
    }
    parameters = [
        *signature.parameters.values(),
        *(make_switch(name, text) for name, text in switches.items()),
    ]
    run_command.__name__, run_command.__doc__ = command.__name__, join_lines(command.__doc__ or "")
    run_command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run_command.__annotations__ = {p.name: p.annotation for p in parameters}
    return run_command


def join_lines(text: str) -> str:
    """Make each paragraph of a docstring one line.

    The help wraps it to the terminal.

    >>> join_lines("a\\n    b\\n\\n    c")
    'a b\\n\\nc'
    """
    return re.sub(r"(?<!\n)\n(?!\n)", " ", inspect.cleandoc(text))


def make_switch(name: str, help: str) -> inspect.Parameter:
    """Make the parameter of an option that is on or off."""
    kind: Any = Annotated[bool, typer.Option(f"--{name}", help=help)]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=kind)


def choose_level(quiet: bool, verbose: bool) -> Level:
    """Return the level of the log that the options choose.

    Raises SettingsError where both are given.
    """
    if quiet and verbose:
        raise SettingsError("expected --quiet or --verbose, got both; leave one out")
    if verbose:
        return Level.debug
    return Level.error if quiet else Level.warning
