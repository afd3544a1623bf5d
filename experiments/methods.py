"""The methods under comparison behind one verb.

Points go in, and bounded roof surfaces and parameters come out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import shapely

from hiproof.errors import FitError
from hiproof.evaluate.metrics import iou, plan_outline, psd
from hiproof.fit.paper import fit_paper
from hiproof.model import Fit
from hiproof.settings import Settings

OBJECTIVES = ("paper", "likelihood")


@dataclass(frozen=True)
class Model:
    """Roof surfaces (rings (m, 3)) and, of a parametric method, its `fit`.

    Both are in the frame of the points.
    """

    polygons: list[np.ndarray] = field(default_factory=list)
    fit: Fit | None = None

    def psd(self, points: np.ndarray) -> np.ndarray:
        """Return distances (n,) of points to the nearest surface."""
        return psd(self.polygons, points)

    def outline_iou(self, outline: shapely.Geometry) -> float:
        return iou(plan_outline(self.polygons), outline) if self.polygons else 0.0


def fit_model(
    method: str,
    points: np.ndarray,
    types: Sequence[str] | None = None,
    outline: shapely.Polygon | None = None,
) -> Model:
    """Fit a model to `points` (n, 3) by a method.

    It is "paper", "likelihood" or "ransac". The model is empty where the method finds none.
    """
    if method == "ransac":
        from .ransac import detect_planes

        return Model([plane.polygon(points) for plane in detect_planes(points)])
    try:
        if method == "paper":
            fit = fit_paper(points, types, outline)
        else:
            from hiproof.fit import fit_roof

            fit = fit_roof(points, outline, Settings.from_dict({"fit": {"types": types or ()}}))
    except FitError:
        return Model()
    return Model([fit.vertices[list(face)] for face in fit.faces], fit)


def run_in_parallel(function: Callable[..., Any], work: Iterable[tuple], jobs: int) -> list[Any]:
    """Return `function(*item)` for every item, in order.

    With several processes the work is shared in small chunks.
    """
    work = list(work)
    if jobs <= 1 or len(work) < 2:
        return [function(*item) for item in work]
    with ProcessPoolExecutor(jobs) as pool:
        return list(
            pool.map(function, *zip(*work, strict=True), chunksize=max(1, len(work) // (20 * jobs)))
        )
