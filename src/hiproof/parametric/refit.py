"""The fit of given parts to points.

Types, rectangles and fixed values stay, and the points determine the rest.

One robust least squares over all parts at once (Levenberg and Marquardt, re-weighted by Tukey's
biweight from coarse to fine): the residual of a point is its height over the roof, which is the
highest part there, or its distance at right angles from a curved part. Each part's planes follow
from its own parameters, so a column of the Jacobian asks one part again. The result is never
further from the points than the start.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import shapely

from ..compose.settle import make_pieces
from ..data_files import Values
from ..errors import FitError, InputError
from ..model import Building, Part, Roof, as_xyz
from ..primitives.catalogue import CURVED
from ..primitives.contract import Parameters
from ..primitives.parameters import SIDED, refuse_no_shape
from ..primitives.table import PARAMETER_ROWS, evaluate
from ..write.parameters import building_record
from .change import from_lowest_eave
from .edit import rebuild

# parameters, or beginnings of their names
HELD_PARAMETERS = ("width", "length", "teeth", "skew", "facing", "distance")
STEP = 1e-4  # of a parameter, metres or degrees, for the Jacobian
SCALES_M = (3.0, 0.8, 0.25)  # residuals beyond are outliers, from coarse to fine
REFIT_ROUNDS = 6  # steps of descent at each scale, at most
MOST_REFIT_POINTS = 2000  # an even selection of more
# of a point's whole cost: a start that comes so near is no further searched for from afar
WELL = 0.3
# points so near the outline may be returns of walls; left out where enough others are
FACADE_M, ENOUGH = 0.3, 30
FEWEST_REFIT_POINTS = 3  # points; fewer span no plane
# m, degrees: bounds in which heights and pitches stay, short of level and of upright
LEAST_HEIGHT_M, PITCHES_DEG = 0.01, (0.5, 85.0)
Z = "z"
NO_PART = -1  # Points beside the roof have none.
UNBOUNDED_M = 100.0  # m; larger than any length of a roof: as good as no bound


@dataclasses.dataclass(frozen=True)
class Unknowns:
    """The numbers fitted: `names` are (part, parameter or "z"); start and bounds are (p,)."""

    names: tuple[tuple[int, str], ...]
    start: np.ndarray
    low: np.ndarray
    high: np.ndarray


def refit(
    building: Building, points: np.ndarray, fixed: Mapping[int, Collection[str]] | None = None
) -> Building:
    """Fit the parts of the building to `points` again; see `Building.refit`."""
    record, local = building_record(building), select_inside(building.roof, points)
    parts = refit_parts(building.roof, record["parts"], local, fixed or {})
    return measure_building(note_fit(rebuild(building, {**record, "parts": parts})), local)


def note_fit(building: Building) -> Building:
    """Return the building with a detail that its parts were fitted."""
    return dataclasses.replace(building, detail=f"{building.detail}, fitted to its points")


def select_inside(roof: Roof, points: np.ndarray) -> np.ndarray:
    """Return the finite world `points` inside the outline (n, 3), about the roof's origin."""
    local = roof.frame.to_local(as_xyz(points))
    local = local[np.isfinite(local).all(axis=1)]
    return local[shapely.intersects_xy(roof.outline, local[:, :2])]


def refit_parts(
    roof: Roof, parts: list[Any], points: np.ndarray, fixed: Mapping[int, Collection[str]]
) -> list[Any]:
    """Fit `parts` of `roof` to `points` (n, 3) about its origin; FitError below three."""
    unknowns = list_unknowns(roof.parts, fixed)
    if len(points) < FEWEST_REFIT_POINTS:
        raise FitError(
            f"expected {FEWEST_REFIT_POINTS} points or more inside the outline, got {len(points)}; "
            "add a cloud"
        )
    if not unknowns.names:
        return parts
    inner = shapely.buffer(roof.outline, -FACADE_M)
    selection = points[shapely.intersects_xy(inner, points[:, :2])]
    values, sigma = fit_unknowns(
        roof.parts, selection if len(selection) >= ENOUGH else points, unknowns
    )
    return [
        with_values(
            part,
            {n: v for (i, n), v in zip(unknowns.names, values, strict=True) if i == index},
            sigma[index],
        )
        for index, part in enumerate(parts)
    ]


def list_unknowns(parts: tuple[Part, ...], fixed: Mapping[int, Collection[str]]) -> Unknowns:
    """List the parameters of all parts that are fitted.

    Rectangles, the directions of planes and those `fixed` by part are not. The position's z is "z".
    """
    rows = []
    for index, part in enumerate(parts):
        held = set(fixed.get(index, ()))
        names = {*part.parameters, Z}
        if held - names:
            raise InputError(
                f"expected parameters of part {index} ({', '.join(sorted(names))}) to hold, got "
                f"{', '.join(sorted(held - names))}; choose among these"
            )
        # a member's eaves are free one by one
        if Z not in held and not SIDED & part.parameters.keys():
            rows.append((index, Z, float(part.translation[2]), -np.inf, np.inf))
        for name, value in part.parameters.items():
            if name not in held and name.split("_")[0] not in HELD_PARAMETERS:
                rows.append((index, name, value, *find_bounds(name, part.parameters)))
    start, lower, upper = (np.array([row[k] for row in rows], float) for k in (2, 3, 4))
    lower, upper = np.minimum(lower, start), np.maximum(upper, start)
    return Unknowns(tuple((row[0], row[1]) for row in rows), start, lower - 1e-9, upper + 1e-9)


