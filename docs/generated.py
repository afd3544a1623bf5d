"""Pages of the site that are made from the code.

They have every command with its options, every setting, and every number with its reason.
"""

from __future__ import annotations

import ast
import dataclasses
import io
import tokenize
from collections.abc import Iterator
from itertools import groupby, takewhile, zip_longest
from pathlib import Path
from typing import Any, NamedTuple

import hiproof
from hiproof.cli.app import import_command
from hiproof.cli.parameters import COMMANDS
from hiproof.settings import Settings, toml_value

PACKAGE = Path(hiproof.__file__).parent


def on_files(files: Any, config: Any) -> Any:
    """Add the generated pages; mkdocs calls this."""
    from mkdocs.structure.files import File

    for name, make in PAGES.items():
        files.append(File.generated(config, name, content=make()))
    return files


def describe_commands() -> str:
    """Describe every command: its purpose, its arguments, its options."""
    return "# Commands\n\n`hiproof COMMAND --help` prints the same.\n" + "".join(
        describe_command(name, import_command(name)) for name in sorted(COMMANDS)
    )


def describe_command(name: str, command: Any) -> str:
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    rows = [(f"`{(p.name or '').upper()}`", p.help or "") for p in arguments]
    rows += [
        (", ".join(f"`{opt}`" for opt in (*p.opts, *p.secondary_opts)), p.help or "")
        for p in command.params
        if p not in arguments
    ]
    table = "".join(f"| {kind} | {make_cell(help)} |\n" for kind, help in rows)
    head = "| argument or option | meaning |\n| --- | --- |\n"
    example = f"Example:\n\n    {COMMANDS[name]['example']}\n"
    return f"\n## hiproof {name}\n\n{command.help}\n\n{example}\n{head if rows else ''}{table}"


def describe_settings() -> str:
    """Describe every setting by section.

    A setting has its default, unit, bounds or choices, meaning, and option where it has one.
    """
    text = (
        "# Settings\n\n"
        "`hiproof settings` prints the same as TOML, for `--config` or a `hiproof.toml` beside the "
        "data.\n"
    )
    for section in dataclasses.fields(Settings):
        values = getattr(Settings(), section.name)
        text += f"\n## {section.name}\n\n{(values.__doc__ or '').partition('] ')[2]}\n\n"
        text += (
            "| setting | default | unit | values | meaning | option |\n| --- | --- | --- | --- | "
            "--- | --- |\n"
        )
        text += "".join(map(make_setting_row, dataclasses.fields(values)))
    return text


def make_setting_row(field: dataclasses.Field) -> str:
    metadata = field.metadata
    bounds = f"{metadata['low']} to {metadata['high']}" if metadata["low"] is not None else ""
    values = ", ".join(f"`{choice}`" for choice in metadata["choices"]) or bounds
    option = f"`{metadata['option']}`" if metadata["option"] else ""
    return (
        f"| `{field.name}` | `{toml_value(field.default)}` | {metadata['unit']} | {values} | "
        f"{make_cell(metadata['help'])} | {option} |\n"
    )


class Constant(NamedTuple):
    """A line that names numbers.

    It has the file of the package, its `names`, the `value` as it is written, and the reason.
    """

    file: str
    names: tuple[str, ...]
    value: str
    why: str

    @property
    def room(self) -> str:
        return self.file.partition("/")[0]


def list_constants() -> list[Constant]:
    """List all numbers with a name at the top of a module, by file.

    The reason is what is written behind the value, on the lines above it, or in the text below it.
    """
    return [
        constant for file in sorted(PACKAGE.rglob("*.py")) for constant in list_constants_in(file)
    ]


def list_constants_in(file: Path) -> Iterator[Constant]:
    text = file.read_text(encoding="utf-8")
    statements = ast.parse(text).body
    numbers = [s for s in statements if list_names(s) and is_number(s.value)]  # type: ignore[attr-defined]
    # finding comments in all of a file takes long
    last = max((s.end_lineno or 0 for s in numbers), default=0)
    tokens = takewhile(
        lambda token: token.start[0] <= last, tokenize.generate_tokens(io.StringIO(text).readline)
    )
    texts = {
        token.start[0]: token.string.lstrip("# ")
        for token in tokens
        if token.type == tokenize.COMMENT
    }
    lines = text.splitlines()
    whole = {line for line in texts if lines[line - 1].startswith("#")}
    for statement, next_statement in zip_longest(statements, statements[1:]):
        if statement not in numbers:
            continue
        comments_above, first = [], statement.lineno - 1
        while first in whole:
            comments_above.insert(0, texts[first])
            first -= 1
        comments_behind = [
            texts[line]
            for line in range(statement.lineno, (statement.end_lineno or 0) + 1)
            if line in texts
        ]
        comments_below = (
            [next_statement.value.value]
            if isinstance(next_statement, ast.Expr)
            and isinstance(next_statement.value, ast.Constant)
            else []
        )
        place = file.relative_to(PACKAGE).as_posix()
        reason = " ".join(map(str, [*comments_above, *comments_behind, *comments_below]))
        yield Constant(place, list_names(statement), ast.unparse(statement.value), reason)


def list_names(statement: ast.stmt) -> tuple[str, ...]:
    """List the names in capitals to which a statement gives values."""
    if not isinstance(statement, (ast.Assign, ast.AnnAssign)) or statement.value is None:
        return ()
    target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
    names = target.elts if isinstance(target, ast.Tuple) else [target]
    return tuple(name.id for name in names if isinstance(name, ast.Name) and name.id.isupper())


def is_number(value: ast.expr | None) -> bool:
    """Return whether an expression is a number, several, or made of numbers.

    Functions and operators make it of nothing else.
    """
    if isinstance(value, ast.Constant):
        return isinstance(value.value, (int, float)) and not isinstance(value.value, bool)
    if isinstance(value, ast.Tuple):
        return bool(value.elts) and all(map(is_number, value.elts))
    if isinstance(value, ast.Call):
        return bool(value.args) and all(map(is_number, value.args))
    if isinstance(value, ast.BinOp):
        return is_number(value.left) and is_number(value.right)
    return isinstance(value, ast.UnaryOp) and is_number(value.operand)


def describe_constants() -> str:
    """Describe every named number, a table a package.

    A row has its value, its file, and what it does.
    """
    text = (
        "# Constants\n\nEvery number that has a name in the code, with its unit and its reason. "
        "What a user may want to change is a "
        "[setting](settings.md) instead.\n"
    )
    for room, room_constants in groupby(list_constants(), lambda constant: constant.room):
        text += f"\n## {room}\n\n"
        text += "| names | value | file | unit, what it does, why |\n| --- | --- | --- | --- |\n"
        text += "".join(
            f"| {', '.join(f'`{name}`' for name in c.names)} | `{make_cell(c.value)}` | {c.file} | "
            f"{make_cell(c.why)} |\n"
            for c in room_constants
        )
    return text


def make_cell(text: str) -> str:
    """Return a text as a table's cell holds it."""
    return text.replace("|", "\\|").replace("\n", " ")


PAGES = {
    "commands.md": describe_commands,
    "settings.md": describe_settings,
    "constants.md": describe_constants,
}
