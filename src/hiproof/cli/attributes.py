"""`hiproof attributes`: every attribute and table of a run's files, with unit and meaning."""

from __future__ import annotations

import typer


def attributes() -> None:
    """Print every attribute and table that a run writes, with kind, unit and meaning, as
    Markdown."""
    from ..write.attribute_list import attributes_text

    typer.echo(attributes_text(), nl=False)