def find_bounds(name: str, parameters: Parameters) -> tuple[float, float]:
    """Return the bounds in which a parameter makes a roof over its rectangle."""
    if bounds := PARAMETER_ROWS.get(name, {}).get("bounds"):
        return evaluate(bounds, {"width": UNBOUNDED_M, "length": UNBOUNDED_M} | dict(parameters))
    if name.startswith("pitch_"):
        return PITCHES_DEG
    return (-UNBOUNDED_M if name.startswith("eave_") else LEAST_HEIGHT_M, UNBOUNDED_M)


@dataclasses.dataclass(frozen=True)
class RefitSurface:
    """The roof at the points.

    It has how far they lie above it (n,), in height times their `leans` (n,), the part (n,) there,
    the row (n,) among that part's planes, and all planes (k, 3) of every part.
    """

    gaps: np.ndarray
    leans: np.ndarray
    part: np.ndarray
    row: np.ndarray
    planes: list[np.ndarray]


class Heights:
    """The roof under points (n, 3) as a function of the unknowns x (p,)."""

    def __init__(self, parts: tuple[Part, ...], points: np.ndarray, unknowns: Unknowns) -> None:
        self.parts, self.z, self.unknowns = parts, points[:, 2], unknowns
        # a plane's height is their product with it
        self.terms = np.column_stack([points[:, :2], np.ones(len(points))])
        self.columns = [
            [k for k, (i, _) in enumerate(unknowns.names) if i == index]
            for index in range(len(parts))
        ]
        self.outlines = [part.outlines for part in parts]
        self.inside = [
            [np.flatnonzero(shapely.intersects_xy(outline, points[:, :2])) for outline in outlines]
            for outlines in self.outlines
        ]

    def place(self, index: int, x: np.ndarray) -> tuple[dict[str, float], np.ndarray]:
        """Return the parameters of a part, and where it lies (3,)."""
        part = self.parts[index]
        values = {
            self.unknowns.names[column][1]: float(x[column]) for column in self.columns[index]
        }
        parameters = {name: values.get(name, value) for name, value in part.parameters.items()}
        return parameters, np.array([*part.translation[:2], values.get(Z, part.translation[2])])

    def planes(self, index: int, x: np.ndarray) -> list[np.ndarray] | None:
        """Return the planes (k, 3) of a part's pieces, None where its parameters make none."""
        part, (parameters, translation) = self.parts[index], self.place(index, x)
        try:
            refuse_no_shape(part.type, parameters, f"part {index}")
            pieces = make_pieces(
                part.type, parameters, part.kappa, translation, self.outlines[index]
            )
        except (FitError, InputError, ZeroDivisionError):
            return None
        return [piece.planes for piece in pieces]

    def at(self, x: np.ndarray) -> RefitSurface:
        """Return the roof of the unknowns, far from all points where there is none."""
        count = len(self.z)
        top, part, row = np.full(count, -np.inf), np.zeros(count, int), np.zeros(count, int)
        result: list[np.ndarray] = []
        for index, inside in enumerate(self.inside):
            planes, first = self.planes(index, x), 0
            if planes is None:
                return RefitSurface(np.full(count, UNBOUNDED_M), np.ones(count), part, row, [])
            masks = (mask for mask in inside for _ in range(len(planes) // len(inside)))
            for point_mask, own_planes in zip(masks, planes, strict=True):
                heights = self.terms[point_mask] @ own_planes.T
                lowest = heights.argmin(axis=1)
                height = heights[np.arange(len(point_mask)), lowest]
                higher = height > top[point_mask]
                selection = point_mask[higher]
                top[selection], part[selection], row[selection] = (
                    height[higher],
                    index,
                    first + lowest[higher],
                )
                first += len(own_planes)
            result.append(np.concatenate(planes))
        gaps = np.clip(self.z - top, -UNBOUNDED_M, UNBOUNDED_M)
        leans = self.leans(np.where(np.isfinite(top), part, NO_PART), row, result)
        return RefitSurface(gaps * leans, leans, part, row, result)

    def leans(self, part: np.ndarray, row: np.ndarray, planes: list[np.ndarray]) -> np.ndarray:
        """Return the share (n,) of heights that is at right angles: 1 but over curved parts."""
        result = np.ones(len(part))
        for index in (k for k, one in enumerate(self.parts) if one.type in CURVED):
            over = part == index
            slopes = planes[index][row[over], :2]
            result[over] = 1.0 / np.hypot(1.0, np.hypot(*slopes.T))
        return result

    def jacobian(self, x: np.ndarray, surface: RefitSurface) -> np.ndarray:
        """Return derivatives (n, p) of the heights by the unknowns, times the leans."""
        result = np.zeros((len(self.z), len(x)))
        covered = np.abs(surface.gaps) < UNBOUNDED_M
        for index, columns in enumerate(self.columns):
            indices = np.flatnonzero(covered & (surface.part == index))
            terms, row = self.terms[indices], surface.row[indices]
            for column in columns if len(indices) else ():
                moved = x.copy()
                step = STEP if x[column] + STEP < self.unknowns.high[column] else -STEP
                moved[column] += step
                planes = self.planes(index, moved)
                if planes is not None:
                    change = (np.concatenate(planes) - surface.planes[index]) / step
                    rise = np.einsum("ij,ij->i", terms, change[row])
                    result[indices, column] = surface.leans[indices] * rise
        return result


def fit_unknowns(
    parts: tuple[Part, ...], points: np.ndarray, unknowns: Unknowns
) -> tuple[np.ndarray, list[dict[str, float]]]:
    """Return the unknowns' values (p,) and all parts' standard deviations."""
    heights = Heights(parts, points[:: max(1, -(-len(points) // MOST_REFIT_POINTS))], unknowns)
    finest = SCALES_M[-1]
    x = descend(heights, unknowns.start, finest)
    surface = heights.at(x)
    if misfit(surface.gaps, finest) > WELL * len(heights.z):
        coarse = unknowns.start
        for scale in SCALES_M:
            coarse = descend(heights, coarse, scale)
        result = heights.at(coarse)
        if misfit(result.gaps, finest) < misfit(surface.gaps, finest):
            x, surface = coarse, result
    mask = np.abs(surface.gaps) < finest
    deviations = np.sqrt(
        np.diag(covariance(heights.jacobian(x, surface)[mask], surface.gaps[mask]))
    )
    sigma: list[dict[str, float]] = [{} for _ in parts]
    for (index, name), deviation in zip(unknowns.names, deviations, strict=True):
        if 0.0 < deviation < UNBOUNDED_M:
            sigma[index]["t_z" if name == Z else name] = float(deviation)
    return x, sigma


def descend(heights: Heights, x: np.ndarray, scale: float) -> np.ndarray:
    """Return the unknowns at the minimum of the misfit at this scale, by damped steps."""
    unknowns, damping = heights.unknowns, 1e-3
    surface = heights.at(x)
    cost, slopes = misfit(surface.gaps, scale), None
    for _ in range(REFIT_ROUNDS):
        slopes = heights.jacobian(x, surface) if slopes is None else slopes
        weight = np.clip(1.0 - (surface.gaps / scale) ** 2, 0.0, None) ** 2
        normal, right = (slopes * weight[:, None]).T @ slopes, slopes.T @ (weight * surface.gaps)
        scales = np.diag(normal) + 1e-9 * max(normal.max(initial=0.0), 1e-9)
        step = np.linalg.solve(normal + damping * np.diag(scales), right)
        candidates = np.clip(x + step, unknowns.low, unknowns.high)
        result = heights.at(candidates)
        new_cost = misfit(result.gaps, scale)
        if new_cost >= cost:
            damping *= 30.0
            continue
        gained = (cost - new_cost) / cost
        x, surface, cost, slopes, damping = candidates, result, new_cost, None, 0.1 * damping
        if gained < 1e-4:
            break
    return x


def misfit(gaps: np.ndarray, scale: float) -> float:
    """Return the cost of points (n,) by Tukey's biweight at this scale, at most 1 each."""
    return float((1.0 - np.clip(1.0 - (gaps / scale) ** 2, 0.0, None) ** 3).sum()) + 1e-9


def covariance(jacobian: np.ndarray, gaps: np.ndarray) -> np.ndarray:
    """Return the covariance (p, p) of the unknowns, zero without points near the roof."""
    if not len(gaps):
        return np.zeros((jacobian.shape[1],) * 2)
    return np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-10) * float(np.mean(gaps**2))


def with_values(part: Values, values: Parameters, sigma: dict[str, float]) -> Values:
    """Return the part's object with fitted values, its z at the lowest eave again."""
    parameters = {name: values.get(name, value) for name, value in part["parameters"].items()}
    x, y, z = part["position"]
    position = [x, y, values.get(Z, z)]
    return from_lowest_eave(
        {**part, "parameters": parameters, "position": position, "sigma": sigma}
    )


def measure_building(building: Building, points_local: np.ndarray) -> Building:
    """Return the building with its quality on `points_local` (n, 3), and its verdict."""
    from ..compose.settle import round_building
    from ..evaluate.metrics import quality
    from ..stages.judge import grade_building

    roof = building.roof
    result = quality(building.solid.move(-roof.frame.origin), points_local, roof.outline)
    return grade_building(
        round_building(dataclasses.replace(building, quality=result)), points_local
    )
