"""The one primitive of the single road (`fit_roof`), put on the compound's scale so that the two can be compared."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import shapely

from ...errors import FitError
from ...model import Fit, Part, Piece
from ...primitives import get
from ...settings import Settings
from ..outline import estimate_outline, is_rectangular
from ..single import fit_roof
from .fit import CompoundFit
from .layout import OVERLAYS, Layout, is_alive
from .pieces import CLAMP_M, polygons_of, rises_above
from .plan import Plan

PART_COST, PARAMETER_COST = (
    0.5,
    0.45,
)  # units of complexity: a level plane 0.95, a slope 1.4, a gable or hip by its heights
TOOTH_PARAMETERS = 3  # each further tooth of a saw-tooth is a step and a plane
SIMPLE_HOLDERS = 2


@dataclass(frozen=True)
class SinglePrimitive:
    """One primitive over the whole outline: its part in local coordinates, `objective` in points, types' posterior."""

    part: Part
    objective: float
    unexplained: float
    types: dict[str, float]

    def as_fit(self, outline: shapely.Polygon, points_used: int) -> CompoundFit:
        return CompoundFit((self.part,), outline, self.objective, points_used, self.unexplained, self.types)


def is_simple(layout: Layout) -> bool:
    """Whether the compound found so little structure that one primitive may explain the roof as well."""
    return layout.count[OVERLAYS] == 0 and int(is_alive(layout).sum()) <= SIMPLE_HOLDERS


def fit_alone(
    points_local: np.ndarray,
    outline: shapely.Polygon | None,
    settings: Settings,
    type_log_prior: dict[str, float] | None,
    weights: np.ndarray | None,
) -> Fit | None:
    """`fit_roof` for a whole building; None where it fails."""
    try:
        return fit_roof(
            points_local, outline=outline, settings=settings, weights=weights, type_log_prior=type_log_prior
        )
    except FitError:
        return None


def outline_of_points(
    points_local: np.ndarray,
    settings: Settings,
    type_log_prior: dict[str, float] | None,
    weights: np.ndarray | None,
) -> tuple[shapely.Polygon, Fit | None]:
    """Outline of a building without a footprint, and the single primitive whose rectangle it is, if it is one.

    Raises FitError for points that span no area.
    """
    fit = fit_alone(points_local, None, settings, type_log_prior, weights)
    if fit is None:
        return estimate_outline(points_local[:, :2]), None
    rectangle = plan_rectangle(moved(fit.part, fit.global_translation))
    if is_rectangular(rectangle, points_local[:, :2]):
        return rectangle, fit
    return estimate_outline(points_local[:, :2], fit.kappa), None


def plan_rectangle(part: Part) -> shapely.Polygon:
    """The rectangle that a primitive covers, all its teeth together."""
    half = 0.5 * np.array([part.parameters["length"], part.parameters["width"]])
    c, s = math.cos(part.kappa), math.sin(part.kappa)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    return shapely.Polygon(corners @ np.array([[c, s], [-s, c]]) + part.translation[:2])


def single_primitive(
    fit: Fit | None, outline: shapely.Polygon, plan: Plan, evidence: float, tau: float
) -> SinglePrimitive | None:
    """The fitted primitive judged as a layout is; None without one, or where it leaves the range of the points."""
    if fit is None:
        return None
    part = moved(fit.part, fit.global_translation)
    if not stays_within(part, outline, plan):
        return None
    uv = np.column_stack([plan.cloud.u, plan.cloud.v])
    residual = plan.cloud.z + plan.frame.origin[2] - height_of(part, plan.frame.xy_local(uv))
    ghosts = (
        height_of(part, plan.frame.xy_local(np.column_stack([plan.ghosts.u, plan.ghosts.v]))) - plan.frame.origin[2]
    )
    beyond = (ghosts < plan.ghosts.low) | (ghosts > plan.ghosts.high)
    parameters = 1 + len(get(part.type).bounds) + TOOTH_PARAMETERS * (len(part.pieces) - 1)
    cost = np.minimum((residual / tau) ** 2, 1.0).sum() + plan.ghosts.weight[beyond].sum()
    objective = float(cost + evidence * (PART_COST + PARAMETER_COST * parameters))
    return SinglePrimitive(part, objective, float(np.mean(np.abs(residual) > tau)), posterior(fit.bics))


def stays_within(part: Part, outline: shapely.Polygon, plan: Plan) -> bool:
    """Whether no height over the outline leaves the range of the points by more than the clamp of pieces allows."""
    low, high = (plan.frame.origin[2] + z for z in (plan.cloud.z.min() - CLAMP_M, plan.cloud.z.max() + CLAMP_M))
    for piece in part.pieces:
        for polygon in polygons_of(shapely.intersection(piece.outline, outline)):
            too_low = piece.height_at(shapely.get_coordinates(polygon)).min() < low
            if too_low or rises_above(piece.planes, high, polygon):
                return False
    return True


def moved(part: Part, shift: np.ndarray) -> Part:
    """The part moved by `shift` (3,)."""
    pieces = []
    for piece in part.pieces:
        planes = piece.planes.copy()
        planes[:, 2] += shift[2] - planes[:, :2] @ shift[:2]
        pieces.append(Piece(shapely.transform(piece.outline, lambda xy: xy + shift[:2]), planes))
    return dataclasses.replace(part, pieces=tuple(pieces), translation=part.translation + shift)


def height_of(part: Part, xy: np.ndarray) -> np.ndarray:
    """Height (n,) of the part at `xy` (n, 2), continued beyond its rectangle; a saw-tooth by the nearest tooth."""
    if len(part.pieces) == 1:
        return part.pieces[0].height_at(xy)
    c, s = math.cos(part.kappa), math.sin(part.kappa)
    across = (xy - part.translation[:2]) @ np.array([-s, c])
    width = part.parameters["width"]
    tooth = np.clip(np.floor((across / width + 0.5) * len(part.pieces)), 0, len(part.pieces) - 1).astype(int)
    heights = np.stack([piece.height_at(xy) for piece in part.pieces])
    return heights[tooth, np.arange(len(xy))]


def posterior(bics: dict[str, float]) -> dict[str, float]:
    """Probability of each type from its BIC."""
    best = min(bics.values())
    weights = {name: math.exp(-0.5 * min(bic - best, 1400.0)) for name, bic in bics.items() if math.isfinite(bic)}
    return {name: weight / sum(weights.values()) for name, weight in weights.items()}
