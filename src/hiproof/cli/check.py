"""`hiproof check`: which solids of a file are valid, and why the others are not."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer

from ..log import count_things
from ..read.damage import SkippedBuildings


def check(
    files: Annotated[list[Path], typer.Argument(help="CityJSON, CityJSONSeq or CityGML files")],
    planarity: Annotated[
        float, typer.Option(min=0.0, help="largest distance of a vertex from its face's plane, m")
    ] = 0.01,
) -> None:
    """Check solids for validity by ISO 19107 (val3dity's codes); exit code 1 if any is invalid or
    cannot be read."""
    raise typer.Exit(1 if count_invalid(files, planarity) else 0)


def count_invalid(files: list[Path], planarity_m: float) -> int:
    """How many solids of `files` are invalid or damaged; prints a line for each of them and a count
    a file."""
    from ..compose import check_solid
    from ..read.solids import read_solids

    invalid = 0
    for path in files:
        codes: Counter[int] = Counter()
        total = bad = 0
        left_out = SkippedBuildings()
        for id, solid in read_solids(path, left_out):
            total += 1
            findings = check_solid(solid, planarity_m=planarity_m)
            if findings:
                bad += 1
                codes.update({finding.code for finding in findings})
                typer.echo(
                    f"{path}: {id}: " + "; ".join(finding.message for finding in findings[:3])
                )
        by_code = "".join(f", {number} with code {code}" for code, number in sorted(codes.items()))
        by_code += left_out.describe()
        typer.echo(
            f"{path}: {count_things(total, 'solid')}, {total - bad} valid, {bad} invalid{by_code}"
        )
        invalid += bad + left_out.count
    return invalid
