"""`hiproof settings`: every setting with its default, unit, bounds and meaning."""

from __future__ import annotations

from pathlib import Path

from ..errors import OutputError
from ..settings import Settings


def run(config: Path | None, write: Path | None) -> int:
    text = (Settings.from_toml(config) if config else Settings()).to_toml()
    if write is None:
        print(text, end="")
        return 0
    try:
        write.write_text(text)
    except OSError as error:
        raise OutputError(f"expected to write settings to {write}, got: {error}; choose another place") from error
    return 0
