"""Volumes that only skewed walls keep apart: one over both, where planes along its own sides explain its points as well.

The search's planes face along two axes. A roof over walls that are not quite parallel has planes that do not, and two volumes
beside each other then stand for one.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
import shapely

from .cants import Known, finished, walls_of
from .cut_corners import over_cut_corners
from .finish import SQUARE, Planes
from .moves import refit_each, without
from .objective import base_shows, costs, edges_cost, objective
from .plan import Plan
from .prices import ALONG_AXES_UNITS, FITTING_UNITS
from .scene import Scene
from .sides import BESIDE_M as REACH_M
from .sides import Lines, Side, list_lines, plan_chords, plan_edges, sides_of
from .volumes import (
    DIRECTION,
    LEAN,
    LEVEL,
    NUMBER,
    OFFSET,
    PLANES,
    REPLACES,
    SLOPE,
    U0,
    V0,
    V1,
    distances_up,
    roof_heights,
    volume_cost,
)

BESIDE_M, IN_LINE_M = 0.4, 1.0  # how far apart the rectangles may lie, and their sides along the line of both
SLOPES_ALIKE, HEIGHTS_ALIKE_M = 0.15, 0.5  # rise over run, m: further apart, two volumes are not tried as one
MOST_CUT = 2  # volumes drawn out over walls that cut corners off: a house has one bay or two


class Ends(NamedTuple):
    """What an outline ends volumes with: its edges and chords (2, m, 2) in the first direction's axes, the lines that sides
    may take of these, by direction, and its walls (m, 2, 2). `outline` (2, n, 2) are all edges, near or not."""

    edges: np.ndarray
    chords: np.ndarray
    lines: list[list[Lines]]
    walls: np.ndarray
    outline: np.ndarray


@dataclass(frozen=True)
class Drawn:
    """Volumes (k, COLUMNS) with their sides and planes, and what the roof costs with these (points)."""

    volumes: np.ndarray
    sides: list[list[Side]]
    planes: list[Planes]
    cost: float


def united(volumes: np.ndarray, ends: Ends, scene: Scene, known: Known, own: Collection[int] | None = None) -> Drawn:
    """The volumes along their sides, without those that do not pay once planes face as these do.

    Only volumes of the numbers `own` are made one with others, or go; all where it is None. Planes
    that are `known` in this scene are not fitted again; those found become known.
    """
    value = objective(volumes, scene, np.inf)
    best = with_cut_corners(drawn(volumes, ends, scene, known), ends, scene, known)
    tried = True
    while tried:
        tried = False
        for trial in fewer(best, own):
            if bares_the_base(trial, best.volumes, scene):
                continue
            trial, found = refit_each(trial, scene, objective(trial, scene, np.inf))
            if found > value + ALONG_AXES_UNITS * scene.evidence:
                continue
            roof = drawn(trial, ends, scene, known)
            if roof.cost < best.cost:
                best, value, tried = roof, found, True
                break
    return best


def ends_of(outline: shapely.Polygon, plan: Plan, scene: Scene) -> Ends:
    edges, chords = plan_edges(outline, plan), plan_chords(outline, plan)
    return Ends(edges, chords, list_lines(edges, chords, scene.turn, edges), walls_of(outline, plan), edges)


def ends_within(ends: Ends, scene: Scene) -> Ends:
    """Those of the ends that reach into what a scene shows, or nearly."""
    low = np.array([scene.corner_u, scene.corner_v]) - REACH_M
    high = low + np.multiply(scene.depth.shape, scene.pitch) + 2.0 * REACH_M
    edges, chords, walls = (
        lines[:, reaches(lines, low, high)] for lines in (ends.edges, ends.chords, ends.walls.swapaxes(0, 1))
    )
    lines = list_lines(edges, chords, scene.turn, ends.outline)
    return Ends(edges, chords, lines, walls.swapaxes(0, 1), ends.outline)


def reaches(lines: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Which of the lines between ends (2, m, 2) reach into the box from `low` to `high` (2,)."""
    return ((lines.min(axis=0) < high) & (lines.max(axis=0) > low)).all(axis=1)


def with_cut_corners(roof: Drawn, ends: Ends, scene: Scene, known: Known) -> Drawn:
    """The roof with one volume over walls that cut its corners off in place of several, where that is cheaper, at most MOST_CUT times."""
    for _ in range(MOST_CUT):
        before = roof
        for trial in over_cut_corners(before.volumes, ends.walls, scene):
            if at_least(trial, scene) > roof.cost + FITTING_UNITS * scene.evidence:
                continue
            if bares_the_base(trial, before.volumes, scene):
                continue
            trial, _ = refit_each(trial, scene, objective(trial, scene, np.inf))
            found = drawn(trial, ends, scene, known)
            roof = found if found.cost < roof.cost else roof
        if roof is before:
            break
    return roof


