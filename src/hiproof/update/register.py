"""The common shift between two surveys, and how much unchanged roofs differ.

New points lie over the earlier roofs by dz - a dx - b dy, where (a, b) is the roof's slope and (dx,
dy, dz) the shift. A robust least squares over a sample of buildings tells it; whole buildings that
changed are outliers. A hash of places draws the sample: it does not depend on tiles.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import shapely

from ..city.plan.registration import SAMPLE_CELL_M, hash_cell
from ..city.plan.work_plan import WorkPlan
from ..model import Roof
from .cells import SurveyNoise, compare_points, select_inner, shrink_outline
from .clusters import flag_cells
from .residuals import find_slopes, measure_residuals

MOST_POINTS = 400
"""Points of a building that are used: more tell the roof's own errors rather than the shift."""

SHIFT_SCALES_M = (1.0, 0.5, 0.25)
"""Residuals beyond are outliers, from coarse to fine (m)."""

PRIOR_M = 0.2
"""Standard deviation (m) of the horizontal shift before any roof is seen; flat roofs tell none."""

ROOF_ERROR_M = 0.05
"""Standard deviation (m) of what points say of a building: that of two strips."""

CLEAR_SIGMAS = 3.0
"""A shift smaller than so many of its standard deviations is not applied."""

FEWEST_ROOFS = 8
"""Roofs from which on their noise is estimated rather than assumed."""

CHANGED_SHARE = 0.3
"""Share of the roofs that may have changed: those with the most stray cells do not count."""

LEAST_M = 0.02
"""Least noise (m): coordinates come in centimetres."""


ENOUGH_ROOFS = 60
"""Sampled roofs: they tell the shift within a centimetre, and their noise to a tenth of it."""


class SampledRoof(NamedTuple):
    """A building's earlier roof, with points (n, 3) of both surveys.

    Points are in the roof's frame, `old` is None where unknown.
    """

    roof: Roof
    old: np.ndarray | None
    new: np.ndarray


@dataclass(frozen=True)
class SurveyShift:
    """How far (x, y, z in m) the new survey lies beside the earlier one.

    `sigma` has the standard deviations.

    `roofs` tell of it, and `noise` is what is left between unchanged ones.
    """

    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    sigma: tuple[float, float, float] = (PRIOR_M, PRIOR_M, ROOF_ERROR_M)
    roofs: int = 0
    noise: SurveyNoise = field(default_factory=SurveyNoise)

    @property
    def clear_xyz(self) -> np.ndarray:
        """What (3,) is taken off the new points: the shift where it is clear."""
        xyz, sigma = np.array(self.xyz), np.array(self.sigma)
        return np.where(np.abs(xyz) > CLEAR_SIGMAS * sigma, xyz, 0.0)

    def to_dict(self) -> dict[str, Any]:
        """Return the shift for JSON."""
        return dataclasses.asdict(self) | {"applied": self.clear_xyz.tolist()}

    @staticmethod
    def from_dict(record: dict[str, Any]) -> SurveyShift:
        """Read what `to_dict` gave."""
        noise = SurveyNoise(**record["noise"])
        return SurveyShift(
            tuple(record["xyz"]), tuple(record["sigma"]), int(record["roofs"]), noise
        )


def draw_buildings(plan: WorkPlan) -> set[int]:
    """Return the numbers of the sampled buildings.

    Their order follows from their places alone: by the hash of their square, then by place.
    """
    jobs = [job for job in plan.jobs if not job.area.is_empty]
    lower = shapely.bounds([job.area for job in jobs]).reshape(-1, 4)[:, :2]
    squares = np.floor(lower / SAMPLE_CELL_M).astype(np.int64)
    order = sorted(
        range(len(jobs)), key=lambda k: (hash_cell(tuple(squares[k].tolist())), *lower[k].tolist())
    )
    return {jobs[k].index for k in order[:ENOUGH_ROOFS]}


def register_surveys(samples: Iterable[SampledRoof]) -> SurveyShift:
    """Estimate the shift of the new points of `samples` from the earlier ones."""
    samples = list(samples)
    rows = [row for row in map(make_rows, samples) if len(row[0])]
    if not rows:
        return SurveyShift()
    shift, sigma = solve_shift(rows)
    found = SurveyShift(
        tuple(np.round(shift, 4).tolist()), tuple(np.round(sigma, 4).tolist()), len(rows)
    )
    moved = [s._replace(new=s.new - found.clear_xyz) for s in samples]
    return dataclasses.replace(found, noise=measure_noise(moved))


