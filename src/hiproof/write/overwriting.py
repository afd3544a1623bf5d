"""Whether a file to write stands for an input or for a file of a run."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import OutputError
from ..formats import FORMATS

RUN_RECORD = "run.json"  # what every run keeps beside its models
PARAMETERS = FORMATS["parameters"].file
OWN_FILES = frozenset(
    [format.file for format in FORMATS.values() if format.fragment]
    + [RUN_RECORD, "changes.csv", "changes.gpkg", "edits.jsonl"]
)
"""Files of a run's folder that no other command makes again."""


def refuse_overwriting(outputs: Iterable[Path], inputs: Iterable[Any]) -> None:
    """Raise OutputError where a file to write is one that is read.

    `inputs` may be folders, addresses and None, which are no files.
    """
    files = [Path(str(path)) for path in inputs if path and is_file(str(path))]
    for out in map(Path, outputs):
        if out.exists() and any(out.samefile(file) for file in files):
            raise OutputError(
                f"expected another file to write than the one that is read, got {out} for both; "
                "name a new one"
            )


def refuse_run_file(out: Path) -> None:
    """Raise OutputError where a file to write is a run's own."""
    path = Path(os.path.realpath(out))
    is_own = path.name in OWN_FILES and (path.with_name(RUN_RECORD)).exists()
    if path.is_file() and (is_own or path.name == PARAMETERS or ".hiproof" in path.parts):
        raise OutputError(
            f"expected a new file to write, got {out}, which is a file of a run; choose another "
            "name"
        )


def is_file(path: str) -> bool:
    with suppress(OSError, ValueError):  # an address may be too long for a path
        return Path(path).is_file()
    return False
