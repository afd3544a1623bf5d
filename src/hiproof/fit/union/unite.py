"""Merge volumes that only skewed walls keep apart.

One volume takes their place if planes along its own sides explain its points as well. The search's
planes face along two axes. A roof over walls that are not quite parallel has other planes, and two
volumes beside each other then stand for one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
import shapely

from .cants import Cache, fit_planes, list_walls
from .cut_corners import draw_over_corners
from .finish import SQUARE_LEAN, Planes
from .moves import refit_volumes, remove_volume
from .objective import compute_costs, compute_objective, is_base_visible, price_edges
from .plan import Plan
from .prices import ALONG_AXES_UNITS, FITTING_UNITS
from .scene import Scene
from .sides import (
    OUTLINE_REACH_M,
    Side,
    SideLines,
    choose_sides,
    list_chords,
    list_edges,
    list_lines,
)
from .volumes import (
    DIRECTION,
    LEAN0,
    LEVEL,
    N_PLANES,
    OFFSET0,
    REPLACES,
    SLOPE0,
    U0,
    V0,
    V1,
    compute_roof_heights,
    list_movable,
    measure_runs,
    price_volume,
)

UNITE_GAP_M = 0.4  # Largest distance (m) between the rectangles.
UNITE_OFFSET_M = 1.0  # Largest distance (m) of their sides along the line of both.
SLOPES_ALIKE = 0.15  # Volumes whose slopes (rise over run) differ more are not tried as one.
HEIGHTS_ALIKE_M = 0.5  # Volumes whose heights (m) differ more are not tried as one.
# Most volumes drawn out over walls that cut corners off: a house has one bay or two.
MOST_CUT_CORNERS = 2


class OutlineEnds(NamedTuple):
    """The lines of an outline at which volumes end.

    Its `edges` and `chords` (2, m, 2) are in the first direction's axes, `lines` are those of these
    that sides may take, by direction, and `walls` are (m, 2, 2). `outline` (2, n, 2) are all edges,
    near or not.
    """

    edges: np.ndarray
    chords: np.ndarray
    lines: list[list[SideLines]]
    walls: np.ndarray
    outline: np.ndarray


@dataclass(frozen=True)
class DrawnRoof:
    """Volumes (k, COLUMNS) with their sides and planes, and the roof's cost."""

    volumes: np.ndarray
    sides: list[list[Side]]
    planes: list[Planes]
    cost: float


def unite_volumes(
    volumes: np.ndarray,
    ends: OutlineEnds,
    scene: Scene,
    cache: Cache,
    covers_corners: bool = True,
) -> DrawnRoof:
    """Draw the volumes along their sides, and drop or merge those that do not pay.

    Planes in the `cache` of this scene are not fitted again. `covers_corners` says whether one
    volume may replace several over walls that cut its corners off.
    """
    value = compute_objective(volumes, scene, np.inf)
    best = draw_roof(volumes, ends, scene, cache)
    if covers_corners:
        best = cover_cut_corners(best, ends, scene, cache)
    has_improved = True
    while has_improved:
        has_improved = False
        for trial in list_reductions(best):
            if is_base_bared(trial, best.volumes, scene):
                continue
            trial, trial_value = refit_volumes(
                trial, scene, compute_objective(trial, scene, np.inf)
            )
            gain = max(value - best.cost, 0.0)  # of planes that face walls
            if trial_value > value + gain + ALONG_AXES_UNITS * scene.evidence:
                continue
            roof = draw_roof(trial, ends, scene, cache)
            if roof.cost < best.cost:
                best, value, has_improved = roof, trial_value, True
                break
    return best


def gather_ends(outline: shapely.Polygon, plan: Plan, scene: Scene) -> OutlineEnds:
    edges, chords = list_edges(outline, plan), list_chords(outline, plan)
    return OutlineEnds(
        edges,
        chords,
        list_lines(edges, chords, scene.turn, edges),
        list_walls(outline, plan),
        edges,
    )


def select_ends(ends: OutlineEnds, scene: Scene) -> OutlineEnds:
    """Select those of the ends that reach into a scene, or nearly do."""
    lower = np.array([scene.corner_u, scene.corner_v]) - OUTLINE_REACH_M
    upper = lower + np.multiply(scene.depth.shape, scene.pitch) + 2.0 * OUTLINE_REACH_M
    edges, chords, walls = (
        lines[:, is_reaching(lines, lower, upper)]
        for lines in (ends.edges, ends.chords, ends.walls.swapaxes(0, 1))
    )
    lines = list_lines(edges, chords, scene.turn, ends.outline)
    return OutlineEnds(edges, chords, lines, walls.swapaxes(0, 1), ends.outline)


