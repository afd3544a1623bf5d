"""`hiproof check`: which solids of a file are valid, and why the others are not."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from ..errors import escape_unseen
from ..log import count_things
from ..progress import Update, show_progress


@dataclass
class CheckedFile:
    """The result of checking a file: counts, and solids by the rules (val3dity) they break."""

    path: Path
    solids: int = 0
    damaged: int = 0
    by_code: Counter[int] = field(default_factory=Counter)
    findings: list[tuple[str, tuple[Any, ...]]] = field(default_factory=list)

    @property
    def invalid(self) -> int:
        return len(self.findings)

    def describe(self) -> str:
        """Count the solids in a line."""
        codes = "".join(f", {n} with code {code}" for code, n in sorted(self.by_code.items()))
        damaged = (
            f", {count_things(self.damaged, 'damaged building')} left out" if self.damaged else ""
        )
        return (
            f"{self.path}: {count_things(self.solids, 'solid')}, {self.solids - self.invalid} "
            f"valid, {self.invalid} invalid{codes}{damaged}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the same for `--json`, with every finding."""
        return {
            "file": str(self.path),
            "solids": self.solids,
            "valid": self.solids - self.invalid,
            "invalid": self.invalid,
            "damaged": self.damaged,
            "by_code": {str(code): n for code, n in sorted(self.by_code.items())},
            "findings": [
                {"id": id, "code": finding.code, "message": finding.message}
                for id, findings in self.findings
                for finding in findings
            ],
        }


def check(files: list[Path], *, planarity: float = 0.01, as_json: bool = False) -> int:
    """Check that solids are valid by ISO 19107, with val3dity's codes.

    Exit code: 0 all solids are valid, 1 some are invalid or cannot be read, 2 unusable input.
    """
    say = click.echo if not as_json else lambda text: None
    with show_progress("check") as update:
        checked = [check_file(path, planarity, say, update) for path in files]
    if as_json:
        result = {"valid": not count_bad(checked), "files": [file.to_dict() for file in checked]}
        click.echo(json.dumps(result, indent=1))
    return 1 if count_bad(checked) else 0


def count_bad(checked: list[CheckedFile]) -> int:
    """Count the solids that are invalid and the buildings that are damaged."""
    return sum(file.invalid + file.damaged for file in checked)


def check_file(
    path: Path,
    planarity_m: float,
    say: Callable[[str], None] = click.echo,
    update: Update = lambda *_: None,
) -> CheckedFile:
    """Print a line for each invalid solid of a file, and a count at the end."""
    from ..compose import check_solid
    from ..read.models.damage import SkippedBuildings
    from ..read.models.solids import read_solids

    result, left_out = CheckedFile(path), SkippedBuildings()
    for id, solid in read_solids(path, left_out):
        result.solids += 1
        update("check", result.solids)
        findings = check_solid(solid, planarity_m=planarity_m)
        if findings:
            result.findings.append((id, findings))
            result.by_code.update({finding.code for finding in findings})
            text = "; ".join(finding.message for finding in findings[:3])
            say(escape_unseen(f"{path}: {id}: {text}"))
    result.damaged = left_out.count
    say(result.describe())
    return result
