"""Figure 7: asymmetric gables, which no symmetric primitive can follow."""

from __future__ import annotations

import numpy as np

from hiproof.model import Fit
from hiproof.simulate import random_building, uniform_points

from .methods import OBJECTIVES, fit_model, run_in_parallel
from .output import Options, Result, Table

PRIMITIVES = ("gable", "asymmetric_gable")
COLUMNS = (
    "objective",
    "primitive",
    "roofs",
    "PSD mean",
    "PSD p90 over roofs",
    "height RMSE of the surface",
)
DENSITY, NOISE_M = 4.72, 0.12


def run(options: Options) -> Result:
    """Fit the same roofs with both primitives, and draw a section.

    The section is through the first.
    """
    roofs = 2 if options.quick else 40
    rows = []
    for method in OBJECTIVES:
        for primitive in PRIMITIVES:
            roof_indices = [roof for roof in range(roofs) if options.covers(method, roof)]
            if not roof_indices:
                continue
            work = [(method, primitive, options.seed, roof) for roof in roof_indices]
            errors = np.array(run_in_parallel(measure_errors, work, options.jobs))
            psd, height = errors.T
            row = (
                method,
                primitive,
                len(work),
                float(psd.mean()),
                float(np.percentile(psd, 90)),
                float(np.median(height)),
            )
            rows.append(row)
    note = (
        "Metres. The surface's error is against the true heights over the true outline; its median "
        "over roofs is given."
    )
    table = Table("Symmetric and asymmetric primitive on asymmetric gables", COLUMNS, rows, note)
    data = (
        f"{roofs} simulated asymmetric gables (unequal slopes or eaves), {DENSITY} points/m2, "
        f"noise {NOISE_M} m"
    )
    return Result("the asymmetric gable", data, (table,), {"fig7": draw_section(options.seed)})


def draw_roof_and_points(seed: int, roof: int):
    rng = np.random.default_rng([seed, roof, 77])
    building = random_building(rng, "asymmetric_gable")
    return building, uniform_points(building, rng, DENSITY, NOISE_M)


def measure_errors(method: str, primitive: str, seed: int, roof: int) -> tuple[float, float]:
    """Return the mean PSD, and the RMSE of the fitted surface's heights."""
    building, points = draw_roof_and_points(seed, roof)
    model = fit_model(method, points, (primitive,))
    xy = uniform_points(building, np.random.default_rng(roof), 5.0, 0.0)
    height_error = model.fit.height_at(xy[:, :2]) - xy[:, 2]
    return float(model.psd(points).mean()), float(np.sqrt(np.nanmean(height_error**2)))


def has_unequal_slopes(building) -> bool:
    """Return whether the eaves are level, so that the slopes differ.

    Of equal slopes the gable gets the planes.
    """
    return abs(building.parameters["eave_step"]) < 0.2


def draw_section(seed: int):
    """Draw points and both fits of a roof with unequal slopes.

    They are seen along the ridge.
    """
    from .charts import make_figure

    building, points = next(
        candidate
        for candidate in (draw_roof_and_points(seed, roof) for roof in range(100))
        if has_unequal_slopes(candidate[0])
    )
    part = building.roof.parts[0]
    across = np.array([-np.sin(part.kappa), np.cos(part.kappa)])
    centre = part.translation[:2] + building.roof.frame.origin[:2]
    figure, (axis,) = make_figure(width=7, height=3)
    axis.plot(
        (points[:, :2] - centre) @ across,
        points[:, 2],
        ".",
        color="#7f8c9b",
        markersize=3,
        label="points",
    )
    width = part.parameters["width"] / 2
    offsets = np.linspace(-width, width, 400)
    for primitive, colour in zip(PRIMITIVES, ("#d1495b", "#2e86ab"), strict=True):
        fit: Fit = fit_model("likelihood", points, (primitive,)).fit
        axis.plot(
            offsets,
            fit.height_at(centre + offsets[:, None] * across),
            color=colour,
            label=primitive,
        )
    axis.set_xlabel("across the ridge, m")
    axis.set_ylabel("height, m")
    axis.set_aspect("equal")
    axis.legend()
    return figure
