"""The test of whether anything stands on a footprint.

Its roof points are compared with the plane of the ground around it.

Buildings that were pulled down leave ground, rubble and bushes where their footprint still is. Of
the points on them a quarter or more lies on the ground, of those on standing buildings an eighth at
most: the feet of walls.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely

from ..geometry.grid import number_cells

RINGS_M = (1.5, 4.0, 7.0)
"""Distances (m) from the outline at which the ground around it is asked for; city runs know it up
to 10 m.
"""

NEEDLESS_M = 0.2
"""Distance (m) within which corners of the outline do not matter for these rings."""

PLACE_M = 2.0
"""Distance (m) between the places asked for on each of these."""

FEWEST_PLACES = 8
"""Places with a known ground below which no plane is fitted."""

ROUNDS, BESIDE_PLANE_M = 3, 0.4
"""Rounds of fitting the plane, each without the places farther (m) from the last: kerbs, terraces,
cars taken for ground.
"""

MOST_ROUGH_M = 0.6
"""Median distance (m) of places from the plane above which the ground is no plane."""

LOW_SHARE, LOW_ROUNDS, SMOOTH_M = 0.2, 30, 0.05
"""Share of the places that then lie below the plane: the class of the ground holds all that is not
inside of footprints, also hedges, sheds and cars. Rounds in which it is found, and distance (m)
below which places weigh alike. A lower plane hides more, and a higher one lies on roofs
(benchmarks/HISTORY.md).
"""

DEEPEST_M = 4.0
"""Depth (m) below that plane to which points lie on the ground: the pit of a cellar.

Others have heights of another kind.
"""

CLEAR_M = 0.5
"""Height (m) over that plane below which a point lies on the ground; the lowest roofs of sheds are
1.8 m high.
"""

LEAST_LOW = 0.25
"""Share of the points on the ground from which on a building may be gone
(benchmarks/bare_ground.py).
"""

LEAST_COVER = 0.4
"""Share of the plan that has more points above the ground than on it, from which on something
stands all the same: a house with a yard, or a carport with ground seen below its roof.
"""

CELL_POINTS = 6.0
"""Points in a cell of the plan in the mean, by which that share is told."""


@dataclass(frozen=True)
class Standing:
    """The evidence of a footprint's points.

    It says whether each (n,) lies on the ground, the share that does, and whether nothing stands
    there.
    """

    is_low: np.ndarray
    low_share: float
    is_empty: bool


def classify_standing(points: np.ndarray, plane: np.ndarray) -> Standing:
    """Judge what stands on the ground `plane` (3,).

    The points (n, 3) are those inside a footprint.
    """
    height = points[:, 2] - points[:, :2] @ plane[:2] - plane[2]
    mask = (height < CLEAR_M) & (height > -DEEPEST_M)
    share = float(mask.mean()) if len(points) else 0.0
    return Standing(mask, share, share >= LEAST_LOW and cover(points, ~mask) < LEAST_COVER)


def cover(points: np.ndarray, is_high: np.ndarray) -> float:
    """Return the share of the cells in which half of the points are high.

    Cells hold points (n, 3).
    """
    extent = np.maximum(np.ptp(points[:, :2], axis=0), 0.1)
    side = float(np.sqrt(extent.prod() * CELL_POINTS / len(points)))
    cells = np.floor((points[:, :2] - points[:, :2].min(axis=0)) / side)
    _, index = number_cells(cells)
    return float((2 * np.bincount(index, is_high) >= np.bincount(index)).mean())


def ground_plane(
    outline: shapely.Polygon, height_at: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray | None:
    """Fit a plane through the ground around `outline`.

    It is (3,) a, b, c of z = a x + b y + c, None where it is not known. Where much stands on the
    ground that is called so, it lies low.

    `height_at` gives the ground's height (n,) at places (n, 2) in the outline's frame, NaN where it
    is unknown.
    """
    outline = shapely.simplify(outline, NEEDLESS_M)
    places = places_along(shapely.buffer(outline, RINGS_M, quad_segs=2))
    heights = height_at(places)
    mask = np.isfinite(heights)
    if mask.sum() < FEWEST_PLACES:
        return None
    places, heights = np.column_stack([places, np.ones(len(places))])[mask], heights[mask]
    level = float(np.median(heights))
    plane, selection = np.array([0.0, 0.0, level]), np.ones(len(heights), bool)
    for _ in range(ROUNDS):
        plane = np.linalg.lstsq(places[selection], heights[selection], rcond=None)[0]
        off = np.abs(places @ plane - heights)
        before, selection = selection, off < max(BESIDE_PLANE_M, 2.0 * float(np.median(off)))
        if (selection == before).all():
            break
    return plane if np.median(off) < MOST_ROUGH_M else fit_low_plane(places, heights)


def fit_low_plane(places: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Fit a plane (3,) above LOW_SHARE of the heights (n,) at `places` (n, 3: x, y, 1).

    It is that quantile's regression, by least squares with weights of the distances.
    """
    plane = np.array([0.0, 0.0, np.quantile(heights, LOW_SHARE)])
    for _ in range(LOW_ROUNDS):
        over = heights - places @ plane
        side = np.where(over > 0, LOW_SHARE, 1 - LOW_SHARE)
        root = np.sqrt(side / np.maximum(np.abs(over), SMOOTH_M))
        plane = np.linalg.lstsq(root[:, None] * places, root * heights, rcond=None)[0]
    return plane


def places_along(areas: np.ndarray) -> np.ndarray:
    """Return places (n, 2) along the outer rings of `areas` (m,)."""
    rings = shapely.get_exterior_ring(shapely.get_parts(areas))
    places, ring = shapely.get_coordinates(shapely.segmentize(rings, PLACE_M), return_index=True)
    return places[np.diff(ring, append=-1) == 0]  # without the last of each, which is its first
