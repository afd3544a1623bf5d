"""Which catalogue primitive a piece of roof is, with its named parameters; "free" where it is none.

Each rule proposes theta for its type from the piece's planes over the rectangle around its outline; the first proposal,
from the fewest parameters up, whose surface stays within `SAME_M` of the piece's names it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
import shapely

from ...model import Part, Piece
from ...primitives import get

SAME_M = 0.08
LEVEL_SLOPE = 0.03
PROBES = np.array([(u, v) for u in (-1.0, -0.5, 0.0, 0.5, 1.0) for v in (-1.0, -0.5, 0.0, 0.5, 1.0)])


def recognised(piece: Piece, covariance: np.ndarray | None = None) -> Part:
    """`piece` as a Part of the catalogue's type that it is, else "free".

    `covariance` (3 k, 3 k) of the piece's plane coefficients gives the standard deviations of the parameters.
    """
    for name, rule, start, theta in proposals(piece.planes, piece.outline):
        if is_same_surface(name, theta, piece):
            theta_p, kappa, translation = get(name).from_theta(theta)
            sigma = {} if covariance is None else standard_deviations(name, rule, start, piece, covariance)
            return Part(name, (piece,), theta_p, kappa, translation, sigma)
    return Part("free", (piece,), translation=np.array([*shapely.get_coordinates(piece.outline.centroid)[0], 0.0]))


def proposals(planes: np.ndarray, outline: shapely.Polygon) -> Iterator[tuple[str, Callable, float, np.ndarray]]:
    """(type, its rule, the direction it was tried in, canonical theta) of every rule that applies."""
    for name, rule in RULES.get(len(planes), ()):
        steep = planes[np.argmax(planes[:, 0] ** 2 + planes[:, 1] ** 2)]
        level = math.hypot(steep[0], steep[1]) < LEVEL_SLOPE
        across = longest_edge_normal(outline) if level else math.atan2(steep[1], steep[0])
        for turn in (0.0, 0.5 * math.pi):
            kappa = across - 0.5 * math.pi + turn
            plan, to_own = own_frame(outline, kappa)
            theta = theta_of(name, rule, planes @ to_own.T, plan, kappa)
            if theta is not None:
                yield name, rule, kappa, theta


def theta_of(name: str, rule: Callable, local: np.ndarray, plan: tuple[float, ...], kappa: float) -> np.ndarray | None:
    """Canonical theta (9,) by `rule` from planes over u, v and the plan (V, U, cx, cy); None where it does not apply."""
    q = rule(local, plan[1], plan[0])
    if q is None:
        return None
    return get(name).canonical_theta(np.array([*plan[2:], kappa, *plan[:2], *q, *[0.0] * (4 - len(q))]))


def longest_edge_normal(outline: shapely.Polygon) -> float:
    edges = np.diff(shapely.get_coordinates(outline.exterior), axis=0)
    longest = edges[np.argmax(np.hypot(edges[:, 0], edges[:, 1]))]
    return math.atan2(longest[1], longest[0]) + 0.5 * math.pi


def own_frame(outline: shapely.Polygon, kappa: float) -> tuple[tuple[float, ...], np.ndarray]:
    """(V, U, cx, cy) of the outline's rectangle in direction `kappa`, and the map (3, 3) of planes to u, v about it."""
    c, s = math.cos(kappa), math.sin(kappa)
    turn = np.array([[c, s], [-s, c]])
    uv = shapely.get_coordinates(outline) @ turn.T
    low, high = uv.min(axis=0), uv.max(axis=0)
    centre = 0.5 * (low + high) @ turn
    half = 0.5 * (high - low)
    to_own = np.array([[c, s, 0.0], [-s, c, 0.0], [centre[0], centre[1], 1.0]])
    return (half[1], half[0], centre[0], centre[1]), to_own


def is_same_surface(name: str, theta: np.ndarray, piece: Piece) -> bool:
    """Whether the primitive `theta` is proper and within SAME_M of the piece over the piece's rectangle."""
    primitive = get(name)
    if not primitive.is_proper(theta):
        return False
    kappa, half_width, half_length = theta[2:5]
    turn = np.array([[math.cos(kappa), math.sin(kappa)], [-math.sin(kappa), math.cos(kappa)]])
    xy = PROBES * [half_length, half_width] @ turn + theta[:2]
    return bool(np.abs(primitive.height_at(theta, xy) - piece.height_at(xy)).max() < SAME_M)


