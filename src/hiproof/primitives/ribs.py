"""Draw the facets of curved parts, along the outline's sides where a rim follows these.

An eave is straight between two corners of the outline. Facets of other directions would cut it
into teeth. Where the rim has no corners of the outline, facets go on in equal angles.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely

from ..geometry.rings import counterclockwise
from ..model import Part, Piece
from .catalogue import CATALOGUE
from .contract import CX, CY, HALF_LENGTH, HALF_WIDTH, Primitive
from .facets import MOST_FACETS, find_apothem

FEWEST_CORNERS = 4  # Corners of the outline on a rim: fewer lie there by chance.
ON_RIM = (0.95, 1.15)  # Distances of such corners, in radii of the circle with the rim's area.
ON_PLAN_M = 0.02  # Farthest (m) of a corner from the border of the part's plan.
LEAST_STEP = 0.25  # Angle of a facet at least, in those of the regular shape.
WIDEST_RAD = 0.5 * math.pi  # A facet takes less of the rim.


def draw_facets(part: Part, outline: shapely.Polygon, chord_m: float) -> Part:
    """Return a part of a roof over `outline` with facets along it, or within a tolerance (m).

    A part that is not curved stays as it is.
    """
    refine = CATALOGUE[part.type].refine if part.type in CATALOGUE else None
    if refine is None or not part.parameters:
        return part
    shape = refine(part.parameters, chord_m)
    theta = shape.to_theta(part.parameters, part.kappa, part.translation)
    sides = count_sides(part, shape)
    least = max(LEAST_STEP / sides, len(shape.planes) / sides / MOST_FACETS)
    corners = list_rim_corners(part, theta, outline, 2.0 * math.pi * least)
    if len(corners) < FEWEST_CORNERS:
        return replace(part, pieces=shape.make_pieces(part.outlines, shape.planes_at(theta)))
    return replace(part, pieces=draw_between(part, shape, theta, corners))


def count_sides(part: Part, shape: Primitive) -> int:
    """Count the facets of a ring of a whole round shape."""
    return 2 * len(shape.rim) - 2 if part.type == "half_cone" else len(shape.rim)


def find_axis(part: Part, theta: np.ndarray) -> np.ndarray:
    """Return x, y of the axis of a round part, NaN for other parts and ellipses."""
    depth, radius = theta[HALF_LENGTH], theta[HALF_WIDTH]
    if part.type == "half_cone" and math.isclose(2.0 * depth, radius, rel_tol=0.02):
        return theta[[CX, CY]] - depth * np.array([math.cos(part.kappa), math.sin(part.kappa)])
    is_circle = part.type not in ("barrel", "half_cone") and depth == radius
    return theta[[CX, CY]] if is_circle else np.full(2, np.nan)


def list_rim_corners(
    part: Part, theta: np.ndarray, outline: shapely.Polygon, least: float
) -> np.ndarray:
    """List the corners (n, 3) of an outline on a round part's rim, counter-clockwise.

    They are the angle around the axis, the distance (m) from it, and 1 where a side of the outline
    leads to the next one, else 0. They are `least` (rad) apart.
    """
    ring = counterclockwise(outline.exterior)[:-1]
    x, y = (ring - find_axis(part, theta)).T
    distances = np.hypot(x, y)
    low, high = (share * theta[HALF_WIDTH] for share in ON_RIM)
    is_rim = (distances >= low) & (distances <= high)
    borders = [polygon.exterior for polygon in part.outlines]
    places = shapely.points(ring[is_rim])
    is_rim[is_rim] = shapely.dwithin(places[:, None], borders, ON_PLAN_M).any(axis=1)
    corners = np.column_stack([np.arctan2(y, x), distances, np.roll(is_rim, -1)])[is_rim]
    kept: list[np.ndarray] = []
    for corner in corners[np.argsort(corners[:, 0])]:
        if kept and corner[0] - kept[-1][0] < least:
            kept[-1][2] = min(kept[-1][2], corner[2])
        else:
            kept.append(corner)
    return np.array(kept)


def fill_rim(corners: np.ndarray, step: float) -> np.ndarray:
    """Return corners (m, 2) of a whole rim around its axis, from some (n, 3) on the outline.

    Between those that no side joins, others follow in the angle that is usual there, or in `step`.
    """
    after = np.vstack([corners[1:], corners[:1] + (2.0 * math.pi, 0.0, 0.0)])
    turns, is_side = after[:, 0] - corners[:, 0], corners[:, 2] > 0.0
    is_side &= turns < WIDEST_RAD
    usual = np.median(turns[is_side]) if is_side.any() else step
    counts = np.where(is_side, 1, np.maximum(np.round(turns / usual), 1)).astype(int)
    rim = [
        before + k / count * (later - before)
        for before, later, count in zip(corners, after, counts.tolist(), strict=True)
        for k in range(count)
    ]
    angle, distance, _ = np.array(rim).T
    return distance[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def draw_between(
    part: Part, shape: Primitive, theta: np.ndarray, corners: np.ndarray
) -> tuple[Piece, ...]:
    """Return the pieces of a round part with facets between corners (n, 3) of its rim.

    Each ring of facets falls from the axis to these as in the regular `shape`.
    """
    sides = count_sides(part, shape)
    own = sides // 2 if part.type == "half_cone" else sides  # facets of a ring
    rim = fill_rim(corners, 2.0 * math.pi / sides)
    way = np.roll(rim, -1, axis=0) - rim
    normals = np.column_stack([way[:, 1], -way[:, 0]]) / np.linalg.norm(way, axis=1)[:, None]
    firsts, axis = shape.planes_at(theta)[::own], find_axis(part, theta)
    tops = firsts[:, :2] @ axis + firsts[:, 2]
    falls = np.hypot(*firsts[:, :2].T) * find_apothem(sides) * theta[HALF_WIDTH]
    slopes = -falls[:, None, None] * (normals / (normals * rim).sum(axis=1)[:, None])
    planes = np.concatenate([slopes, (tops[:, None] - slopes @ axis)[:, :, None]], axis=2)
    rings = [count // own for count in shape.minima] or [len(planes)]
    groups = [ring.reshape(-1, 3) for ring in np.split(planes, np.cumsum(rings)[:-1])]
    return tuple(Piece(outline, group) for outline in part.outlines for group in groups)
