"""Robustness: dimension errors of gables and hips.

They are against density, noise, missing parts, outliers, and shifted footprints.
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from hiproof.simulate import SimBuilding, random_building, uniform_points

from .charts import draw_curves
from .fig8 import list_true_faces, remove_corner, turn_back
from .methods import fit_model, run_in_parallel
from .output import Options, Result, Table
from .ransac import detect_planes, is_available, match_faces

BASE_DENSITY, BASE_NOISE_M = 4.72, 0.12
AXES = {
    "density, points/m2": (20.0, 10.0, 5.0, 2.0, 1.0, 0.5),
    "noise, m": (0.02, 0.05, 0.1, 0.2, 0.3, 0.5),
    "missing at a corner": (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6),
    "missing strip": (0.0, 0.1, 0.2, 0.3, 0.4),
    "outliers": (0.0, 0.05, 0.1, 0.2, 0.3, 0.4),
    "footprint off by, m": (0.0, 0.1, 0.25, 0.5, 1.0),
}
KINDS = ("gable", "hip")
METHODS = ("paper", "likelihood")
COLUMNS = (
    "what",
    "level",
    *(f"{m}: {f}" for m in METHODS for f in ("dim. RMSE", "dim. median")),
    "ransac: faces missed",
)


def run(options: Options) -> Result:
    """Run one axis at a time; all methods see the same points."""
    roofs, kinds = (1, KINDS[:1]) if options.quick else (20, KINDS)
    rows = []
    for name, levels in AXES.items():
        for level in levels[-1:] if options.quick else levels:
            work = [
                (
                    name,
                    level,
                    kind,
                    options.seed,
                    roof,
                    tuple(m for m in METHODS if options.covers(m, roof)),
                )
                for kind in kinds
                for roof in range(roofs)
            ]
            outcomes = run_in_parallel(measure_errors, work, options.jobs)
            rows.append((name, level, *compute_figures(outcomes)))
    table = Table("Errors of width, length, height (and ridge length)", COLUMNS, rows, NOTE)
    roofs_a_level = " and ".join(f"{roofs} {kind}s" for kind in kinds)
    data = f"{roofs_a_level} a level, otherwise {BASE_DENSITY} points/m2, noise {BASE_NOISE_M} m"
    return Result("robustness", data, (table,), {"robust": draw_picture(rows)})


NOTE = (
    "Metres, the type given. 'Missing at a corner': the given share of points nearest to one "
    "corner, in units of the sides; 'missing strip': a band across the ridge at a random place, "
    "not at its ends; 'outliers': so many points in place of the roof's, anywhere in its box and "
    "up to 2 m over and under it; 'footprint': the fit is given the true footprint shifted that "
    "far in a random direction. RANSAC has no dimensions: the share of true faces without a plane "
    "of their own stands for it."
)


def compute_figures(outcomes: list[dict]) -> tuple:
    """Return RMSE and median of the absolute dimension errors.

    They are by method; RANSAC's missed share comes with them.
    """
    cells: list[float | None] = []
    for method in METHODS:
        errors = np.concatenate([outcome.get(method, [math.nan]) for outcome in outcomes])
        errors = errors[np.isfinite(errors)]
        cells += (
            [float(np.sqrt(np.mean(errors**2))), float(np.median(np.abs(errors)))]
            if len(errors)
            else [None, None]
        )
    missed = [outcome["missed"] for outcome in outcomes if outcome["missed"] is not None]
    return (*cells, float(np.mean(missed)) if missed else None)


def measure_errors(
    label: str, level: float, kind: str, seed: int, roof: int, methods: tuple[str, ...] = METHODS
) -> dict:
    """Return dimension errors (k,) by method, and RANSAC's missed faces.

    Errors are NaN without a fit; missed faces are a share.
    """
    rng = np.random.default_rng([seed, roof, KINDS.index(kind), 99])
    building = random_building(rng, kind)
    points, outline = add_trouble(building, label, level, rng)
    truth = building.roof.parts[0].parameters
    outcome: dict = {}
    for method in methods:
        fit = fit_model(method, points, (kind,), outline).fit if len(points) > 3 else None
        outcome[method] = np.array(
            [fit.parameters[name] - v if fit else math.nan for name, v in truth.items()]
        )
    outcome["missed"] = measure_missed_share(points, building) if is_available() else None
    return outcome


def measure_missed_share(points: np.ndarray, building: SimBuilding) -> float:
    faces = list_true_faces(building)
    n_found, _ = match_faces(detect_planes(points), faces) if len(points) > 3 else (0, 0)
    return 1 - n_found / len(faces)


def add_trouble(
    building: SimBuilding, kind: str, level: float, rng: np.random.Generator
) -> tuple[np.ndarray, shapely.Polygon | None]:
    """Return points of the building with one kind of trouble.

    The footprint that the fit gets, if any, comes with them.
    """
    density = level if kind.startswith("density") else BASE_DENSITY
    noise_m = level if kind.startswith("noise") else BASE_NOISE_M
    points = uniform_points(building, rng, density, noise_m)
    if kind == "missing at a corner":
        return remove_corner(points, building, level), None
    if kind == "missing strip":
        return remove_strip(points, building, level, rng), None
    if kind == "outliers":
        return add_outliers(points, level, rng), None
    if kind.startswith("footprint"):
        angle = rng.uniform(0, 2 * math.pi)
        shift = level * np.array([math.cos(angle), math.sin(angle)])
        return points, shapely.transform(building.footprint, lambda xy: xy + shift)
    return points, None


def remove_strip(
    points: np.ndarray, building: SimBuilding, share: float, rng: np.random.Generator
) -> np.ndarray:
    """Remove the points in a band across the ridge.

    It takes the given share of the length, a tenth left at each end (a band at the end would only
    make a shorter roof).
    """
    part = building.roof.parts[0]
    along = turn_back(
        points[:, :2] - building.roof.frame.origin[:2] - part.translation[:2], part.kappa
    )[:, 0]
    length = part.parameters["length"]
    start = rng.uniform(-0.4 * length, (0.4 - share) * length)
    return points[(along < start) | (along > start + share * length)]


def add_outliers(points: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Replace a share of the points by outliers.

    They are drawn from the points' box, 2 m higher and lower.
    """
    points = points.copy()
    is_outlier = rng.random(len(points)) < share
    lower, upper = points.min(axis=0) - [0, 0, 2], points.max(axis=0) + [0, 0, 2]
    points[is_outlier] = rng.uniform(lower, upper, (int(is_outlier.sum()), 3))
    return points


def draw_picture(rows: list[tuple]):
    """Draw the dimension RMSE of both objectives, a panel an axis."""
    panels = {}
    for kind in AXES:
        panel_rows = [row for row in rows if row[0] == kind]
        series = {
            "paper": [row[2] for row in panel_rows],
            "likelihood": [row[4] for row in panel_rows],
        }
        panels[kind] = ([row[1] for row in panel_rows], series)
    return draw_curves(panels, "dimension RMSE, m", log=True)