def standard_deviations(
    name: str, rule: Callable, kappa: float, piece: Piece, covariance: np.ndarray
) -> dict[str, float]:
    """Standard deviation of each parameter and of T_L's height by the delta method, direction and plan held."""
    plan, to_own = own_frame(piece.outline, kappa)
    local = piece.planes @ to_own.T

    def parameters(planes: np.ndarray) -> np.ndarray:
        theta = theta_of(name, rule, planes, plan, kappa)
        if theta is None:
            return centre
        theta_p, _, translation = get(name).from_theta(theta)
        return np.array([*theta_p.values(), translation[2]])

    centre = np.zeros(0)
    centre = parameters(local)
    jacobian = np.zeros((len(centre), local.size))
    for k in range(local.size):
        moved = local.copy()
        moved.flat[k] += 1e-5
        jacobian[:, k] = (parameters(moved) - centre) / 1e-5
    turned = np.kron(np.eye(len(local)), to_own)
    variance = ((jacobian @ (turned @ covariance @ turned.T)) * jacobian).sum(axis=1)
    names = [*get(name).parameters, "t_z"]
    return {n: math.sqrt(v) for n, v in zip(names, variance, strict=True) if v > 0.0}


# --- rules: planes (k, 3) over u, v about the rectangle's centre, half extents U and V -> q of the type, or None ------


def flat(planes, half_u, half_v):
    return [planes[0, 2]] if np.hypot(planes[0, 0], planes[0, 1]) < LEVEL_SLOPE else None


def monopitch(planes, half_u, half_v):
    return [planes[0, 2], planes[0, 1]] if planes[0, 1] > 0.0 else None


def crossing(pair: np.ndarray, axis: int) -> tuple[float, float, float, float] | None:
    """(rising slope, falling slope, position, height) of the ridge of two planes along the axis across it."""
    up, down = (pair[0], pair[1]) if pair[0, axis] > pair[1, axis] else (pair[1], pair[0])
    if not up[axis] > 0.0 > down[axis]:
        return None
    at = (down[2] - up[2]) / (up[axis] - down[axis])
    return up[axis], -down[axis], at, up[2] + up[axis] * at


def gable(planes, half_u, half_v):
    ridge = crossing(planes, 1)
    return None if ridge is None else [ridge[3], 0.5 * (ridge[0] + ridge[1])]


def asymmetric_gable(planes, half_u, half_v):
    ridge = crossing(planes, 1)
    if ridge is None or abs(ridge[2]) > 0.95 * half_v:
        return None
    return [ridge[3], ridge[0], ridge[1], ridge[2] / half_v]


def two_pairs(planes) -> tuple | None:
    """The ridges of the pair across (v) and of the pair along (u), None where the planes are no such pairs."""
    across = planes[np.abs(planes[:, 1]) > np.abs(planes[:, 0])]
    along = planes[np.abs(planes[:, 0]) > np.abs(planes[:, 1])]
    if len(across) != 2 or len(along) != 2:
        return None
    sides, ends = crossing(across, 1), crossing(along, 0)
    return None if sides is None or ends is None else (sides, ends)


def pyramid(planes, half_u, half_v):
    pairs = two_pairs(planes)
    return None if pairs is None else [0.5 * (pairs[0][3] + pairs[1][3]), 0.5 * (pairs[0][0] + pairs[0][1])]


def hip(planes, half_u, half_v):
    pairs = two_pairs(planes)
    if pairs is None or pairs[0][3] > pairs[1][3]:
        return None
    (q1, q1_, _, ridge), (q2, q2_, _, _) = pairs
    return [ridge, 0.5 * (q1 + q1_), 0.5 * (q2 + q2_)]


def half_hip(planes, half_u, half_v):
    q, pairs = hip(planes, half_u, half_v), two_pairs(planes)
    if q is None:
        return None
    drop = q[0] - (pairs[1][3] - q[2] * half_u)
    return [*q, drop / (q[1] * half_v)] if 0.1 < drop / (q[1] * half_v) < 0.9 else None


def gambrel(planes, half_u, half_v):
    order = planes[np.argsort(planes[:, 1])]
    upper, lower = crossing(order[1:3], 1), crossing(order[[0, 3]], 1)
    if upper is None or lower is None:
        return None
    q1, steeper = 0.5 * (upper[0] + upper[1]), 0.5 * (lower[0] + lower[1] - upper[0] - upper[1])
    return [upper[3], q1, steeper, (lower[3] - upper[3]) / (steeper * half_v)] if steeper > 0.02 else None


def mansard(planes, half_u, half_v):
    top = int(np.argmin(np.hypot(planes[:, 0], planes[:, 1])))
    if np.hypot(planes[top, 0], planes[top, 1]) > LEVEL_SLOPE:
        return None
    pairs = two_pairs(np.delete(planes, top, axis=0))
    if pairs is None:
        return None
    q1, q2 = 0.5 * (pairs[0][0] + pairs[0][1]), 0.5 * (pairs[1][0] + pairs[1][1])
    height = planes[top, 2]
    return [height, q1, q2, (height - (pairs[0][3] - q1 * half_v)) / (q1 * half_v)]


RULES: dict[int, tuple[tuple[str, Callable], ...]] = {
    1: (("flat", flat), ("monopitch", monopitch)),
    2: (("gable", gable), ("asymmetric_gable", asymmetric_gable)),
    4: (("pyramid", pyramid), ("hip", hip), ("half_hip", half_hip), ("gambrel", gambrel)),
    5: (("mansard", mansard),),
}
