"""Compound roofs with known truth: parts found and the surface's error, by kind of compound and density.

usage: python -m benchmarks.compounds [--each 20] [--densities 2 5 10]

Simulated buildings (L, T, U, cross, extension, two levels, saw-tooth hall, row) are scanned without defects of the scene,
fitted under their footprint and compared with the truth on a 0.2 m raster: RMSE over the whole roof, RMSE without the
cells within 0.5 m of a step of the true roof, and the number of parts.
"""

from __future__ import annotations

import argparse

import numpy as np
import shapely
from scipy import ndimage

from hiproof.fit.compound import CompoundFit, fit_building
from hiproof.model import Roof
from hiproof.simulate import ScanSettings, random_compound, scan
from hiproof.simulate.compounds import COMPOUND_KINDS
from hiproof.simulate.scene import Defects

RASTER_M, STEP_M, NEAR_STEP_CELLS = 0.2, 0.4, 3


def raster(outline: shapely.Polygon) -> tuple[np.ndarray, tuple[int, int]]:
    x0, y0, x1, y1 = outline.bounds
    x, y = np.meshgrid(np.arange(x0, x1, RASTER_M), np.arange(y0, y1, RASTER_M), indexing="ij")
    return np.column_stack([x.ravel(), y.ravel()]), x.shape


def errors(truth: Roof, fit: CompoundFit) -> tuple[float, float]:
    """RMSE (m) over the roof's raster, and over it without the surroundings of the true roof's steps."""
    xy, shape = raster(truth.outline)
    inside = shapely.contains_xy(truth.outline, xy[:, 0], xy[:, 1])
    z_true = np.where(inside, truth.height_at(xy), np.nan).reshape(shape)
    z_fit = Roof(fit.roof_parts, fit.outline, truth.frame).height_at(xy).reshape(shape)
    jumps = np.zeros(shape, bool)
    for axis in range(2):
        jump = np.abs(np.diff(z_true, axis=axis)) > STEP_M
        jumps |= np.pad(jump, [(0, 1) if a == axis else (0, 0) for a in range(2)])
    away = ~ndimage.binary_dilation(jumps, iterations=NEAR_STEP_CELLS)
    gap = z_fit - z_true
    known = np.isfinite(gap)
    return float(np.sqrt(np.mean(gap[known] ** 2))), float(np.sqrt(np.mean(gap[known & away] ** 2)))


def one(kind: str, density: float, seed: int) -> tuple[float, float, int, int]:
    rng = np.random.default_rng([seed, COMPOUND_KINDS.index(kind)])
    building = random_compound(rng, kind)
    cloud = scan(building, rng, ScanSettings(density=density, defects=Defects.none()))
    points = building.roof.frame.to_local(cloud.points[cloud.source != 2])
    fit = fit_building(points, building.outline)
    return (*errors(building.roof, fit), len(fit.roof_parts), len(building.roof.parts))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=20)
    parser.add_argument("--densities", type=float, nargs="+", default=[2.0, 5.0, 10.0])
    arguments = parser.parse_args()
    for density in arguments.densities:
        rows = []
        for kind in COMPOUND_KINDS:
            found = np.array([one(kind, density, seed) for seed in range(arguments.each)])
            rows.append(found)
            report(f"{density:g}/m2 {kind}", found)
        report(f"{density:g}/m2 all", np.concatenate(rows))


def report(name: str, found: np.ndarray) -> None:
    whole, away, parts, wanted = found.T
    print(
        f"{name:24s} RMSE median {np.median(whole):.3f}  under 0.1 m {np.mean(whole < 0.1):5.1%}  without steps"
        f" {np.median(away):.3f} {np.mean(away < 0.1):5.1%}  parts right {np.mean(parts == wanted):5.1%}"
        f" (mean {parts.mean():.1f} of {wanted.mean():.1f})",
        flush=True,
    )


if __name__ == "__main__":
    main()
