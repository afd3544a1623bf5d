"""Volumes, types, surfaces and standard deviations of simulated compound roofs.

usage: python -m benchmarks.compounds [--each 20] [--densities 2 5 10] [--kinds L T ...]
[--first-seed 0]

Simulated buildings (simulate/compounds.py) are scanned without defects of the scene, fitted under
their footprint and compared with the truth on a 0.2 m raster:

    volumes   buildings with the true number of parts; equal houses of a row may be one
    types     those with that number, and each true part found (matching.py) and called by its type
    RMSE      over the whole roof (m), and without the cells within 0.5 m of a step
    sigmas    RMS of error over standard deviation by parameter of parts found with their type; in
              brackets from the median, which a few blunders do not move
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import shapely
from scipy import ndimage

from hiproof.fit.roof import BuildingFit, fit_building
from hiproof.model import Part, Roof
from hiproof.simulate import COMPOUND_KINDS, ScanSettings, SimBuilding, random_compound, scan
from hiproof.simulate.scene import Defects

from .judging import RASTER_M, make_raster
from .matching import (
    compute_sigma_errors,
    has_hidden_end,
    list_right_types,
    match_parts,
    merge_alike,
)
from .tables import FigureTable, make_parser

STEP_M, NEAR_STEP_CELLS, NEAR_M = 0.4, 3, 0.1
MEDIAN_OF_ABSOLUTE_NORMAL = 0.6745


@dataclass(frozen=True)
class Outcome:
    """RMSE (m), numbers of parts, and errors over sigma by parameter of one compound."""

    rmse: float
    rmse_away_from_steps: float
    parts: int
    wanted: int
    types_right: bool
    ratios: tuple[tuple[str, float], ...]


def measure_errors(truth: Roof, fit: BuildingFit) -> tuple[float, float]:
    """Return the RMSE (m) over the roof, and that away from the true roof's steps."""
    x0, y0, x1, y1 = truth.outline.bounds
    x, y = np.meshgrid(np.arange(x0, x1, RASTER_M), np.arange(y0, y1, RASTER_M), indexing="ij")
    xy, shape = np.column_stack([x.ravel(), y.ravel()]), x.shape
    inside = shapely.contains_xy(truth.outline, xy[:, 0], xy[:, 1])
    z_true = np.where(inside, truth.height_at(xy), np.nan).reshape(shape)
    z_fit = Roof(fit.roof_parts, fit.outline, truth.frame).height_at(xy).reshape(shape)
    jumps = np.zeros(shape, bool)
    for axis in range(2):
        jump = np.abs(np.diff(z_true, axis=axis)) > STEP_M
        jumps |= np.pad(jump, [(0, 1) if a == axis else (0, 0) for a in range(2)])
    height_error = ~ndimage.binary_dilation(jumps, iterations=NEAR_STEP_CELLS)
    gap = z_fit - z_true
    is_known = np.isfinite(gap)
    return float(np.sqrt(np.mean(gap[is_known] ** 2))), float(
        np.sqrt(np.mean(gap[is_known & height_error] ** 2))
    )


def draw_compound(kind: str, density: float, seed: int) -> tuple[SimBuilding, np.ndarray]:
    """Draw a compound of `kind` by a seed, and its points (n, 3) in its frame."""
    rng = np.random.default_rng([seed, COMPOUND_KINDS.index(kind)])
    building = random_compound(rng, kind)
    cloud = scan(building, rng, ScanSettings(density=density, defects=Defects.none()))
    return building, building.roof.frame.to_local(cloud.points[cloud.source != 2])


def compare_parts(
    truth: Roof, parts: tuple[Part, ...]
) -> tuple[int, bool, list[tuple[str, float]]]:
    """Return the true number of parts, whether all are right, and errors in sigmas."""
    as_built = len(parts) == len(truth.parts)
    true_parts = list(truth.parts) if as_built else merge_alike(truth.parts)
    right, ratios = len(parts) == len(true_parts), []
    for k, index in enumerate(match_parts(true_parts, parts, make_raster(truth.outline))):
        hidden = has_hidden_end(true_parts[k], true_parts[:k] + true_parts[k + 1 :])
        right &= index >= 0 and parts[index].type in list_right_types(true_parts[k], hidden)
        if index >= 0:
            ratios += compute_sigma_errors(true_parts[k], parts[index], hidden).items()
    return len(true_parts), right, ratios


def judge_compound(kind: str, density: float, seed: int) -> Outcome:
    building, points = draw_compound(kind, density, seed)
    fit = fit_building(points, building.outline)
    n_true, right, ratios = compare_parts(building.roof, fit.roof_parts)
    return Outcome(
        *measure_errors(building.roof, fit), len(fit.roof_parts), n_true, right, tuple(ratios)
    )


COLUMNS = (
    "points/m2, kind",
    "volumes right, %",
    "types right, %",
    "RMSE, m: median",
    f"under {NEAR_M} m, %",
    "without steps: median",
    "of these under, %",
    "parts of true",
)


def make_cells(outcomes: list[Outcome]) -> list[str]:
    """Return the cells of COLUMNS but the first."""
    whole, plain, parts, n_true, types = np.array(
        [(o.rmse, o.rmse_away_from_steps, o.parts, o.wanted, o.types_right) for o in outcomes]
    ).T
    return [
        f"{100 * np.mean(parts == n_true):.1f}",
        f"{100 * types.mean():.1f}",
        f"{np.median(whole):.3f}",
        f"{100 * np.mean(whole < NEAR_M):.1f}",
        f"{np.median(plain):.3f}",
        f"{100 * np.mean(plain < NEAR_M):.1f}",
        f"{parts.mean():.2f} of {n_true.mean():.2f}",
    ]


def report_sigmas(outcomes: Iterable[Outcome]) -> str:
    ratios = defaultdict(list)
    for name, ratio in (pair for outcome in outcomes for pair in outcome.ratios):
        ratios[name].append(ratio)
    columns = []
    for name, values in sorted(ratios.items()):
        robust = np.median(np.abs(values)) / MEDIAN_OF_ABSOLUTE_NORMAL
        columns.append(
            f"{name} {np.sqrt(np.mean(np.square(values))):.2f} ({robust:.2f}; {len(values)})"
        )
    return "errors over sigma, RMS (robust; count): " + (
        ", ".join(columns) or "no part has standard deviations"
    )


def main() -> None:
    parser = make_parser(__doc__, densities=[2.0, 5.0, 10.0], first_seed=0)
    parser.add_argument("--each", type=int, default=20, help="buildings a kind and density")
    parser.add_argument("--kinds", nargs="+", choices=COMPOUND_KINDS, default=COMPOUND_KINDS)
    a = parser.parse_args()
    seeds = range(a.first_seed, a.first_seed + a.each)
    with FigureTable(a.record, *COLUMNS) as table:
        for density in a.densities:
            total = []
            for kind in a.kinds:
                outcomes = [judge_compound(kind, density, seed) for seed in seeds]
                total += outcomes
                print(f"  {density:g} {kind}: " + " | ".join(make_cells(outcomes)), flush=True)
            table.add(f"{density:g}, all", *make_cells(total))
            print(f"  {report_sigmas(total)}", flush=True)


if __name__ == "__main__":
    main()
