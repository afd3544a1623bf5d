"""Pages of the site that are made of the code: every command with its options, every setting."""

from __future__ import annotations

import dataclasses
from typing import Any

import typer

from hiproof.cli.app import app
from hiproof.settings import Settings, toml_value


def on_files(files: Any, config: Any) -> Any:
    """What mkdocs calls to learn of the pages."""
    from mkdocs.structure.files import File

    for name, make in PAGES.items():
        files.append(File.generated(config, name, content=make()))
    return files


def commands_text() -> str:
    """Every command: what it does, its arguments, its options."""
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    return "# Commands\n\nAs `hiproof COMMAND --help` tells them.\n" + "".join(
        command_text(name, command) for name, command in sorted(commands.items())
    )


def command_text(name: str, command: Any) -> str:
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    rows = [(f"`{(p.name or '').upper()}`", p.help or "") for p in arguments]
    rows += [
        (", ".join(f"`{opt}`" for opt in (*p.opts, *p.secondary_opts)), p.help or "")
        for p in command.params
        if p not in arguments
    ]
    table = "".join(f"| {what} | {cell(help)} |\n" for what, help in rows)
    head = "| argument or option | meaning |\n| --- | --- |\n"
    return f"\n## hiproof {name}\n\n{command.help}\n\n{head if rows else ''}{table}"


def settings_text() -> str:
    """Every setting by section: its default, unit, bounds or choices, meaning, and option where it has one."""
    text = "# Settings\n\nAs `hiproof settings` prints them, for `--config` or a `hiproof.toml` beside the data.\n"
    for section in dataclasses.fields(Settings):
        values = getattr(Settings(), section.name)
        text += f"\n## {section.name}\n\n{(values.__doc__ or '').partition('] ')[2].capitalize()}\n\n"
        text += "| setting | default | unit | values | meaning | option |\n| --- | --- | --- | --- | --- | --- |\n"
        text += "".join(map(setting_row, dataclasses.fields(values)))
    return text


def setting_row(field: dataclasses.Field) -> str:
    told = field.metadata
    bounds = f"{told['low']} to {told['high']}" if told["low"] is not None else ""
    values = ", ".join(f"`{choice}`" for choice in told["choices"]) or bounds
    option = f"`{told['option']}`" if told["option"] else ""
    return f"| `{field.name}` | `{toml_value(field.default)}` | {told['unit']} | {values} | {cell(told['help'])} | {option} |\n"


def cell(text: str) -> str:
    """A text as a table's cell holds it."""
    return text.replace("|", "\\|").replace("\n", " ")


PAGES = {"commands.md": commands_text, "settings.md": settings_text}
