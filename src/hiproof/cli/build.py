"""`hiproof build`: models of parameters, as written by a run or a person."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import escape_unseen
from ..log import count_things
from ..progress import show_progress
from ..settings import Changes


def print_shapes() -> None:
    from ..primitives.catalogue import CATALOGUE
    from ..primitives.parameters import list_parameters

    for name in CATALOGUE:
        click.echo(f"{name}: {', '.join(list_parameters(name))}")


def print_schema() -> None:
    from ..parametric.schema import schema_text

    click.echo(schema_text(), nl=False)


def build(parameters: Path, *, out: Path, changes: Changes | None = None) -> int:
    """Make all files of a run again from its parameters.jsonl.

    Change the file with any editor or program first: the new files follow it. Exit code: 0 all
    buildings were built, 1 an internal error, 2 some parameters make no valid solid, or unusable
    input.
    """
    from .running import graded_words

    with show_progress("build") as update:
        from ..parametric.run import build_file
        from ..update.change_tables import write_changes

        built = build_file(parameters, out, lambda done: update("build", done), changes)
        write_changes(out)
    for id, reason in built.not_built:
        click.echo(escape_unseen(f"not built: building {id}: {reason}"), err=True)
    click.echo(
        f"{count_things(built.buildings, 'building')}: "
        + ", ".join(f"{n} {code}" for code, n in built.by_status.most_common())
    )
    if built.by_quality:
        click.echo("quality: " + graded_words(built.by_quality))
    click.echo("models: " + ", ".join(map(str, built.models)))
    return built.exit_code
