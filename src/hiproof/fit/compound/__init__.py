"""Compound roofs: several parts chosen by evidence and fitted to all points of a building at once.

    plan       the building's own frame, the points that count, grid, ghosts of unseen roof
    kernels    compiled: planes and gables that explain rectangles of points, the exact partition by dynamic programming
    layout     compiled: cuts, leaves and overlays as arrays, their height and objective
    refine     compiled: cuts move, leaves are refitted, overlays cover outliers
    polish     compiled: what does not pay goes, planes that nearly agree become one
    search     these in order: pool -> partition -> refine -> overlays -> polish
    joint      all planes refitted to all points together, with the regularities the evidence allows
    pieces     layout -> disjoint pieces over the outline
    recognise  piece -> type of the catalogue with its parameters
    parts      piece -> part; equal monopitches in a row -> one saw-tooth
    single     the one primitive of `fit_roof`, where it explains the roof as well
    wings      L, T, U and cross plans: whole primitives over overlapping rectangles, where they explain it as well

Every decision lowers one objective: sum over points of min((dz / tau)^2, 1) plus `evidence` points a unit of complexity.
"""

from __future__ import annotations

import numpy as np
import shapely

from ...errors import FitError
from ...settings import Settings
from .fit import CompoundFit
from .joint import fit_together
from .layout import evaluate
from .parts import assembled_parts
from .pieces import disjoint_pieces
from .plan import lay_out_plan
from .search import evidence_per_unit, search_layout
from .single import fit_alone, is_simple, outline_of_points, single_primitive
from .wings import fit_wings

__all__ = ["CompoundFit", "fit_building"]


def fit_building(
    points_local: np.ndarray,
    outline: shapely.Polygon | None = None,
    settings: Settings | None = None,
    type_log_prior: dict[str, float] | None = None,
    weights: np.ndarray | None = None,
) -> CompoundFit:
    """Fit the roof of one building to `points_local` (n, 3), in metres of a local frame, over `outline` (same frame).

    Without an outline it is estimated from the points; with one, points outside it do not count. Fewer than four points
    give a flat roof at their upper median. `weights` (n,) are probabilities of being roof: points under one half do not
    count; `type_log_prior` (log probability by type) is for the single primitive. Raises FitError where nothing can be
    fitted: no points inside the outline, or none given and points that span no area.

    >>> x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.2, 12, 0.4), np.arange(0.2, 7, 0.4)))
    >>> roof = np.column_stack([x, y, np.where(x < 8, 8 - 0.9 * abs(y - 3.5), 3.0)])
    >>> fit = fit_building(roof, shapely.box(0, 0, 12, 7))
    >>> sorted(part.type for part in fit.roof_parts), fit.unexplained
    (['flat', 'gable'], 0.0)
    """
    settings = settings or Settings()
    points_local, weights = countable(points_local, weights)
    alone = None
    if outline is None:
        outline, alone = outline_of_points(points_local, settings, type_log_prior, weights)
    plan = lay_out_plan(points_local, outline)
    if len(plan.cloud.u) == 0:
        raise FitError("expected roof points inside the outline, got none; add a cloud that covers the building")
    layout, objective = search_layout(plan, settings.compound)
    evidence = evidence_per_unit(plan.density, settings.compound)
    if is_simple(layout):
        alone = alone or fit_alone(points_local, outline, settings, type_log_prior, weights)
        single = single_primitive(alone, outline, plan, evidence, settings.compound.tolerance_m)
        if single is not None and single.objective <= objective:
            return single.as_fit(outline, len(plan.cloud.u))
    else:
        wings = fit_wings(outline, plan, evidence, objective, settings)
        if wings is not None:
            return wings
    joint = fit_together(layout, plan, settings.compound.tolerance_m, evidence)
    pieces = disjoint_pieces(layout, plan, outline)
    parts = assembled_parts(pieces, joint, plan, settings.compound.tolerance_m, evidence)
    z, _, _ = evaluate(layout, plan.cloud.u, plan.cloud.v)
    unexplained = float(np.mean(np.abs(plan.cloud.z - z) > settings.compound.tolerance_m))
    return CompoundFit(parts, outline, objective, len(z), unexplained)


def countable(points: np.ndarray, weights: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
    """Finite points (n, 3) that are roof rather than not, and their weights."""
    points = np.asarray(points, float).reshape(-1, 3)
    counts = np.isfinite(points).all(axis=1)
    if weights is None:
        return points[counts], None
    weights = np.asarray(weights, float)
    counts &= weights >= 0.5
    return points[counts], weights[counts]
