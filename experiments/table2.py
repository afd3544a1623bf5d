"""Table 2: distance of points to models (PSD) and IoU of outlines.

It is per roof type and overall.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .data import RoofSample
from .judge import METHODS, NO_RANSAC, Verdict, judge_samples
from .output import Options, Result, Table

COLUMNS = (
    "method",
    "type",
    "roofs",
    "PSD mean",
    "PSD std",
    "median of means",
    "p90 of means",
    "IoU mean",
)
NOTE = (
    "Metres; means over roofs of each roof's mean and standard deviation. Published: paper 0.0805 "
    "(910 other RoofN3D roofs), RoofN3DNet 0.162 mean, 0.088 median, 0.295 p90 (the New York "
    "roofs). The paper's objective gets the roof's points and type alone (its network's part), "
    "the others all points. RANSAC's surfaces are the convex hulls of its planes' points, as many "
    "planes as it likes, and no closed model; its PSD is that of patches, not of buildings."
)
UNEXPLAINED_M = 0.2


def run(options: Options) -> Result:
    """Run all methods on all data sets at hand."""
    tables, remarks = [], [NO_RANSAC]
    samples, verdicts = judge_samples(options)
    for name, roofs in samples.items():
        rows = [
            row for method in METHODS for row in make_rows(method, roofs, verdicts[name][method])
        ]
        tables.append(Table(name, COLUMNS, rows, NOTE))
        remarks.append(describe_unexplained(name, verdicts[name]["likelihood"]))
    data = ", ".join(f"{len(roofs)} {name}" for name, roofs in samples.items())
    return Result(
        "residuals and outlines", data, tuple(tables), remarks="\n\n".join(filter(None, remarks))
    )


def make_rows(
    method: str, samples: Sequence[RoofSample], verdicts: dict[int, Verdict]
) -> list[tuple]:
    """Return overall figures, then those by type.

    The type is the true one where it is known, else the one that the method chose.
    """
    groups: dict[str, list[Verdict]] = {"all": list(verdicts.values())}
    for index, verdict in verdicts.items():
        groups.setdefault(samples[index].type or verdict.type, []).append(verdict)
    return [
        (method, kind, *compute_figures(groups[kind]))
        for kind in ("all", *sorted(groups.keys() - {"all"}))
    ]


def compute_figures(verdicts: Sequence[Verdict]) -> tuple:
    means = np.array([verdict.psd_mean for verdict in verdicts])
    stds = np.array([verdict.psd_std for verdict in verdicts])
    ious = np.array([verdict.iou for verdict in verdicts])
    if not np.isfinite(means).any():
        return len(verdicts), None, None, None, None, float(ious.mean())
    middle, upper = np.nanpercentile(means, (50, 90))
    return (
        len(verdicts),
        float(np.nanmean(means)),
        float(np.nanmean(stds)),
        float(middle),
        float(upper),
        float(ious.mean()),
    )


def describe_unexplained(name: str, verdicts: dict[int, Verdict]) -> str:
    """Describe which roofs no single primitive fits."""
    unexplained = [i for i, verdict in verdicts.items() if not verdict.psd_mean <= UNEXPLAINED_M]
    if not unexplained:
        return f"{name}: a single primitive fits every roof within {UNEXPLAINED_M} m in the mean."
    listed = ", ".join(map(str, unexplained[:40])) + (" ..." if len(unexplained) > 40 else "")
    return (
        f"{name}: no single primitive comes within {UNEXPLAINED_M} m in the mean of "
        f"{len(unexplained)} of {len(verdicts)} roofs "
        f"(by their place in the data, from 0): {listed}."
    )
