"""The result of an experiment, and its files.

They are Markdown, CSV a table, and PNG a picture.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Options:
    """How to run an experiment.

    `quick` takes seconds, `data` overrides the data's place, `jobs` processes share the work.

    `paper_share` of the fits are made with the paper's objective too, which takes nine tenths of
    the time.
    """

    quick: bool = False
    data: Path | None = None
    seed: int = 2020
    jobs: int = 1
    paper_share: float = 1.0

    def covers(self, method: str, index: int) -> bool:
        """Return whether `method` takes the roof of this index.

        The paper's objective takes an even share of them.
        """
        if method != "paper":
            return True
        return int((index + 1) * self.paper_share) > int(index * self.paper_share)


@dataclass(frozen=True)
class Table:
    """Rows of numbers and words under `columns`.

    A number shows with three decimals, None as a dash.
    """

    title: str
    columns: tuple[str, ...]
    rows: Sequence[Sequence[Any]]
    note: str = ""

    def to_markdown(self) -> str:
        lines = [
            f"### {self.title}",
            "",
            "| " + " | ".join(self.columns) + " |",
            "|" + " --- |" * len(self.columns),
        ]
        lines += ["| " + " | ".join(map(format_value, row)) + " |" for row in self.rows]
        return "\n".join([*lines, *(("", self.note) if self.note else ())]) + "\n"

    def to_csv(self) -> str:
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.columns)
        writer.writerows(["" if value is None else value for value in row] for row in self.rows)
        return text.getvalue()


@dataclass(frozen=True)
class Result:
    """Tables and pictures of one experiment.

    Pictures are matplotlib figures by name.

    `data` says in words what it was run on.
    """

    title: str
    data: str
    tables: tuple[Table, ...]
    pictures: dict[str, Any] = field(default_factory=dict)
    remarks: str = ""


def format_value(value: Any) -> str:
    if value is None or value != value:
        return "–"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def write_result(name: str, result: Result, out: Path, options: Options, seconds: float) -> Path:
    """Write everything of `result` into the folder `out`.

    Returns the path of the Markdown file.
    """
    out.mkdir(parents=True, exist_ok=True)
    size = ", quick form" if options.quick else ""
    lines = [f"## {name}: {result.title}", "", f"Data: {result.data}", ""]
    if options.paper_share < 1:
        size += f"; the paper's objective on {options.paper_share:.0%} of the fits"
    lines += [f"Seed {options.seed}, {seconds:.0f} s with {options.jobs} processes{size}.", ""]
    for number, table in enumerate(result.tables, start=1):
        lines += [table.to_markdown()]
        (out / f"{name}_{number}.csv").write_text(table.to_csv())
    for picture, figure in result.pictures.items():
        figure.savefig(out / f"{picture}.png", dpi=110, bbox_inches="tight")
        lines += [f"![{picture}]({picture}.png)", ""]
    if result.remarks:
        lines += [result.remarks, ""]
    path = out / f"{name}.md"
    path.write_text("\n".join(lines))
    return path
