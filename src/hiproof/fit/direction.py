"""Plan directions of a roof before any fit. Compiled.

They are those of its slopes, of its smallest rectangle, and of a given outline.
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from ..compiled import compiled
from ..geometry.arrays import sort_values

# rad within which edges support a direction of an outline, and whose mean it is
PEAK_RAD, NEAR_PEAK_RAD = math.radians(3.0), math.radians(5.0)


@compiled
def nearest(points, i, indices, distances):
    """Write the indices of the points nearest to point `i`, and count them.

    The point itself is included.

    `points` ascend in x.

    Searches outwards on both sides of `i` and ends a side where x alone is too far.
    """
    indices[0], distances[0], count, farthest = i, 0.0, 1, np.inf
    for direction in (-1, 1):
        j = i + direction
        while 0 <= j < len(points):
            dx, dy, dz = (
                points[j, 0] - points[i, 0],
                points[j, 1] - points[i, 1],
                points[j, 2] - points[i, 2],
            )
            if dx * dx >= farthest:
                break
            squared = dx * dx + dy * dy + dz * dz
            if squared < farthest:
                if count < len(indices):
                    count += 1
                k = count - 1
                while k > 0 and distances[k - 1] > squared:
                    distances[k], indices[k] = distances[k - 1], indices[k - 1]
                    k -= 1
                distances[k], indices[k] = squared, j
                if count == len(indices):
                    farthest = distances[count - 1]
            j += direction
    return count


@compiled
def local_slope(points, indices):
    """Return (a, b, mean squared residual) of a least-squares plane.

    It goes through `points[indices]`.

    NaN where they are a line.
    """
    centre = np.zeros(3)
    for j in indices:
        centre += points[j, :3] / len(indices)
    xx = xy = yy = xz = yz = zz = 0.0
    for j in indices:
        x, y, z = points[j, 0] - centre[0], points[j, 1] - centre[1], points[j, 2] - centre[2]
        xx += x * x
        xy += x * y
        yy += y * y
        xz += x * z
        yz += y * z
        zz += z * z
    determinant = xx * yy - xy * xy
    if determinant < 1e-3 * (xx + yy) ** 2 or determinant <= 0.0:
        return np.nan, np.nan, np.nan
    a, b = (xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant
    return a, b, max(zz - a * xz - b * yz, 0.0) / len(indices)


@compiled
def slope_direction(points, queries, neighbours):
    """Return (kappa, confidence 0..1) of the slopes' common direction.

    It is that of the four-fold harmonic of the azimuths of local slopes, at about `queries` points.

    Steep and well-fitted neighbourhoods count more; twice re-weighted towards the peak. `points`
    (n, 3 or more) ascend in x.
    """
    stride = max(1, len(points) // queries)
    azimuths, weights = np.empty(len(points)), np.empty(len(points))
    indices, distances = np.empty(neighbours, np.int64), np.empty(neighbours)
    count = 0
    for i in range(0, len(points), stride):
        result = nearest(points, i, indices, distances)
        a, b, squared = local_slope(points, indices[:result])
        slope = math.hypot(a, b)
        if 0.08 < slope < 2.5:
            azimuths[count], weights[count] = (
                math.atan2(b, a),
                min(slope, 1.0) / (1.0 + squared / 0.0064),
            )
            count += 1
    kappa, sharpness, confidence = 0.0, 0.0, 0.0
    for _ in range(3):
        real = imaginary = total = 0.0
        for k in range(count):
            angle = 4.0 * (azimuths[k] - kappa)
            w = weights[k] * math.exp(sharpness * (math.cos(angle) - 1.0))
            real += w * math.cos(angle)
            imaginary += w * math.sin(angle)
            total += weights[k]
        kappa += math.atan2(imaginary, real) / 4.0
        confidence = math.hypot(real, imaginary) / (total + 1e-9)
        sharpness = 6.0
    return kappa, confidence


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
