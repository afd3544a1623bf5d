"""The horizon that buildings make around places on roofs, compiled.

Models have upright walls and nothing below their roofs, so whatever lies under a roof's edge is
dark: a ray from a place is free where it passes over every roof edge that it crosses in plan. One
ray is cast in the middle of each of SECTORS directions, and the horizon there is exact.
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled

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
    middles = (np.arange(SECTORS) + 0.5) * (2 * np.pi / SECTORS)
    directions = np.column_stack([np.sin(middles), np.cos(middles)])
    horizon = np.zeros((len(places), SECTORS))
    raise_horizon(horizon, np.ascontiguousarray(places), np.ascontiguousarray(edges), directions)
    return horizon


@compiled
def raise_horizon(horizon, places, edges, directions):
    """Raise the tangents `horizon` (n, s) around `places` by edges (m, 2, 3).

    Rays run in `directions` (s, 2), the middles of s equal sectors, clockwise from the north.
    """
    count = len(directions)
    width = 2.0 * np.pi / count
    for i in range(len(places)):
        x, y, z = places[i, 0], places[i, 1], places[i, 2]
        for e in range(len(edges)):
            az, bz = edges[e, 0, 2] - z, edges[e, 1, 2] - z
            if az <= 0.0 and bz <= 0.0:
                continue
            ax, ay = edges[e, 0, 0] - x, edges[e, 0, 1] - y
            bx, by = edges[e, 1, 0] - x, edges[e, 1, 1] - y
            first = np.arctan2(ax, ay)
            turn = np.arctan2(bx, by) - first
            if turn > np.pi:
                turn -= 2.0 * np.pi
            elif turn < -np.pi:
                turn += 2.0 * np.pi
            low = first if turn > 0.0 else first + turn
            start = int(np.ceil(low / width - 0.5))
            end = int(np.floor((low + abs(turn)) / width - 0.5))
            for k in range(start, end + 1):
                sector = k % count
                dx, dy = directions[sector, 0], directions[sector, 1]
                along = dx * (by - ay) - dy * (bx - ax)
                if along == 0.0:
                    continue
                u = -(dx * ay - dy * ax) / along
                distance = dx * (ax + u * (bx - ax)) + dy * (ay + u * (by - ay))
                if distance > 1e-6:
                    rise = (az + u * (bz - az)) / distance
                    horizon[i, sector] = max(horizon[i, sector], rise)


def measure_share(horizon: np.ndarray, sector: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """Return the share (t,) of places that see each sun position.

    Positions lie in `sector` (t,) at elevations of `tangent` (t,).
    """
    return (tangent > horizon[:, sector]).mean(axis=0)
