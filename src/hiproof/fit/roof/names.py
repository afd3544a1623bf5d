"""Read the volumes of a roof as planes and sides by place, to be named as parts.

What is equal is read off the numbers that planes share. A part's deviations follow from the
unknowns' covariance and from those of the sides' places.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely

from ..candidates.volumes import LEVEL
from .parts import GIVEN_M, STRAIGHT, OutlineWall, Planes, Side
from .tables import N_SIDES, UNKNOWN_COUNT, Tables, read_line

FACED = 0.9  # Cosine of the angle up to which a plane faces one of four axes.


def find_axes(roof: Tables, k: int, numbers: list[int]) -> np.ndarray:
    """Return the axes (2, 2) of volume k with planes `numbers`: along the first, else its sides."""
    sloping = [p for p in numbers if roof.slopes[k, p] >= 0]
    lines = roof.plane_lines[k, sloping] if sloping else roof.sides[k, 2:]
    a, b, _ = read_line(roof, lines[0])
    angle = math.remainder(math.atan2(b, a), 0.5 * math.pi)
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s], [-s, c]])


def read_planes(
    roof: Tables, k: int, numbers: list[int], axes: np.ndarray, covariance: np.ndarray
) -> Planes:
    """Return planes of volume k, by `numbers`, in its axes.

    `covariance` (u, u) is that of the roof's unknowns.
    """
    n_unknowns = roof.counts[UNKNOWN_COUNT]
    walls: list[OutlineWall] = []
    rows = np.full((N_SIDES + 1, 3), np.nan)
    design = np.zeros((N_SIDES + 1, 3, n_unknowns))
    for p in numbers:
        a, b, c = read_line(roof, roof.plane_lines[k, p])
        u, v = (x if abs(x) > STRAIGHT else 0.0 for x in (axes @ [a, b]).tolist())
        slope = roof.values[roof.slopes[k, p]] if roof.slopes[k, p] >= 0 else 0.0
        way = math.copysign(1.0, slope)  # a plane faces the side that it falls to
        place, cosine = (LEVEL, 1.0) if roof.slopes[k, p] < 0 else find_place(way * u, way * v)
        if cosine <= FACED or np.isfinite(rows[place, 2]):
            walls.append(OutlineWall(math.atan2(-way * v, -way * u), way * c))
            rows, design = (
                np.concatenate([x, np.zeros((1, *x.shape[1:]))]) for x in (rows, design)
            )
            place = len(rows) - 1
        rows[place] = [slope * u, slope * v, roof.planes[k, p, 2]]
        design[place, 2, roof.heights[k, p]] = 1.0
        if roof.slopes[k, p] >= 0:
            design[place, :, roof.slopes[k, p]] += [u, v, c]
    used = np.flatnonzero(design.any(axis=(0, 1)))
    return Planes(rows, design[:, :, used], covariance[np.ix_(used, used)], tuple(walls))


def find_place(u: float, v: float) -> tuple[int, float]:
    """Return which of the four sides a line that faces along u, v is, and the cosine to it."""
    along = [u, -u, v, -v]
    place = max(range(N_SIDES), key=along.__getitem__)
    return place, along[place]


def read_sides(
    roof: Tables, k: int, axes: np.ndarray, anchored: Sequence[bool], sigma
) -> list[Side]:
    """Return the sides of volume k by place in its axes."""
    sides = [Side(0.0)] * N_SIDES
    for s in range(N_SIDES):
        a, b, c = read_line(roof, roof.sides[k, s])
        u, v = (axes @ [a, b]).tolist()
        place, _ = find_place(u, v)
        x, y = (u, v) if place < 2 else (v, u)
        sides[place] = Side(-c / x, -y / x, bool(anchored[s]), float(sigma[s]))
    return sides


def cut_sides(
    sides: list[Side], corners: np.ndarray, axes: np.ndarray, outline: shapely.Polygon
) -> list[Side]:
    """Return sides of which those that the `corners` (n, 2) of a place do not reach end there.

    So do straight ones beyond which the place goes on. Nothing determines the places of these ends
    but the outline, where they lie on it.
    """
    is_given = shapely.dwithin(shapely.points(corners), outline.boundary, GIVEN_M)
    corners = corners @ axes.T
    lowest, highest = corners.min(axis=0), corners.max(axis=0)
    ends = [lowest[0], highest[0], lowest[1], highest[1]]
    cut = list(sides)
    for k, (side, end) in enumerate(zip(sides, ends, strict=True)):
        place = side.offset + side.lean * corners[:, 1 - k // 2].mean()
        beyond = (1 if k % 2 else -1) * (end - place)
        if beyond <= -GIVEN_M or (beyond >= GIVEN_M and side.lean == 0.0):
            is_end = np.abs(corners[:, k // 2] - end) < GIVEN_M
            cut[k] = Side(float(end), 0.0, True, 0.0 if is_given[is_end].all() else math.inf)
    return cut
