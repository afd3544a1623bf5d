"""`hiproof settings`: every setting with its default, unit, bounds and meaning."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import OutputError
from ..settings import Settings


def settings(
    config: Annotated[Path | None, typer.Option(help="start from this settings file")] = None,
    write: Annotated[
        Path | None, typer.Option(help="write the TOML here instead of printing it")
    ] = None,
) -> None:
    """Print every setting as TOML, with default, unit, bounds and meaning."""
    text = (Settings.from_toml(config) if config else Settings()).to_toml()
    if write is None:
        typer.echo(text, nl=False)
        return
    try:
        write.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(
            f"expected to write settings to {write}, got: {error}; choose another place"
        ) from error
