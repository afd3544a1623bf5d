"""From a plan to a layout: the planes, the partition and the overlays that the points pay for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .kernels import (
    Cloud,
    gable_pool,
    hypotheses,
    plane_pool,
    without_twins,
)
from .layout import Layout, empty_layout, evaluate, objective, single_plane_layout
from .partition import partition
from .plan import MIN_STRUCTURE_POINTS, Plan
from .polish import polish
from .refine import add_overlay, refine, settle

SETTLING_ROUNDS = 1
POOL_PLANES, POOL_GABLES = 20, 6
MAIN_ROOF_FACTOR = 4.0  # with detail "main": how much more area a part must explain
SEARCH_POINTS = 4000
POOL_POINTS = 600  # the planes are looked for on at most so many points, evenly spread
SEEDS, PAIRS_PER_SEED = 80, 2


def evidence_per_unit(density: float, settings) -> float:
    """Points that one unit of complexity must explain: a fixed area's worth, and never fewer than a floor."""
    area = settings.evidence_area_m2 * (MAIN_ROOF_FACTOR if settings.detail == "main" else 1.0)
    return max(settings.evidence_points, area * density)


def search_layout(plan: Plan, settings) -> tuple[Layout, float]:
    """Layout of the roof over `plan` and its objective (points).

    Structure is searched on at most SEARCH_POINTS points, evenly spread; the last rounds of settling see all of them.
    """
    evidence, tau = evidence_per_unit(plan.density, settings), settings.tolerance_m
    if len(plan.cloud.u) < MIN_STRUCTURE_POINTS:
        layout = single_plane_layout((0.0, 0.0, upper_median(plan.cloud.z)))
    else:
        few = thinned_plan(plan, SEARCH_POINTS)
        layout = searched(few, tau, evidence_per_unit(few.density, settings), settings.detail == "full")
        for _ in range(SETTLING_ROUNDS):
            settle(layout, plan.cloud, plan.ghosts, plan.grid, tau, evidence)
            polish(layout, plan.cloud, plan.ghosts, tau, evidence)
    return layout, objective(layout, plan.cloud, plan.ghosts, tau, evidence)


def searched(plan: Plan, tau: float, evidence: float, with_overlays: bool) -> Layout:
    """Pool, partition and refinement; then overlays and the polish."""
    pool, gables = propose(plan, tau, evidence)
    pool = without_twins(pool, plan.cloud)
    layout = empty_layout()
    partition(layout, plan.cloud, plan.ghosts, plan.grid, pool, *gables, tau, evidence)
    for last in (False, True):
        refine(layout, plan.cloud, plan.grid, pool[:0] if last else pool, tau, evidence)
    if with_overlays:
        cover_outliers(layout, plan, tau, evidence)
    polish(layout, plan.cloud, plan.ghosts, tau, evidence)
    return layout


def thinned_plan(plan: Plan, most: int) -> Plan:
    """`plan` with at most `most` points; ghosts weigh as many points as their area then holds."""
    share = min(1.0, most / len(plan.cloud.u))
    if share == 1.0:
        return plan
    ghosts = plan.ghosts._replace(weight=plan.ghosts.weight * share)
    return replace(plan, cloud=thinned(plan.cloud, most), ghosts=ghosts, density=plan.density * share)


def upper_median(z: np.ndarray) -> float:
    """The middle height, of an even number the upper one: what strays lies below a roof (facades) more than above it."""
    return float(np.sort(z)[len(z) // 2])


def thinned(cloud: Cloud, most: int) -> Cloud:
    """At most `most` points of `cloud`, evenly spread over their order."""
    n = len(cloud.u)
    if n <= most:
        return cloud
    kept = np.arange(most) * n // most
    return Cloud(*(column[kept] for column in cloud))


def propose(plan: Plan, tau: float, evidence: float) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Pools of planes (k, 3) and of symmetric gables (g, 2, 3) that explain the points, best first."""
    few = thinned(plan.cloud, POOL_POINTS)
    evidence *= len(few.u) / len(plan.cloud.u)
    candidates = hypotheses(few, SEEDS, PAIRS_PER_SEED)
    pool = plane_pool(few, plan.grid, candidates, tau, evidence, POOL_PLANES)
    pool = np.concatenate([pool, np.zeros((1, 3))])
    gables = gable_pool(few, plan.grid, pool, tau, evidence, POOL_GABLES)
    return pool, gables


def cover_outliers(layout: Layout, plan: Plan, tau: float, evidence: float) -> None:
    """Add overlays (to `layout`) for the points it leaves unexplained, as long as they pay."""
    cloud, few = plan.cloud, thinned(plan.cloud, POOL_POINTS)
    for _ in range(len(layout.overlays)):
        z, _, _ = evaluate(layout, cloud.u, cloud.v)
        outliers = np.abs(cloud.z - z) > 0.995 * tau
        if outliers.sum() < MIN_STRUCTURE_POINTS:
            return
        unexplained = thinned(Cloud(*(column[outliers] for column in cloud)), POOL_POINTS)
        candidates = hypotheses(unexplained, SEEDS, PAIRS_PER_SEED)
        if not add_overlay(layout, cloud, few, plan.grid, candidates, tau, evidence):
            return
