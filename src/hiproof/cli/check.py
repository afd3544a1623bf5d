"""`hiproof check`: which solids of a file are valid, and why the others are not."""

from __future__ import annotations

from collections import Counter
from pathlib import Path


def run(files: list[Path], planarity_m: float) -> int:
    """Print a line for each invalid solid and a count a file; 1 if any solid is invalid, else 0."""
    from ..compose import check_solid
    from ..read.solids import read_solids

    invalid = 0
    for path in files:
        codes: Counter[int] = Counter()
        total = bad = 0
        for id, solid in read_solids(path):
            total += 1
            findings = check_solid(solid, planarity_m=planarity_m)
            if findings:
                bad += 1
                codes.update({finding.code for finding in findings})
                print(f"{path}: {id}: " + "; ".join(finding.message for finding in findings[:3]))
        by_code = "".join(f", {number} with code {code}" for code, number in sorted(codes.items()))
        print(f"{path}: {total} solids, {total - bad} valid, {bad} invalid{by_code}")
        invalid += bad
    return 1 if invalid else 0
