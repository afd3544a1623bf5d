"""`hiproof settings`: every setting with its default, unit, bounds and meaning."""

from __future__ import annotations

from pathlib import Path

import click

from ..errors import OutputError
from ..settings import Settings


def settings(*, config: Path | None = None, write: Path | None = None) -> None:
    """Print every setting as TOML, with its default, unit, bounds and meaning.

    Keep the file as hiproof.toml next to your data, or pass it with `--config`.
    """
    text = (Settings.from_toml(config) if config else Settings()).to_toml()
    if write is None:
        click.echo(text, nl=False)
        return
    from ..write.files import refuse_overwriting

    refuse_overwriting([write], [config])
    try:
        write.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(
            f"expected to write settings to {write}, got: {error}; choose another place"
        ) from error
