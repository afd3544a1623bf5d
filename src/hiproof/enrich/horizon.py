"""The horizon that buildings make around places on roofs.

Models have upright walls and nothing below their roofs, so whatever lies under a roof's edge is
dark: a ray from a place is free where it passes over every roof edge that it crosses in plan. One
ray is cast in the middle of each of SECTORS directions, and the horizon there is exact.
"""

from __future__ import annotations

import numpy as np

from ..geometry.grid import expand

SECTORS = 180  # directions of rays around a place, 2 degrees apart
LIFT_M = 0.01  # height (m) of a place over its roof, so that rounding does not hide it


def find_horizon(places: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the tangents (n, SECTORS) of the horizon around `places` (n, 3).

    `edges` (m, 2, 3) are edges of roofs. Sector 0 begins in the north, and sectors follow
    clockwise. The horizon is nowhere below level.

    >>> wall = np.array([[[-50.0, 10.0, 5.0], [50.0, 10.0, 5.0]]])
    >>> horizon = find_horizon(np.zeros((1, 3)), wall)
    >>> round(float(horizon[0, 0]), 3), float(horizon[0, 90])
    (0.5, 0.0)
    """
    width = 2 * np.pi / SECTORS
    horizon = np.zeros((len(places), SECTORS))
    ends = edges - places[:, None, None]
    place, edge = np.nonzero(ends[:, :, :, 2].max(axis=2) > 0.0)
    a, b = ends[place, edge].swapaxes(0, 1)
    first, last = (np.arctan2(end[:, 0], end[:, 1]) for end in (a, b))
    turn = (last - first + np.pi) % (2 * np.pi) - np.pi
    low = np.minimum(first, first + turn)
    start = np.ceil(low / width - 0.5).astype(np.int64)
    end = np.floor((low + np.abs(turn)) / width - 0.5).astype(np.int64)
    # one row for each edge and each ray that crosses it
    row, step = expand(np.maximum(end - start + 1, 0))
    sector = (start[row] + step) % SECTORS
    angle = (sector + 0.5) * width
    ray, a, way = np.array([np.sin(angle), np.cos(angle)]), a[row].T, (b - a)[row].T
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (ray[1] * a[0] - ray[0] * a[1]) / (ray[0] * way[1] - ray[1] * way[0])
        distance = (ray * (a[:2] + share * way[:2])).sum(axis=0)
        rise = (a[2] + share * way[2]) / distance
    ahead = distance > 1e-6
    np.maximum.at(horizon, (place[row][ahead], sector[ahead]), rise[ahead])
    return horizon


def measure_share(horizon: np.ndarray, sector: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """Return the share (t,) of places that see each sun position.

    Positions lie in `sector` (t,) at elevations of `tangent` (t,).
    """
    return (tangent > horizon[:, sector]).mean(axis=0)