def is_reaching(lines: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Return which of the lines between ends (2, m, 2) reach into a box.

    It reaches from `lower` to `upper` (2,).
    """
    return ((lines.min(axis=0) < upper) & (lines.max(axis=0) > lower)).all(axis=1)


def cover_cut_corners(roof: DrawnRoof, ends: OutlineEnds, scene: Scene, cache: Cache) -> DrawnRoof:
    """Replace several volumes by one over walls that cut its corners off, if cheaper.

    This happens at most MOST_CUT_CORNERS times.
    """
    for _ in range(MOST_CUT_CORNERS):
        roof_before = roof
        for trial in draw_over_corners(roof_before.volumes, ends.walls, scene):
            if bound_cost(trial, scene) > roof.cost + FITTING_UNITS * scene.evidence:
                continue
            if is_base_bared(trial, roof_before.volumes, scene):
                continue
            trial, _ = refit_volumes(trial, scene, compute_objective(trial, scene, np.inf))
            trial_roof = draw_roof(trial, ends, scene, cache)
            roof = trial_roof if trial_roof.cost < roof.cost else roof
        if roof is roof_before:
            break
    return roof


def is_base_bared(trial: np.ndarray, volumes: np.ndarray, scene: Scene) -> bool:
    """Return whether a trial bares the base, and the volumes that it replaces do not."""
    return is_base_visible(trial, scene) and not is_base_visible(volumes, scene)


def bound_cost(volumes: np.ndarray, scene: Scene) -> float:
    """Return what a roof costs at least, whatever further planes lower it.

    It costs its volumes, its edges, and the points above it.
    """
    z, _ = compute_roof_heights(volumes, scene.U, scene.V, scene.order)
    is_above = scene.z[: scene.n] > z[: scene.n]
    return float(compute_costs(z, scene)[: scene.n][is_above].sum()) + price_structure(
        volumes, scene
    )


def price_structure(volumes: np.ndarray, scene: Scene) -> float:
    return scene.evidence * sum(price_volume(volume) for volume in volumes[1:]) + price_edges(
        volumes, scene, np.inf
    )


def list_reductions(roof: DrawnRoof) -> Iterator[np.ndarray]:
    """Yield volumes with two alike merged, and without one.

    The latter are tried if sides are not square to each other.
    """
    movable = list_movable(roof.volumes).tolist()
    for j, k in combinations(movable, 2):
        if is_alike(roof.volumes[j], roof.volumes[k]):
            trial = roof.volumes.copy()
            trial[j] = merge_rectangles(trial[j], trial[k])
            yield remove_volume(trial, k)
    if any(abs(side.lean) > SQUARE_LEAN for volume_sides in roof.sides for side in volume_sides):
        for k in reversed(movable):
            yield remove_volume(roof.volumes, k)


def draw_roof(volumes: np.ndarray, ends: OutlineEnds, scene: Scene, cache: Cache) -> DrawnRoof:
    """Draw the volumes with their sides and the planes that suit these.

    Sides are on the outline's lines where these are near.
    """
    key = volumes.tobytes()
    if key not in cache:
        sides = choose_sides(volumes, ends.lines, scene)
        planes = fit_planes(volumes, sides, ends.walls, scene, cache)
        misfit = sum(volume_planes.cost + volume_planes.price for volume_planes in planes)
        cache[key] = DrawnRoof(volumes, sides, planes, misfit + price_structure(volumes, scene))
    return cache[key]


def is_alike(row: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two volumes lie beside each other in line, with similar planes."""
    if row[DIRECTION] != other[DIRECTION] or row[REPLACES] or other[REPLACES]:
        return False
    if not is_in_line(row[U0 : V1 + 1].tolist(), other[U0 : V1 + 1].tolist()):
        return False
    # The axes are volume, axis, end.
    rectangles = np.array([row[U0 : V1 + 1], other[U0 : V1 + 1]]).reshape(2, 2, 2)
    is_present = (
        np.isfinite(row[OFFSET0 : OFFSET0 + N_PLANES]),
        np.isfinite(other[OFFSET0 : OFFSET0 + N_PLANES]),
    )
    is_shared = is_present[0] & is_present[1]
    if is_shared.sum() < min(is_present[0].sum(), is_present[1].sum()) or is_shared.sum() == 0:
        return False
    middle = rectangles.mean(axis=(0, 2))
    x = np.array([[*measure_runs(volume, *middle), 0.0] for volume in (row, other)])
    slopes = np.array([np.r_[volume[SLOPE0 : SLOPE0 + LEVEL], 0.0] for volume in (row, other)])
    heights = (
        np.array([row[OFFSET0 : OFFSET0 + N_PLANES], other[OFFSET0 : OFFSET0 + N_PLANES]])
        + slopes * x
    )
    is_near = np.abs(heights[0, is_shared] - heights[1, is_shared]) < HEIGHTS_ALIKE_M
    return bool(is_near.all() and (np.abs(slopes[0] - slopes[1])[is_shared] < SLOPES_ALIKE).all())


def is_in_line(rectangle: list[float], other: list[float]) -> bool:
    """Return whether two rectangles lie beside each other in one line.

    The rectangles are u0, u1, v0, v1.
    """
    for column, across in ((0, 2), (2, 0)):
        gap = max(rectangle[column], other[column]) - min(rectangle[column + 1], other[column + 1])
        offset = max(
            abs(rectangle[across] - other[across]), abs(rectangle[across + 1] - other[across + 1])
        )
        if gap < UNITE_GAP_M and offset < UNITE_OFFSET_M:
            return True
    return False


def merge_rectangles(volume: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return one volume over the rectangles of two, with the planes of either."""
    large, small = sorted(
        (volume, other), key=lambda row: -(row[U0 + 1] - row[U0]) * (row[V0 + 1] - row[V0])
    )
    row = large.copy()
    row[[U0, V0]] = np.minimum(volume[[U0, V0]], other[[U0, V0]])
    row[[U0 + 1, V0 + 1]] = np.maximum(volume[[U0 + 1, V0 + 1]], other[[U0 + 1, V0 + 1]])
    for place in range(N_PLANES):
        if not np.isfinite(row[OFFSET0 + place]) and np.isfinite(small[OFFSET0 + place]):
            row[OFFSET0 + place] = small[OFFSET0 + place]
            if place < LEVEL:
                row[SLOPE0 + place], row[LEAN0 + place] = (
                    small[SLOPE0 + place],
                    small[LEAN0 + place],
                )
    return row
