"""Parameters of commands, as the annotations of their functions declare them.

    def check(
        files: Annotated[list[Path], Argument("files to check")],
        as_json: Annotated[bool, Option("print JSON instead of text", name="--json")] = False,
    ) -> None: ...

The type says what the command line takes, and a parameter with a default may be left out.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_origin

import click

MAIN_HEADING = "Options"


@dataclass(frozen=True)
class Argument:
    """What is declared of an argument beside its type."""

    help: str


@dataclass(frozen=True)
class Option:
    """What is declared of an option beside its type.

    Without a `name` it is called after its parameter, and a switch has a second name that turns it
    off. `low` and `high` bound a number. `is_folder` means that a folder of this name has to exist.
    The `callback` is called with the context, the parameter and its value, and before all others
    where the option `is_eager`.
    """

    help: str
    name: str | None = None
    heading: str = MAIN_HEADING
    metavar: str | None = None
    low: float | None = None
    high: float | None = None
    is_folder: bool = False
    shows_default: bool = True
    is_eager: bool = False
    callback: Callable[[click.Context, click.Parameter, Any], Any] | None = None


class ShownArgument(click.Argument):
    """An argument that the help explains."""

    def __init__(self, names: list[str], help: str, **attributes: Any) -> None:
        super().__init__(names, **attributes)
        self.help = help

    def make_metavar(self, *_: Any) -> str:
        """Return the argument as usage shows it, in brackets where it may be left out."""
        name = (self.name or "") + ("..." if self.nargs == -1 else "")
        return name if self.required else f"[{name}]"

    def get_help_record(self, ctx: click.Context) -> tuple[str, str]:
        return self.make_metavar(ctx), self.help or ""


class HeadedOption(click.Option):
    """An option with the heading under which the help shows it."""

    def __init__(self, names: list[str], heading: str, **attributes: Any) -> None:
        super().__init__(names, **attributes)
        self.heading = heading


def list_parameters(function: Callable[..., None]) -> list[click.Parameter]:
    """Return the parameters of a function as those of a command.

    Each of them is annotated with its type and an Argument or an Option.
    """
    signature = inspect.signature(function, eval_str=True)
    return [make_parameter(parameter) for parameter in signature.parameters.values()]


def make_parameter(parameter: inspect.Parameter) -> click.Parameter:
    annotation, declared = get_args(parameter.annotation)
    choices = [kind for kind in get_args(annotation) if kind is not NoneType]
    kind = choices[0] if NoneType in get_args(annotation) else annotation
    is_list = get_origin(kind) is list
    kind = get_args(kind)[0] if is_list else kind
    is_required = parameter.default is inspect.Parameter.empty
    attributes: dict[str, Any] = {
        "type": choose_type(kind, declared),
        "required": is_required,
        "help": declared.help,
    }
    if not is_required:
        attributes["default"] = parameter.default
    if is_list or issubclass(kind, Enum):
        attributes["callback"] = as_list if is_list else as_member(kind)
    if isinstance(declared, Argument):
        return ShownArgument([parameter.name], nargs=-1 if is_list else 1, **attributes)
    if declared.callback:
        attributes["callback"] = declared.callback
    return HeadedOption(
        [parameter.name, declared.name or name_option(parameter.name, kind)],
        declared.heading,
        multiple=is_list,
        is_flag=kind is bool,
        is_eager=declared.is_eager,
        metavar=declared.metavar,
        show_default=declared.shows_default,
        **attributes,
    )


def name_option(name: str, kind: type) -> str:
    """Return the name of an option, or both names of a switch.

    >>> name_option("osm_tags", bool), name_option("out", Path)
    ('--osm-tags/--no-osm-tags', '--out')
    """
    words = name.replace("_", "-")
    return f"--{words}/--no-{words}" if kind is bool else f"--{words}"


def choose_type(kind: type, declared: Argument | Option) -> Any:
    """Return what click takes for values of a type."""
    option = declared if isinstance(declared, Option) else Option("")
    if issubclass(kind, Path):
        return click.Path(exists=option.is_folder, file_okay=not option.is_folder, path_type=Path)
    if issubclass(kind, Enum):
        return click.Choice([member.value for member in kind])
    if (option.low, option.high) != (None, None):
        bounded: Any = click.IntRange if kind is int else click.FloatRange
        return bounded(option.low, option.high)
    return kind


def as_list(_: click.Context, parameter: click.Parameter, values: Any) -> list[Any] | None:
    """Return the values of a parameter that may be repeated, None without any."""
    return list(values) if values else None


def as_member(kind: type[Enum]) -> Callable[[click.Context, click.Parameter, Any], Enum | None]:
    """Return a callback that makes a member of an enumeration of its value."""
    return lambda context, parameter, value: None if value is None else kind(value)
