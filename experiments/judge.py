"""One roof sample through one method: the figures behind Table 2 and Figure 6."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .data import ROOFN3D_TYPES, RoofSample, collect_samples
from .methods import fit_model, run_in_parallel
from .output import Options
from .ransac import is_available

METHODS = ("paper", "likelihood", *(("ransac",) if is_available() else ()))


@dataclass(frozen=True)
class Verdict:
    """Figures of one roof; NaN without a model.

    They are mean and standard deviation of the PSD over its points (m), and outline IoU.

    NaN without a model.
    """

    type: str
    psd_mean: float
    psd_std: float
    iou: float


def judge(method: str, sample: RoofSample) -> Verdict:
    """Fit a roof, and judge the fit on the roof's points.

    The likelihood and RANSAC see all points; the likelihood chooses among the whole catalogue. The
    paper's objective has its network before it: it is given the roof's points alone, and the type
    (the true one; where nobody knows it, the one that the likelihood prefers among RoofN3D's three,
    for J itself always prefers the type with more planes).
    """
    roof_points = sample.points[sample.is_roof]
    types, points = None, sample.points
    if method == "paper":
        points = roof_points
        prior = None if sample.type else fit_model("likelihood", points, ROOFN3D_TYPES).fit
        types = (sample.type or (prior.type if prior else "gable"),)
    model = fit_model(method, points, types)
    if not model.polygons:
        return Verdict("none", np.nan, np.nan, 0.0)
    distances = model.psd(roof_points)
    kind = model.fit.type if model.fit is not None else "planes"
    return Verdict(
        kind, float(distances.mean()), float(distances.std()), model.outline_iou(sample.outline)
    )


@lru_cache(maxsize=1)
def judge_samples(
    options: Options,
) -> tuple[dict[str, list[RoofSample]], dict[str, dict[str, dict[int, Verdict]]]]:
    """Return all data sets at hand, and the verdicts by method and index.

    The index is that of the sample. They are kept for the next call.
    """
    samples = collect_samples(options)
    verdicts: dict = {name: {} for name in samples}
    for name, roofs in samples.items():
        for method in METHODS:
            indices = [i for i in range(len(roofs)) if options.covers(method, i)]
            result = run_in_parallel(judge, [(method, roofs[i]) for i in indices], options.jobs)
            verdicts[name][method] = dict(zip(indices, result, strict=True))
    return samples, verdicts


NO_RANSAC = (
    ""
    if is_available()
    else "The RANSAC baseline is left out: pyransac3d (extra `experiments`) is not installed."
)
