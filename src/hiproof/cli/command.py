"""What commands have in common.

It is a help of the options that people need first, `--quiet` and `--verbose`.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable
from typing import Annotated, Any

import click

from ..early import interrupt_as_usual
from ..errors import SettingsError
from ..log import Level, start
from .commands import Entry
from .parameters import MAIN_HEADING, Option

ALL_OPTIONS = "hiproof.all_options"  # key of a context whose help shows every option


class Command(click.Command):
    """A command whose help shows its `first_options`.

    `--help-all` shows every option; without `first_options` help always does. Help is plain text,
    which needs no markup and no columns for types.
    """

    first_options: tuple[str, ...] = ()

    example: str = ""

    def with_entry(self, entry: Entry) -> Command:
        """Return the command with what the help shows of it beside its parameters."""
        self.first_options, self.example = entry.first_options, entry.example
        return self

    def format_arguments(self, ctx: Any, formatter: Any) -> None:
        """Write nothing: arguments come with the options, before them."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        for heading, params in self.group_parameters(ctx).items():
            write_parameters(formatter, heading, params, ctx)

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        write_example(formatter, self.example)

    def group_parameters(self, ctx: Any) -> dict[str, list[Any]]:
        """Return the parameters that the help shows, under their headings."""
        params = self.get_params(ctx)
        if self.first_options and not ctx.meta.get(ALL_OPTIONS):
            order = (*self.first_options, "help")
            first = sorted(
                (p for p in params if p.name in order), key=lambda p: order.index(p.name)
            )
            arguments = [param for param in params if param.param_type_name == "argument"]
            return {"Arguments": arguments, MAIN_HEADING: first}
        groups: dict[str, list[Any]] = {"Arguments": [], MAIN_HEADING: []}
        for param in params:
            is_argument = param.param_type_name == "argument"
            heading = "Arguments" if is_argument else getattr(param, "heading", MAIN_HEADING)
            groups.setdefault(heading, []).append(param)
        return {heading: group for heading, group in groups.items() if group}


def write_parameters(formatter: Any, heading: str, params: Iterable[Any], ctx: Any) -> None:
    """Write what each parameter does, under a heading.

    Texts of click's own options become phrases, as those of ours are.
    """
    records = filter(None, [param.get_help_record(ctx) for param in params])
    with formatter.section(heading):
        formatter.write_dl([(name, make_phrase(text)) for name, text in records])


def make_phrase(text: str) -> str:
    """Turn a sentence into a phrase.

    >>> make_phrase("Show this message and exit."), make_phrase("CRS of the clouds")
    ('show this message and exit', 'CRS of the clouds')
    """
    return text[:1].lower() + text[1:-1] if text.endswith(".") else text


def write_example(formatter: Any, example: str) -> None:
    """Write a command that can be copied: it is not wrapped."""
    with formatter.section("Example"):
        formatter.write(f"  {example}\n")


def print_every_option(ctx: click.Context, _: click.Parameter, is_requested: bool) -> None:
    """Show the whole help and end, as a callback of `--help-all`."""
    if is_requested:
        ctx.meta[ALL_OPTIONS] = True
        click.echo(ctx.get_help())
        raise click.exceptions.Exit


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
    kind: Any = Annotated[bool, Option(help, name=f"--{name}")]
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