def bares_the_base(trial: np.ndarray, volumes: np.ndarray, scene: Scene) -> bool:
    """Whether the base shows under a trial and not under the volumes that it would take the place of."""
    return bool(base_shows(trial, scene)) and not base_shows(volumes, scene)


def at_least(volumes: np.ndarray, scene: Scene) -> float:
    """What a roof costs whatever further planes lower it: its volumes, its edges, and the points above it."""
    z, _ = roof_heights(volumes, scene.U, scene.V)
    above = scene.z[: scene.n] > z[: scene.n]
    return float(costs(z, scene)[: scene.n][above].sum()) + structure_cost(volumes, scene)


def structure_cost(volumes: np.ndarray, scene: Scene) -> float:
    return scene.evidence * sum(volume_cost(volume) for volume in volumes[1:]) + edges_cost(volumes, scene, np.inf)


def fewer(roof: Drawn, own: Collection[int] | None) -> Iterator[np.ndarray]:
    """Volumes with two that are alike made one; and without one, where sides are not square to each other."""
    mine = [own is None or number in own for number in roof.volumes[:, NUMBER].tolist()]
    for j, k in combinations(range(1, len(roof.volumes)), 2):
        if (mine[j] or mine[k]) and alike(roof.volumes[j], roof.volumes[k]):
            trial = roof.volumes.copy()
            trial[j] = over_both(trial[j], trial[k])
            yield without(trial, k)
    if any(abs(side.lean) > SQUARE for own in roof.sides for side in own):
        for k in range(len(roof.volumes) - 1, 0, -1):
            if mine[k]:
                yield without(roof.volumes, k)


def drawn(volumes: np.ndarray, ends: Ends, scene: Scene, known: Known) -> Drawn:
    """The volumes with the sides, on the outline's lines where these are near, and the planes that suit them."""
    key = volumes.tobytes()
    if key not in known:
        sides = sides_of(volumes, ends.lines, scene)
        planes = finished(volumes, sides, ends.walls, scene, known)
        misfit = sum(own.cost + own.price for own in planes)
        known[key] = Drawn(volumes, sides, planes, misfit + structure_cost(volumes, scene))
    return known[key]


def alike(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two volumes lie beside each other in one line, with all but the same planes."""
    if one[DIRECTION] != other[DIRECTION] or one[REPLACES] or other[REPLACES]:
        return False
    if not in_line(one[U0 : V1 + 1].tolist(), other[U0 : V1 + 1].tolist()):
        return False
    rectangles = np.array([one[U0 : V1 + 1], other[U0 : V1 + 1]]).reshape(2, 2, 2)  # volume, axis, end
    there = np.isfinite(one[OFFSET : OFFSET + PLANES]), np.isfinite(other[OFFSET : OFFSET + PLANES])
    both = there[0] & there[1]
    if both.sum() < min(there[0].sum(), there[1].sum()) or both.sum() == 0:
        return False
    middle = rectangles.mean(axis=(0, 2))
    x = np.array([[*distances_up(row, *middle), 0.0] for row in (one, other)])
    slopes = np.array([np.r_[row[SLOPE : SLOPE + LEVEL], 0.0] for row in (one, other)])
    heights = np.array([one[OFFSET : OFFSET + PLANES], other[OFFSET : OFFSET + PLANES]]) + slopes * x
    near = np.abs(heights[0, both] - heights[1, both]) < HEIGHTS_ALIKE_M
    return bool(near.all() and (np.abs(slopes[0] - slopes[1])[both] < SLOPES_ALIKE).all())


def in_line(one: list[float], other: list[float]) -> bool:
    """Whether two rectangles (u0, u1, v0, v1) lie beside each other in one line."""
    for low, across in ((0, 2), (2, 0)):
        gap = max(one[low], other[low]) - min(one[low + 1], other[low + 1])
        apart = max(abs(one[across] - other[across]), abs(one[across + 1] - other[across + 1]))
        if gap < BESIDE_M and apart < IN_LINE_M:
            return True
    return False


def over_both(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """One volume over the rectangles of two, with the planes of either."""
    large, small = sorted((one, other), key=lambda row: -(row[U0 + 1] - row[U0]) * (row[V0 + 1] - row[V0]))
    row = large.copy()
    row[[U0, V0]] = np.minimum(one[[U0, V0]], other[[U0, V0]])
    row[[U0 + 1, V0 + 1]] = np.maximum(one[[U0 + 1, V0 + 1]], other[[U0 + 1, V0 + 1]])
    for place in range(PLANES):
        if not np.isfinite(row[OFFSET + place]) and np.isfinite(small[OFFSET + place]):
            row[OFFSET + place] = small[OFFSET + place]
            if place < LEVEL:
                row[SLOPE + place], row[LEAN + place] = small[SLOPE + place], small[LEAN + place]
    return row
