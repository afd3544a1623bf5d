"""`hiproof attributes`: all attributes and tables, with unit and meaning."""

from __future__ import annotations

import click


def attributes() -> None:
    """Print every attribute and table of a run as Markdown.

    The lists give kind, unit and meaning of each.
    """
    from ..write.attribute_list import attributes_text

    click.echo(attributes_text(), nl=False)
