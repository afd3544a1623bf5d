"""From a plan to a layout: the planes, the partition and the overlays that the points pay for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .kernels import (
    CUT,
    CUT_AT_VERTEX,
    MAX_PLANES,
    Cloud,
    cost_prefix,
    gable_pool,
    guillotine,
    hypotheses,
    is_symmetric_gable,
    is_symmetric_hip,
    leaf_costs,
    plane_pool,
    primitives,
    without_twins,
)
from .layout import HOLDERS, Layout, empty_layout, evaluate, grow_tree, objective, single_plane_layout
from .plan import MIN_STRUCTURE_POINTS, Plan
from .polish import polish
from .refine import add_overlay, refine, settle

ROUNDS, SETTLING_ROUNDS = 1, 1
POOL_PLANES, POOL_GABLES, KEPT_PLANES = 20, 6, 28
MAIN_ROOF_FACTOR = 4.0  # with detail "main": how much more area a part must explain
SEARCH_POINTS = 4000
POOL_POINTS = 1000  # the planes are looked for on at most so many points, evenly spread
SEEDS, PAIRS_PER_SEED = 150, 2


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
    """Pool, partition and refinement twice, the better kept; then overlays and the polish."""
    pool, gables = propose(plan, tau, evidence)
    best, best_value = None, np.inf
    for _ in range(ROUNDS):
        pool = without_twins(pool, plan.cloud)
        layout = partition(plan, pool, gables, tau, evidence)
        for last in (False, False, True):
            refine(layout, plan.cloud, plan.grid, pool[:0] if last else pool, tau, evidence)
        value = objective(layout, plan.cloud, plan.ghosts, tau, evidence)
        if value < best_value:
            best, best_value = layout, value
        pool, gables = with_layout(layout, pool, gables)
    if with_overlays:
        cover_outliers(best, plan, tau, evidence)
    polish(best, plan.cloud, plan.ghosts, tau, evidence)
    return best


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


def partition(
    plan: Plan, pool: np.ndarray, gables: tuple[np.ndarray, np.ndarray], tau: float, evidence: float
) -> Layout:
    """The guillotine partition of the plan into primitives of the pools that costs least."""
    planes, counts, penalty = primitives(pool, *gables, plan.cloud, evidence)
    sums = cost_prefix(plan.cloud, plan.ghosts, plan.grid, planes, counts, tau)
    cut_u, cut_v = (
        evidence * np.where(at_vertex, CUT_AT_VERTEX, CUT)
        for at_vertex in (plan.grid.at_vertex_u, plan.grid.at_vertex_v)
    )
    choice = guillotine(leaf_costs(sums, penalty, plan.grid), cut_u, cut_v)
    layout = empty_layout()
    grow_tree(layout, choice, sums, penalty, planes, counts, plan.grid)
    return layout


def with_layout(layout: Layout, pool: np.ndarray, gables: tuple[np.ndarray, np.ndarray]):
    """The pools with the planes and the symmetric roofs of `layout` put in front."""
    planes, roofs, counts = [], [], []
    for h in range(layout.count[HOLDERS]):
        count = layout.planes_of[h]
        own = layout.table[layout.plane_of[h, :count]]
        planes.append(own)
        if is_symmetric_gable(own, count) or is_symmetric_hip(own, count):
            roofs.append(np.concatenate([own, np.zeros((MAX_PLANES - count, 3))])[None])
            counts.append(count)
    pool = np.concatenate([*planes, pool])[:KEPT_PLANES]
    return pool, (np.concatenate([*roofs, gables[0]]), np.concatenate([counts, gables[1]]).astype(np.int64))


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
