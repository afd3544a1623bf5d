"""`hiproof check`: which solids of a file are valid, and why the others are not."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click

from ..data_files import Values
from ..errors import escape_unseen
from ..log import count_things
from ..progress import Update, show_progress
from ..read.models.damage import SkippedBuildings


@dataclass
class CheckedFile:
    """The result of checking a file: counts, and solids by the rules (val3dity) they break."""

    path: Path
    damaged: SkippedBuildings = field(default_factory=SkippedBuildings)
    solids: int = 0
    findings: list[tuple[str, tuple[Any, ...]]] = field(default_factory=list)

    def to_dict(self) -> Values:
        """Return the counts for `--json`, with every finding."""
        by_code = Counter(
            code for _, findings in self.findings for code in {finding.code for finding in findings}
        )
        return {
            "file": str(self.path),
            "solids": self.solids,
            "valid": self.solids - len(self.findings),
            "invalid": len(self.findings),
            "damaged": self.damaged.count,
            "by_code": {str(code): n for code, n in sorted(by_code.items())},
            "findings": [
                {"id": id, "code": finding.code, "message": finding.message}
                for id, findings in self.findings
                for finding in findings
            ],
        }

    def describe(self) -> str:
        """Count the solids in a line."""
        counts = self.to_dict()
        codes = "".join(f", {n} with code {code}" for code, n in counts["by_code"].items())
        return (
            f"{self.path}: {count_things(self.solids, 'solid')}, {counts['valid']} valid, "
            f"{counts['invalid']} invalid{codes}{self.damaged.describe()}"
        )


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
    return sum(len(file.findings) + file.damaged.count for file in checked)


def check_file(
    path: Path,
    planarity_m: float,
    say: Callable[[str], None] = click.echo,
    update: Update = lambda *_: None,
) -> CheckedFile:
    """Print a line for each invalid solid of a file, and a count at the end."""
    from ..compose import check_solid
    from ..read.models.solids import read_solids

    result = CheckedFile(path)
    for id, solid in read_solids(path, result.damaged):
        result.solids += 1
        update("check", result.solids)
        findings = check_solid(solid, planarity_m=planarity_m)
        if findings:
            result.findings.append((id, findings))
            text = "; ".join(finding.message for finding in findings[:3])
            say(escape_unseen(f"{path}: {id}: {text}"))
    say(result.describe())
    return result
