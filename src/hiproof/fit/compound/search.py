"""From a plan to a layout: the planes, the partition and the overlays that the points pay for."""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from .kernels import Cloud, Ghosts, gable_pool, hypotheses, plane_pool, without_twins
from .layout import Layout, empty_layout, evaluate, objective, single_plane_layout
from .partition import partition
from .plan import MIN_STRUCTURE_POINTS, Plan
from .polish import polish
from .refine import add_overlay, refine, settle

POOL_PLANES, POOL_GABLES = 20, 6
MAIN_ROOF_FACTOR = 4.0  # with detail "main": how much more area a part must explain
SEARCH_POINTS = 2000
POOL_POINTS = 600  # the planes are looked for on at most so many points, evenly spread
SEEDS, PAIRS = 120, 250  # of few points more pairs are tried


def evidence_per_unit(density: float, settings) -> float:
    """Points that one unit of complexity must explain: a fixed area's worth, and never fewer than a floor."""
    area = settings.evidence_area_m2 * (MAIN_ROOF_FACTOR if settings.detail == "main" else 1.0)
    return float(max(settings.evidence_points, area * density))


def search_layout(plan: Plan, settings) -> tuple[Layout, float]:
    """Layout of the roof over `plan` and its objective (points).

    Structure is searched on at most SEARCH_POINTS points, evenly spread; the last round of settling sees all of them.
    """
    evidence, tau = evidence_per_unit(plan.density, settings), float(settings.tolerance_m)
    cloud, ghosts = plan.cloud, plan.ghosts
    if len(cloud.u) < MIN_STRUCTURE_POINTS:
        layout = single_plane_layout((0.0, 0.0, upper_median(cloud.z)))
        return layout, objective(layout, cloud, ghosts, tau, evidence)
    share = min(1.0, SEARCH_POINTS / len(cloud.u))
    few_evidence = evidence_per_unit(plan.density * share, settings)
    layout = empty_layout()
    value = fill(layout, cloud, ghosts, plan.grid, tau, evidence, share, few_evidence, settings.detail == "full")
    return layout, value


def upper_median(z: np.ndarray) -> float:
    """The middle height, of an even number the upper one: what strays lies below a roof (facades) more than above it."""
    return float(np.sort(z)[len(z) // 2])


@compiled
def fill(layout, cloud, ghosts, grid, tau, evidence, share, few_evidence, with_overlays):
    """Fill the empty `layout`: structure from a `share` of the points, settled on all; returns its objective.

    Ghosts weigh as many points as their area holds, so that share of their weight counts in the search.
    """
    few = thinned(cloud, int(np.ceil(share * len(cloud.u))))
    lighter = Ghosts(ghosts.u, ghosts.v, ghosts.weight * share, ghosts.i, ghosts.j, ghosts.low, ghosts.high)
    search(layout, few, lighter, grid, tau, few_evidence, with_overlays)
    settle(layout, cloud, ghosts, grid, tau, evidence)
    polish(layout, cloud, ghosts, tau, evidence)
    return objective(layout, cloud, ghosts, tau, evidence)


@compiled
def search(layout, cloud, ghosts, grid, tau, evidence, with_overlays):
    """Pools of planes and gables, partition and refinement; then overlays and the polish."""
    few = thinned(cloud, POOL_POINTS)
    pool_evidence = evidence * len(few.u) / len(cloud.u)
    candidates = hypotheses(few, SEEDS, PAIRS)
    pool = plane_pool(few, grid, candidates, tau, pool_evidence, POOL_PLANES)
    pool = np.concatenate((pool, np.zeros((1, 3))))
    gables, gable_counts = gable_pool(few, grid, pool, tau, pool_evidence, POOL_GABLES)
    pool = without_twins(pool, cloud)
    partition(layout, cloud, ghosts, grid, pool, gables, gable_counts, tau, evidence)
    refine(layout, cloud, grid, pool, tau, evidence)
    if with_overlays:
        cover_outliers(layout, cloud, few, grid, tau, evidence)
    polish(layout, cloud, ghosts, tau, evidence)


@compiled
def thinned(cloud, most):
    """At most `most` points of `cloud`, evenly spread over their order."""
    n = len(cloud.u)
    if n <= most:
        return cloud
    kept = np.arange(most) * n // most
    return Cloud(cloud.u[kept], cloud.v[kept], cloud.z[kept], cloud.i[kept], cloud.j[kept])


@compiled
def cover_outliers(layout, cloud, few, grid, tau, evidence):
    """Add overlays (to `layout`) for the points it leaves unexplained, as long as they pay; `few` of the points choose."""
    for _ in range(len(layout.overlays)):
        z, _, _ = evaluate(layout, cloud.u, cloud.v)
        far = np.nonzero(np.abs(cloud.z - z) > 0.995 * tau)[0]
        if len(far) < MIN_STRUCTURE_POINTS:
            return
        unexplained = Cloud(cloud.u[far], cloud.v[far], cloud.z[far], cloud.i[far], cloud.j[far])
        candidates = hypotheses(thinned(unexplained, POOL_POINTS), SEEDS, PAIRS)
        if not add_overlay(layout, cloud, few, grid, candidates, tau, evidence):
            return
