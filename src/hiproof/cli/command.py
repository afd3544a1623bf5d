"""What commands have in common.

They are made of a function and its row in data/commands.toml. Their help shows the options that
people need first, and all have `--quiet` and `--verbose`.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable
from importlib import import_module
from typing import Any

import click

from ..early import interrupt_as_usual
from ..errors import SettingsError
from ..log import Level, start
from .parameters import (
    COMMANDS,
    MAIN_HEADING,
    HeadedOption,
    ShownArgument,
    collect_changes,
    list_parameters,
    list_setting_options,
)

ALL_OPTIONS = "hiproof.all_options"  # key of a context whose help shows every option


class Command(click.Command):
    """A command whose help shows the options that people need first.

    A line a group names the subjects of the others, and `--help-all` explains them; without that
    option the help explains all. Help is plain text, which needs no markup and no columns for
    types.
    """

    def format_arguments(self, ctx: Any, formatter: Any) -> None:
        """Write nothing: arguments come with the options, before them."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        row = COMMANDS[self.name or ""]
        first = row.get("first")
        groups = self.group_parameters(ctx)
        if not first or ctx.meta.get(ALL_OPTIONS):
            for heading, params in groups.items():
                write_parameters(formatter, heading, params, ctx)
            return
        by_name = {param.name: param for param in self.get_params(ctx)}
        shown = [by_name[name] for name in (*first, "help") if name in by_name]
        arguments = groups.pop(ShownArgument.heading, [])
        write_parameters(formatter, ShownArgument.heading, arguments, ctx)
        write_parameters(formatter, MAIN_HEADING, shown, ctx)
        more = row.get("more", "")
        names = {param.name for param in shown}
        lines = [
            heading.removeprefix("Settings: ") if ":" in heading else more
            for heading, group in groups.items()
            if {param.name for param in group} - names
        ]
        with formatter.section("More options, explained by --help-all"):
            formatter.write("".join(f"  {line}\n" for line in dict.fromkeys(filter(None, lines))))

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        write_example(formatter, self.name or "")

    def group_parameters(self, ctx: Any) -> dict[str, list[Any]]:
        """Return all parameters under their headings."""
        groups: dict[str, list[Any]] = {ShownArgument.heading: [], MAIN_HEADING: []}
        for param in self.get_params(ctx):
            groups.setdefault(getattr(param, "heading", MAIN_HEADING), []).append(param)
        return {heading: group for heading, group in groups.items() if group}


def write_parameters(formatter: Any, heading: str, params: Iterable[Any], ctx: Any) -> None:
    """Write what each parameter does, under a heading.

    Texts of click's own options become phrases, as those of ours are.
    """
    records = filter(None, [param.get_help_record(ctx) for param in params])
    with formatter.section(heading):
        formatter.write_dl(
            [
                (name, text[:1].lower() + text[1:-1] if text.endswith(".") else text)
                for name, text in records
            ]
        )


def write_example(formatter: Any, command: str) -> None:
    """Write a command that can be copied: it is not wrapped."""
    with formatter.section("Example"):
        formatter.write(f"  {COMMANDS[command]['example']}\n")


def make_command(name: str) -> Command:
    """Return the command `name`, whose module and function have its name."""
    module, row = import_module(f".{name}", __package__), COMMANDS[name]
    function: Callable[..., int | None] = getattr(module, name)  # its exit code, 0 for None
    settings = list_setting_options(row.get("settings", ()))

    def run_command(quiet: bool, verbose: bool, **values: Any) -> None:
        interrupt_as_usual()
        start(choose_level(quiet, verbose))
        if settings:
            values["changes"] = collect_changes(settings, values)
        raise click.exceptions.Exit(function(**values) or 0)

    prints = [
        make_print_option(option, help, getattr(module, f"print_{option}"))
        for option, help in row.get("prints", {}).items()
    ]
    if "first" in row:
        prints.append(make_print_option("help_all", "show all options, in groups", print_full_help))
    switches = [
        HeadedOption([f"--{option}"], help=help, is_flag=True) for option, help in SWITCHES.items()
    ]
    return Command(
        name,
        params=[*list_parameters(name, function), *prints, *settings, *switches],
        callback=run_command,
        # each paragraph is one line, which the help wraps to the terminal
        help=re.sub(r"(?<!\n)\n(?!\n)", " ", inspect.getdoc(function) or ""),
    )


SWITCHES = {
    "quiet": "print only errors and requested results",
    "verbose": "print every step and every building",
}


def make_print_option(name: str, help: str, function: Callable[[], None]) -> click.Option:
    """Return an option that prints something instead of running the command."""

    def print_and_end(ctx: click.Context, _: click.Parameter, is_requested: bool) -> None:
        if is_requested and not ctx.resilient_parsing:
            function()
            ctx.exit()

    return HeadedOption(
        ["--" + name.replace("_", "-")],
        help=help,
        is_flag=True,
        is_eager=True,
        expose_value=False,
        callback=print_and_end,
    )


def print_full_help() -> None:
    """Show the whole help of the command that runs."""
    ctx = click.get_current_context()
    ctx.meta[ALL_OPTIONS] = True
    click.echo(ctx.get_help())


def choose_level(quiet: bool, verbose: bool) -> Level:
    """Return the level of the log; both options together raise SettingsError."""
    if quiet and verbose:
        raise SettingsError("expected --quiet or --verbose, got both; leave one out")
    if verbose:
        return Level.debug
    return Level.error if quiet else Level.warning