def make_rows(sample: SampledRoof) -> tuple[np.ndarray, np.ndarray]:
    """Return the design (n, 3) and the residuals (n,) of a building's new points.

    What the earlier roof itself is off its own points is taken off.
    """
    roof, old, new = sample
    inner = shrink_outline(roof.outline)
    points, residuals = select_inner(roof, inner, new)
    if old is not None:
        own = select_inner(roof, inner, old)[1]
        residuals = residuals - (np.median(own) if len(own) else np.nan)
    step = max(1, len(points) // MOST_POINTS)
    points, residuals = points[::step], residuals[::step]
    slopes = find_slopes(roof, points[:, :2])
    known = np.isfinite(slopes).all(axis=1) & np.isfinite(residuals)
    return np.column_stack([-slopes, np.ones(len(slopes))])[known], residuals[known]


def solve_shift(rows: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Return the shift (3,) and its standard deviations from the rows of buildings.

    Every building has the weight of one observation of ROOF_ERROR_M; errors of its points go
    together, so the variance is that between buildings (a sandwich estimate).
    """
    prior = np.diag([PRIOR_M**-2, PRIOR_M**-2, 0.0])
    heights = [float(np.median(residuals)) for _, residuals in rows]
    shift = np.array([0.0, 0.0, float(np.median(heights))])
    for scale in (*SHIFT_SCALES_M, *SHIFT_SCALES_M[-1:] * 2):
        normal, right, gradients = prior.copy(), np.zeros(3), []
        for design, residuals in rows:
            misfit = residuals - design @ shift
            weight = np.maximum(1 - (misfit / scale) ** 2, 0.0) ** 2
            weight /= ROOF_ERROR_M**2 * len(residuals)
            normal += design.T @ (weight[:, None] * design)
            gradients.append(design.T @ (weight * misfit))
            right += gradients[-1]
        right -= prior @ shift
        inverse = np.linalg.inv(normal + 1e-9 * np.eye(3))
        shift = shift + inverse @ right
    between = np.array(gradients).T @ np.array(gradients) + prior
    covariance = inverse @ between @ inverse
    return shift, np.sqrt(np.diag(covariance) + ROOF_ERROR_M**2 / len(rows) / 4)


def measure_noise(samples: list[SampledRoof]) -> SurveyNoise:
    """Measure how much unchanged roofs differ.

    Most roofs are unchanged, so medians tell it.
    """
    usual = SurveyNoise()
    if len(samples) < FEWEST_ROOFS:
        return usual
    scatter, differences, middles, strays = [], [], [], []
    for sample in samples:
        c = compare_points(*sample, usual)
        compared = c.is_compared
        if compared.sum() < 4:
            continue
        d, expected = c.difference[compared], c.sigma[compared] ** 2 - usual.cell**2
        middles.append(float(np.median(d)))
        differences.append((d - middles[-1]) ** 2 / 0.455 - expected)
        strays.append(float(flag_cells(c).sum() / compared.sum()))
        scatter.append(measure_scatter(c.points, c.number, sample.roof))
    if len(middles) < FEWEST_ROOFS:
        return usual
    cell = np.sqrt(max(float(np.median(np.concatenate(differences))), LEAST_M**2))
    middle = np.median(np.abs(np.array(middles) - np.median(middles))) * 1.4826
    point = np.nanmedian(scatter)
    usual_strays = np.sort(strays)[: max(1, round((1 - CHANGED_SHARE) * len(strays)))]
    values = {"point": point, "cell": cell, "roof": max(middle, LEAST_M)}
    rounded = {name: round(max(float(v), LEAST_M), 4) for name, v in values.items()}
    return SurveyNoise(**rounded, stray=round(float(np.mean(usual_strays)), 5))


def measure_scatter(points: np.ndarray, number: np.ndarray, roof: Roof) -> float:
    """Return the scatter (m) of points (n, 3) about the median of their cell (n,)."""
    residuals = measure_residuals(roof, points)
    order = np.lexsort([residuals, number])
    number, residuals = number[order], residuals[order]
    same = number[1:] == number[:-1]
    if not same.any():
        return float("nan")
    n = np.bincount(number)
    start = np.concatenate([[0], np.cumsum(n)])[:-1]
    has = n >= 3
    spread = residuals[start[has] + (3 * n[has]) // 4] - residuals[start[has] + n[has] // 4]
    return float(np.median(spread) / 1.349) if len(spread) else float("nan")
