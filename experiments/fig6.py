"""Figure 6: the distributions of PSD and IoU over the roofs of Table 2."""

from __future__ import annotations

import numpy as np

from .charts import draw_distributions
from .judge import METHODS, NO_RANSAC, judge_samples
from .output import Options, Result, Table

SHARES = (5, 25, 50, 75, 95)


def run(options: Options) -> Result:
    """Return percentiles as tables, and curves as pictures, a pair a data set."""
    tables, pictures = [], {}
    samples, verdicts = judge_samples(options)
    for name in samples:
        psd = {
            m: np.array([verdict.psd_mean for verdict in verdicts[name][m].values()])
            for m in METHODS
        }
        iou = {
            m: np.array([verdict.iou for verdict in verdicts[name][m].values()]) for m in METHODS
        }
        tables.append(compute_percentiles(f"{name}: mean PSD of a roof, m", psd))
        tables.append(compute_percentiles(f"{name}: outline IoU", iou))
        stem = "fig6_" + name.split()[0].lower()
        pictures[f"{stem}_psd"] = draw_distributions(
            psd, "mean distance of a roof's points, m", 0.4
        )
        pictures[f"{stem}_iou"] = draw_distributions(iou, "outline IoU", 1.0)
    data = ", ".join(f"{len(roofs)} {name}" for name, roofs in samples.items())
    return Result("distributions of residuals and IoU", data, tuple(tables), pictures, NO_RANSAC)


def compute_percentiles(title: str, values: dict[str, np.ndarray]) -> Table:
    finite = {method: numbers[np.isfinite(numbers)] for method, numbers in values.items()}
    rows = [
        (method, *map(float, np.percentile(numbers, SHARES)))
        for method, numbers in finite.items()
        if len(numbers)
    ]
    return Table(title, ("method", *(f"p{share}" for share in SHARES)), rows)
