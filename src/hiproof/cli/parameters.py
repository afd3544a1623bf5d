"""Parameters of commands, made of signatures, data/commands.toml and settings.

    def check(files: list[Path], *, planarity: float = 0.01, as_json: bool = False) -> None: ...

The arguments of a command are those of its function, and its options are keywords. The type says
what the command line takes, and a parameter with a default may be left out.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterable
from enum import Enum
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_origin

import click

from ..data_files import Values, read_data_file
from ..settings import Changes, Settings, toml_value

COMMANDS: dict[str, Values] = read_data_file("commands")
SHARED_PARAMETERS = COMMANDS.pop("shared")
MAIN_HEADING, FURTHER_HEADING = "Options", "Further options"


class ShownArgument(click.Argument):
    """An argument that the help explains."""

    heading = "Arguments"

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
    """An option, the heading under which the help shows it, and its setting."""

    def __init__(
        self,
        names: list[str],
        heading: str = MAIN_HEADING,
        setting: tuple[str, dataclasses.Field] | None = None,
        **attributes: Any,
    ) -> None:
        super().__init__(names, **attributes)
        self.heading, self.setting = heading, setting


def list_parameters(command: str, function: Callable[..., int | None]) -> list[click.Parameter]:
    """Return the parameters of a command's function, but for `changes` of settings."""
    rows = SHARED_PARAMETERS | COMMANDS[command].get("parameters", {})
    parameters = inspect.signature(function, eval_str=True).parameters
    return [
        make_parameter(p, **(rows[name] if isinstance(rows[name], dict) else {"help": rows[name]}))
        for name, p in parameters.items()
        if name != "changes"
    ]


def make_parameter(
    parameter: inspect.Parameter,
    help: str,
    name: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    is_folder: bool = False,
    further: bool = False,
    **attributes: Any,
) -> click.Parameter:
    """Return the parameter of a command that a function's parameter and its row make."""
    kind = parameter.annotation
    kind = get_args(kind)[0] if NoneType in get_args(kind) else kind
    is_list = get_origin(kind) is list
    kind = get_args(kind)[0] if is_list else kind
    attributes["type"] = choose_type(kind, minimum, maximum, is_folder)
    attributes["required"] = parameter.default is inspect.Parameter.empty
    if not attributes["required"]:
        attributes["default"] = parameter.default
    if is_list:
        attributes["callback"] = lambda _context, _parameter, values: list(values) or None
    elif issubclass(kind, Enum):
        help = help.replace("{choices}", ", ".join(kind))
        attributes["callback"] = lambda _context, _parameter, value: value and kind(value)
    if parameter.kind is not inspect.Parameter.KEYWORD_ONLY:
        return ShownArgument([parameter.name], help, nargs=-1 if is_list else 1, **attributes)
    if further:
        attributes["heading"] = FURTHER_HEADING
    return HeadedOption(
        [parameter.name, name or name_option(parameter)],
        help=help,
        multiple=is_list,
        is_flag=kind is bool,
        **{"show_default": parameter.default != "", **attributes},
    )


def name_option(parameter: inspect.Parameter) -> str:
    """Return the name of an option, or both names of a switch.

    A switch that is off without it has one.

    >>> kind = inspect.Parameter.KEYWORD_ONLY
    >>> name_option(inspect.Parameter("osm_tags", kind, annotation=bool | None, default=None))
    '--osm-tags/--no-osm-tags'
    """
    words = parameter.name.replace("_", "-")
    is_switch = parameter.annotation in (bool, bool | None) and parameter.default is not False
    return f"--{words}/--no-{words}" if is_switch else f"--{words}"


def choose_type(kind: type, minimum: float | None, maximum: float | None, is_folder: bool) -> Any:
    """Return what click takes for values of a type within bounds."""
    if issubclass(kind, Path):
        return click.Path(exists=is_folder, file_okay=not is_folder, path_type=Path)
    if issubclass(kind, Enum):
        return click.Choice([member.value for member in kind])
    if (minimum, maximum) != (None, None):
        bounded: Any = click.IntRange if kind is int else click.FloatRange
        return bounded(minimum, maximum)
    return kind


# What the command line takes for a setting of a declared type: numbers one option each, texts
# joined by commas.
OPTION_TYPES: dict[Any, Any] = {
    "bool": bool,
    "int": int,
    "float": float,
    "str": str,
    "tuple[int, ...]": list[int],
    "tuple[float, ...]": list[float],
    "tuple[str, ...]": str,
}


def list_setting_options(sections: Iterable[str]) -> list[click.Parameter]:
    """Return the options of the settings in `sections`, in the order of settings.py."""
    return [
        make_setting_option(section, field)
        for section in sections
        for field in dataclasses.fields(getattr(Settings(), section))
        if field.metadata["option"]
    ]


def make_setting_option(section: str, field: dataclasses.Field) -> click.Parameter:
    """Make the option of a setting, None where it is not given."""
    metadata = field.metadata
    default = toml_value(field.default).strip("[]").replace('"', "")
    meaning = (getattr(Settings(), section).__doc__ or "").partition("] ")[2]
    parameter = inspect.Parameter(
        metadata["option"].lstrip("-").replace("-", "_"),
        inspect.Parameter.KEYWORD_ONLY,
        default=None,
        annotation=OPTION_TYPES[field.type] | None,
    )
    return make_parameter(
        parameter,
        metadata["help"] + (f" (default: {default})" if default else ""),
        heading=f"Settings: {meaning.rstrip('.')}",
        metavar="|".join(map(str, metadata["choices"])) or None,
        setting=(section, field),
    )


def collect_changes(params: Iterable[click.Parameter], values: Values) -> Changes:
    """Take the settings that options give from `values`, by section and name."""
    changes: Changes = {}
    for param in params:
        section, field = getattr(param, "setting", None) or ("", None)
        value = values.pop(param.name or "") if field else None
        if field and value is not None:
            several_texts = field.type == "tuple[str, ...]"
            value = [text.strip() for text in value.split(",")] if several_texts else value
            changes.setdefault(section, {})[field.name] = value
    return changes
