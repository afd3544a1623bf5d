"""`hiproof settings`: every setting with its default, unit, bounds and meaning."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import HiproofError, OutputError
from ..settings import Settings


def settings(*, config: Path | None = None, write: Path | None = None) -> None:
    """Print every setting as TOML, with its default, unit, bounds and meaning.

    Keep the file as hiproof.toml next to your data, or pass it with `--config`.
    """
    text = (Settings.from_toml(config) if config else Settings()).to_toml()
    if write is None:
        click.echo(text, nl=False)
        return
    from ..write.files import refuse_overwriting, save_text

    refuse_overwriting([write], [config])
    try:
        if write.is_file():
            Settings.from_toml(write)
    except HiproofError as error:
        raise OutputError(
            f"expected a new file or one of settings to write, got {write}; choose another name"
        ) from error
    save_text(write, text)
