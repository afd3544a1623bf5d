"""Plan directions of a roof before any fit. Compiled.

They are those of its slopes, of its smallest rectangle, and of a given outline.
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from ..compiled import compiled
from ..geometry.arrays import sort_values

SMOOTH_M = 0.08  # Roughness (m) at which a neighbourhood counts half.
SLOPE_WIDTH_RAD = math.radians(8.3)  # Slopes further off the common direction hardly count.
SLOPES = 0.08, 2.5  # Gentler slopes show no direction, steeper ones are walls.
# rad within which edges support a direction of an outline, and whose mean it is
PEAK_RAD, NEAR_PEAK_RAD = math.radians(3.0), math.radians(5.0)


def slope_direction(points: np.ndarray, queries: int, neighbours: int) -> tuple[float, float]:
    """Return the direction (rad) that the slopes have in common, and a confidence of 0 to 1.

    It is the four-fold harmonic of the azimuths of slopes at about `queries` of the points (n, 3 or
    more), each of so many `neighbours`. Steep and smooth neighbourhoods count more.
    """
    from ..segment.sampling import find_harmonic, local_surfaces  # with scipy.spatial

    order = np.arange(0, len(points), max(1, len(points) // queries))
    x, y, z, roughness = local_surfaces(points[:, :3], order, neighbours)[:, :4].T
    slope = np.hypot(x, y) / np.maximum(z, 1e-9)
    weight = np.minimum(slope, 1.0) / (1.0 + (roughness / SMOOTH_M) ** 2)
    is_roof = (slope > SLOPES[0]) & (slope < SLOPES[1])
    return find_harmonic(np.arctan2(y, x)[is_roof], weight[is_roof], SLOPE_WIDTH_RAD)


@compiled
def rectangle_direction(points, trim, angles):
    """Return the direction in 0..pi/2 of the smallest rectangle.

    It is one of `angles`. The rectangle holds all but `trim` of the points per side.
    """
    extents = np.empty(2 * angles)
    across = np.empty(len(points))
    for k in range(2 * angles):
        c, s = math.cos(k * math.pi / (2 * angles)), math.sin(k * math.pi / (2 * angles))
        for i in range(len(points)):
            across[i] = c * points[i, 0] + s * points[i, 1]
        lower, upper = trimmed_range(across, trim)
        extents[k] = upper - lower
    areas = extents[:angles] * extents[angles:]
    return np.argmin(areas) * math.pi / (2 * angles)


@compiled
def trimmed_range(values, trim):
    """Return the range of all `values` but a share `trim` at each end."""
    ordered = sort_values(values)
    cut = int(trim * len(values))
    return ordered[cut], ordered[len(values) - 1 - cut]


@compiled
def rectangle_in_direction(points, kappa, trim):
    """Return the trimmed rectangle of the points in the direction `kappa`.

    It is a plan (5,): cx, cy, kappa, V, U.
    """
    c, s = math.cos(kappa), math.sin(kappa)
    low_u, high_u = trimmed_range(c * points[:, 0] + s * points[:, 1], trim)
    low_v, high_v = trimmed_range(c * points[:, 1] - s * points[:, 0], trim)
    u, v = 0.5 * (low_u + high_u), 0.5 * (low_v + high_v)
    return np.array(
        [c * u - s * v, s * u + c * v, kappa, 0.5 * (high_v - low_v), 0.5 * (high_u - low_u)]
    )


def quarter_gap(angle):
    """Return how far `angle` (rad) is from the nearest quarter turn.

    It is in [-45, 45) degrees, for arrays or, compiled, for one angle.
    """
    return angle - np.floor(angle / (0.5 * math.pi) + 0.5) * (0.5 * math.pi)


def measure_support(
    candidates: np.ndarray, angle: np.ndarray, weight: np.ndarray, spread_rad: float
) -> np.ndarray:
    """Return the weight (k,) of the directions near each candidate.

    Directions are `angle` (n,), `candidates` (k,), all modulo 90 degrees.

    >>> measure_support(np.array([0.0, 0.5]), np.array([0.0, 0.5 * math.pi, 0.5]), np.array([2.0,
    ...     3.0,
    ...     1.0]), 0.01)
    array([5., 1.])
    """
    gaps = quarter_gap(angle[None, :] - candidates[:, None])
    return (weight * np.exp(-0.5 * (gaps / spread_rad) ** 2)).sum(axis=1)


def main_direction(outline: shapely.Polygon) -> float:
    """Return the angle (rad) of the outline's main direction modulo 90 degrees.

    It is at the peak of its edges' lengths, then at their mean.

    >>> round(math.degrees(main_direction(shapely.box(0, 0, 4, 3))) % 90, 6)
    0.0
    """
    edges = np.diff(shapely.get_coordinates(outline.exterior), axis=0)
    length, angle = np.hypot(edges[:, 0], edges[:, 1]), np.arctan2(edges[:, 1], edges[:, 0])
    candidates = angle[length > 0.5] if (length > 0.5).any() else angle
    if len(candidates) > 200:
        candidates = np.radians(np.arange(0.0, 90.0, 0.5))
    peak = candidates[np.argmax(measure_support(candidates, angle, length, PEAK_RAD))]
    gap = quarter_gap(angle - peak)
    weight = length * (np.abs(gap) < NEAR_PEAK_RAD)
    return float(peak + (weight * gap).sum() / max(weight.sum(), 1e-12))


def outline_rectangle(outline: shapely.Polygon, kappa: float) -> np.ndarray:
    """Return the outline's bounding rectangle in the direction `kappa`.

    It is a plan (5,): cx, cy, kappa, V, U.
    """
    return rectangle_in_direction(np.asarray(outline.exterior.coords)[:, :2], kappa, 0.0)
