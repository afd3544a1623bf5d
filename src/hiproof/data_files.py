"""Tables that stand in files of `data`, beside the code."""

import tomllib
from importlib import resources
from typing import Any


def read_data_file(name: str) -> dict[str, Any]:
    """Read data/NAME.toml."""
    file = resources.files("hiproof") / "data" / f"{name}.toml"
    return tomllib.loads(file.read_text(encoding="utf-8"))
