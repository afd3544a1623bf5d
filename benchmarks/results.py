"""The page of figures, RESULTS.md.

usage: python -m benchmarks.results > benchmarks/RESULTS.md

The tables are those that benchmarks kept with `--record`. Date, commit and machine of the newest
one stand at the top, and a table of another day says so. A file of figures may also hold notes, and
names of columns: only these are shown.
"""

from __future__ import annotations

import importlib
import json
import textwrap
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

from .tables import FIGURES

HEAD = """# Figures

`python -m benchmarks.results` prints this page. With `--record` a benchmark measures its table
again. [HISTORY.md](HISTORY.md) lists what was tried.

Measured on {date}, the newest at commit {commit}, on {machine}, beside other work.
Figures of another day name it. Where sets have even and odd halves, even ones chose the constants.
"""
ORDER = (
    "delft",
    "roofer",
    "towns",
    "hand_drawn",
    "compounds",
    "curved",
    "overhangs",
    "bare_ground",
    "registration",
    "verdict",
    "changes",
    "campaign",
    "peer",
    "budget",
    "scaling",
    "city",
    "processors",
    "search_size",
)


def read_figures(folder: Path = FIGURES) -> dict[str, dict[str, Any]]:
    """Read the files of figures by benchmark, those of ORDER first."""
    paths = {path.stem: path for path in sorted(folder.glob("*.json"))}
    names = [name for name in ORDER if name in paths] + sorted(paths.keys() - set(ORDER))
    return {name: json.loads(paths[name].read_text(encoding="utf-8")) for name in names}


def describe_tables(
    command: str, tables: list[dict[str, Any]], newest: dict[str, Any]
) -> Iterator[str]:
    """Yield the lines of tables with the same columns, each row beside what it was measured by."""
    columns = tables[0]["columns"]
    runs = [
        " ".join(
            [f"`{t['arguments']}`"] * bool(t["arguments"])
            + [t["date"]] * (t["date"] != newest["date"])
        )
        for t in tables
    ]
    has_runs = len(tables) > 1
    yield "\n" + fill(command if has_runs else f"{command} {runs[0]}".rstrip()) + "\n"
    yield f"|{' arguments |' * has_runs} {' | '.join(columns)} |"
    yield "|" + "---|" * (len(columns) + has_runs)
    for run, table in zip(runs, tables, strict=True):
        for row in table["rows"]:
            yield f"|{f' {run} |' * has_runs} {' | '.join(row)} |"
            run = ""


def show_columns(table: dict[str, Any], names: list[str] | None) -> dict[str, Any]:
    """Return the table with the named columns, or with all where it has none of them."""
    indices = [k for k, column in enumerate(table["columns"]) if names and column in names]
    if not indices:
        return table
    rows = [[row[k] for k in indices] for row in (table["columns"], *table["rows"])]
    return {**table, "columns": rows[0], "rows": rows[1:]}


def fill(text: str) -> str:
    return textwrap.fill(text, 100, break_on_hyphens=False)


def describe_benchmark(name: str, figures: dict[str, Any], newest: dict[str, Any]) -> str:
    """Return the section of a benchmark: title, command, tables and notes."""
    title, command = figures.get("title"), figures.get("command", f"`python -m benchmarks.{name}`")
    if title is None:
        doc = importlib.import_module(f"benchmarks.{name}").__doc__ or ""
        title = doc.splitlines()[0].rstrip(".")
    lines = [f"\n## {title}"]
    shown = [show_columns(table, figures.get("show")) for table in figures["tables"]]
    for _, tables in groupby(shown, lambda table: table["columns"]):
        lines += describe_tables(command, list(tables), newest)
    notes = fill(" ".join(figures.get("notes", [])))
    return "\n".join([*lines, *(["", notes] if notes else [])]) + "\n"


def make_page(figures: dict[str, dict[str, Any]]) -> str:
    """Return the page of all figures."""
    tables = [table for kept in figures.values() for table in kept["tables"]]
    newest = max(tables, key=lambda table: table["date"])
    sections = [describe_benchmark(name, kept, newest) for name, kept in figures.items()]
    return HEAD.format(**newest) + "".join(sections)


if __name__ == "__main__":
    print(make_page(read_figures()), end="")
