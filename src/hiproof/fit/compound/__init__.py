"""Compound roofs: several parts chosen by evidence and fitted to all points of a building at once.

    plan       the building's own frame, the points that count, grid, ghosts of unseen roof
    kernels    compiled: planes and gables that explain rectangles of points, the exact partition by dynamic programming
    layout     compiled: cuts, leaves and overlays as arrays; refine, overlay, polish
    search     these in order: pool -> partition -> refine -> overlays -> polish
    joint      all planes refitted to all points together, with the regularities the evidence allows
    pieces     layout -> disjoint pieces over the outline
    recognise  piece -> part of the catalogue with its parameters
    single     the one primitive of `fit_roof`, where it explains the roof as well

Every decision lowers one objective: sum over points of min((dz / tau)^2, 1) plus `evidence` points a unit of complexity.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely

from ...errors import FitError
from ...model import Part
from ...settings import Settings
from ..outline import estimate_outline
from .joint import JointFit, fit_together
from .layout import evaluate
from .pieces import RowPiece, disjoint_pieces
from .plan import Plan, lay_out_plan
from .recognise import recognised
from .search import evidence_per_unit, search_layout
from .single import is_simple, single_primitive


@dataclass(frozen=True)
class CompoundFit:
    """Outcome of `fit_building`, in the frame of the points given.

    `roof_parts` are disjoint in plan and cover `outline`; `objective` is in points (see the package), `types` posterior
    probabilities where one primitive explains the roof, `points_used` the points inside the outline that counted,
    `unexplained` the share of them further than the tolerance from the roof.
    """

    roof_parts: tuple[Part, ...]
    outline: shapely.Polygon
    objective: float
    points_used: int
    unexplained: float
    types: dict[str, float] = field(default_factory=dict)


def fit_building(
    points_local: np.ndarray,
    outline: shapely.Polygon | None = None,
    settings: Settings | None = None,
    type_log_prior: dict[str, float] | None = None,
    weights: np.ndarray | None = None,
) -> CompoundFit:
    """Fit the roof of one building to `points_local` (n, 3), in metres of a local frame, over `outline` (same frame).

    Without points inside the outline there is nothing to fit: raises FitError. With fewer than four, the roof is flat at
    their median height. `weights` (n,) are probabilities of being roof: points under one half do not count.
    """
    points_local = np.asarray(points_local, float).reshape(-1, 3)
    counts = np.isfinite(points_local).all(axis=1)
    if weights is not None:
        counts &= np.asarray(weights) >= 0.5
        weights = np.asarray(weights, float)[counts]
    points_local = points_local[counts]
    settings = settings or Settings()
    options = settings.compound
    if outline is None:
        outline = estimate_outline(points_local[:, :2])
    plan = lay_out_plan(points_local, outline)
    if len(plan.cloud.u) == 0:
        raise FitError("expected roof points inside the outline, got none; add a cloud that covers the building")
    layout, objective = search_layout(plan, options)
    evidence = evidence_per_unit(plan.density, options)
    single = None
    if is_simple(layout):
        single = single_primitive(points_local, outline, plan, evidence, settings, type_log_prior, weights)
    if single is not None and single.objective <= objective:
        return CompoundFit(
            (single.part,), outline, single.objective, len(plan.cloud.u), single.unexplained, single.types
        )
    joint = fit_together(layout, plan, options.tolerance_m, evidence)
    parts = tuple(part_of(piece, joint, plan) for piece in disjoint_pieces(layout, plan, outline))
    z, _, _ = evaluate(layout, plan.cloud.u, plan.cloud.v)
    unexplained = float(np.mean(np.abs(plan.cloud.z - z) > options.tolerance_m))
    return CompoundFit(parts, outline, objective, len(z), unexplained)


def part_of(found: RowPiece, joint: JointFit, plan: Plan) -> Part:
    """The piece as a part of the catalogue, with standard deviations where all its planes were fitted."""
    if (found.rows < 0).any():
        return recognised(found.piece)
    to_local = np.kron(np.eye(len(found.rows)), plan.frame.plane_map())
    return recognised(found.piece, to_local @ joint.covariance_of(found.rows) @ to_local.T)
