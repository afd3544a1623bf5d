"""The options and the table of figures that all benchmarks share.

Every benchmark prints rows of one table. With `--record` it keeps them in `figures/NAME.json`,
with its arguments, the date, the commit and the machine. `benchmarks.results` prints these files as
a page.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import subprocess
import sys
from pathlib import Path
from typing import Any

FIGURES = Path(__file__).with_name("figures")
OPTIONS: dict[str, dict[str, Any]] = {
    "count": {"type": int, "help": "buildings of each kind, or of a city"},
    "densities": {"type": float, "nargs": "+", "help": "points a square metre"},
    "first-seed": {"type": int, "help": "seed of the first building"},
    "most": {"type": int, "help": "at most so many buildings, drawn by a fixed chance"},
    "parity": {
        "choices": ("even", "odd"),
        "help": "take buildings with such a number; even ones chose the constants",
    },
    "processes": {"type": int, "help": "worker processes"},
    "seeds": {"type": int, "nargs": "+", "help": "seeds of the cities"},
    "worst": {"type": int, "help": "name so many of the worst buildings"},
}


def make_parser(doc: str | None, **defaults: Any) -> argparse.ArgumentParser:
    """Make a parser with `--record` and those of OPTIONS that have a default here."""
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--record", action="store_true", help="keep the table for RESULTS.md")
    for name, default in defaults.items():
        option = name.replace("_", "-")
        parser.add_argument(f"--{option}", default=default, **OPTIONS[option])
    return parser


class FigureTable:
    """A table whose rows are printed as they come, and kept at the end if `is_kept`."""

    def __init__(self, is_kept: bool, *columns: str) -> None:
        self.is_kept, self.columns, self.rows = is_kept, columns, []
        self.print_row(columns)
        self.print_row(["---"] * len(columns))

    def print_row(self, cells: Any) -> None:
        print("| " + " | ".join(cells) + " |", flush=True)

    def add(self, *cells: object) -> None:
        """Print a row; floats are rounded to four significant digits."""
        texts = [f"{cell:.4g}" if isinstance(cell, float) else str(cell) for cell in cells]
        self.print_row(texts)
        self.rows.append(texts)

    def __enter__(self) -> FigureTable:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self.is_kept and kind is None:
            name = Path(sys.argv[0]).stem
            keep(FIGURES / f"{name}.json", describe_run(), self.columns, self.rows)


def describe_run() -> dict[str, str]:
    """Describe when, where and by which arguments this process measures."""
    words = [word for word in sys.argv[1:] if word != "--record"]
    commit = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=True
    ).stdout.strip()
    machine = f"{os.cpu_count()} cores ({platform.machine()})"
    date = datetime.datetime.now(datetime.UTC).date().isoformat()
    return {"arguments": " ".join(words), "date": date, "commit": commit, "machine": machine}


def keep(path: Path, run: dict[str, str], columns: Any, rows: list[list[str]]) -> None:
    """Write a table to a file of figures in place of the one by the same arguments."""
    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {"tables": []}
    table = {**run, "columns": list(columns), "rows": rows}
    names = [other["arguments"] for other in kept["tables"]]
    if run["arguments"] in names:
        kept["tables"][names.index(run["arguments"])] = table
    else:
        kept["tables"].append(table)
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
