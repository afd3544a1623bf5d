"""Options of the command line that settings declare.

Name, help and default are declared once, in `settings.py`.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from ..errors import SettingsError
from ..settings import Settings, format_value, toml_value
from .parameters import Option


class Declared(NamedTuple):
    """A setting of the command line.

    It has its section's name, the heading of that, and its field.
    """

    section: str
    heading: str
    field: dataclasses.Field

    @property
    def parameter(self) -> str:
        """Its option's name as that of a function's parameter."""
        return str(self.field.metadata["option"]).lstrip("-").replace("-", "_")


def with_settings(*sections: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add an option to a command for each setting that declares one.

    The command is `command(..., changes)`; settings are those of all sections or those named.

    What is given of them comes as `changes`. The options follow the command's own, a panel of its
    help a section.
    """
    return functools.partial(with_options, sections=sections)


def with_options(command: Callable[..., None], sections: tuple[str, ...]) -> Callable[..., None]:
    """Return `command` with the options of the settings in `sections`.

    They are of all sections where none is named; see `with_settings`.
    """
    selection = [item for item in declared_settings() if not sections or item.section in sections]
    declared = [item for item in selection if item.field.metadata["option"]]
    command_parameters = [
        p
        for p in inspect.signature(command, eval_str=True).parameters.values()
        if p.name != "changes"
    ]
    parameters = [*command_parameters, *map(make_parameter, declared)]

    def run_command(**values: Any) -> None:
        arguments = {item.parameter: values.pop(item.parameter) for item in declared}
        command(**values, changes=collect_changes(declared, arguments))

    run_command.__name__, run_command.__doc__ = command.__name__, command.__doc__
    run_command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run_command.__annotations__ = {p.name: p.annotation for p in parameters}
    return run_command


def declared_settings() -> list[Declared]:
    """Return every setting, in the order of `settings.py`."""
    sections = [(s.name, getattr(Settings(), s.name)) for s in dataclasses.fields(Settings)]
    return [
        Declared(name, f"Settings: {(section.__doc__ or '').partition('] ')[2].rstrip('.')}", field)
        for name, section in sections
        for field in dataclasses.fields(section)
    ]


def make_parameter(item: Declared) -> inspect.Parameter:
    """Make the parameter of a setting, None where it is not given."""
    metadata = item.field.metadata
    option = Option(
        help=format_help(item.field),
        metavar="|".join(map(str, metadata["choices"])) or None,
        heading=item.heading,
    )
    kind: Any = Annotated[OPTION_TYPES[item.field.type] | None, option]
    return inspect.Parameter(
        item.parameter, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=kind
    )


OPTION_TYPES: dict[Any, Any] = {
    "bool": bool,
    "int": int,
    "float": float,
    "str": str,
    "tuple[int, ...]": list[int],
    "tuple[float, ...]": list[float],
    "tuple[str, ...]": str,
}
"""What the command line takes for a setting of a declared type: numbers one option each, texts
joined by commas.
"""


def format_help(field: dataclasses.Field) -> str:
    """Return a setting's meaning and default."""
    default = toml_value(field.default).strip("[]").replace('"', "")
    return field.metadata["help"] + (f" (default: {default})" if default else "")


def collect_changes(
    declared: list[Declared], arguments: dict[str, Any]
) -> dict[str, dict[str, Any]]:
    """Return settings by section and name, of the options `arguments`.

    Those that are None are left out.
    """
    changes: dict[str, dict[str, Any]] = {}
    for item in declared:
        value = arguments[item.parameter]
        if value is not None:
            several_texts = item.field.type == "tuple[str, ...]"
            value = [text.strip() for text in value.split(",")] if several_texts else value
            changes.setdefault(item.section, {})[item.field.name] = value
    return changes


def parse_box(text: str) -> tuple[float, float, float, float]:
    """Parse the box that `--bbox` names.

    Raises SettingsError for anything else than four numbers in order.

    >>> parse_box("85000,446000, 85100,446050")
    (85000.0, 446000.0, 85100.0, 446050.0)
    """
    try:
        xmin, ymin, xmax, ymax = map(float, text.replace(",", " ").split())
    except ValueError:
        pass
    else:
        if xmin < xmax and ymin < ymax:
            return xmin, ymin, xmax, ymax
    raise SettingsError(
        "expected --bbox as xmin,ymin,xmax,ymax with xmin < xmax and ymin < ymax, got "
        f"{format_value(text)}; "
        "try --bbox 85000,446000,85500,446500"
    )
