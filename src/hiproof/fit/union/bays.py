"""Bays: small pieces, all but rectangles, that the lines of an outline's own walls cut off. A person expects a roof of its own there.

A bay has few points, many of them next to its walls, where points do not count otherwise, and on a large roof so few are worth
no volume. But its corners are drawn in any case. So each is asked by itself, by all its points, what a level volume would gain.
"""

from __future__ import annotations

from statistics import median
from typing import NamedTuple

import numpy as np
import shapely

from ...geometry.rings import counterclockwise
from .add import UNEXPLAINED
from .objective import base_shows, misfits
from .plan import Plan
from .prices import BAY_UNITS
from .regions import THICK_M
from .scene import Scene
from .volumes import (
    COLUMNS,
    DIRECTION,
    LEVEL,
    OFFSET,
    PLANES,
    REPLACES,
    U0,
    U1,
    V0,
    V1,
    is_allowed,
    roof_heights,
)

# m2 of a bay, and its share of the outline at most: what is larger has points enough for the search; m of its narrower side
LEAST_M2, MOST_M2, MOST_SHARE, LEAST_WIDTH_M = 0.25, 12.0, 0.34, 0.3
# of a bay's area: so much of the outline lies at most within the rectangle around it; of that: so much is the bay at least, which a bay window
# fills to 0.7 and a wedge beside a wall that bends to a half; how many times as long as wide it is at most
FILLED, FULL, SLENDER = 1.25, 0.6, 10.0
SAME_M = 0.1  # rectangles whose sides all lie nearer are one bay's
FEWEST = 2  # points that the roof leaves unexplained and the level volume explains
LEAST_TURN = 1e-9  # of two walls, by their directions: numerically parallel
NEAREST = 1e-3  # of a wall's length from its end: the line begins there
SAME_PLACE_M = 1e-6  # numerically one place


class Seen(NamedTuple):
    """All points of a building: U, V (directions, n) and z (n,), ascending, those next to the border among them."""

    U: np.ndarray
    V: np.ndarray
    z: np.ndarray


def with_bays(volumes: np.ndarray, outline: shapely.Polygon, plan: Plan, scene: Scene, unit: float) -> np.ndarray:
    """The volumes with a level one in each bay of `outline` where that explains more than a `unit` (points) costs."""
    left = rectangles_of(outline, plan, scene)
    if not left:
        return volumes
    seen = all_points(plan, scene)
    while left:
        gains, levels = zip(*(level_over(bay, volumes, seen, scene, unit) for bay in left), strict=True)
        best = int(np.argmax(gains))
        if gains[best] <= 0.0:
            break
        volumes = np.vstack([volumes, levels[best]])
        del left[best]
    return volumes


def all_points(plan: Plan, scene: Scene) -> Seen:
    (u, v, z), c, s = plan.border, scene.turn[:, :1], scene.turn[:, 1:]
    every = np.concatenate([scene.z[: scene.n], z])
    order = np.argsort(every, kind="stable")
    U = np.concatenate([scene.U[:, : scene.n], c * u + s * v], axis=1)
    V = np.concatenate([scene.V[:, : scene.n], c * v - s * u], axis=1)
    return Seen(U[:, order], V[:, order], every[order])


def level_over(bay: np.ndarray, volumes: np.ndarray, seen: Seen, scene: Scene, unit: float) -> tuple[float, np.ndarray]:
    """What a level volume over a bay's rectangle gains at the height that most of its points have (points), and that volume."""
    row, direction = np.zeros(COLUMNS), int(bay[0])
    u, v = seen.U[direction], seen.V[direction]
    within = (u >= bay[1]) & (u <= bay[2]) & (v >= bay[3]) & (v <= bay[4])
    z = seen.z[within]
    if len(z) < FEWEST:
        return -np.inf, row
    where = [np.ascontiguousarray(axis[:, within]) for axis in (seen.U, seen.V)]
    roof, top = roof_heights(volumes, *where)
    now = misfits(z, roof, scene)
    narrow = min(bay[2] - bay[1], bay[4] - bay[3])
    if narrow < 2.0 * THICK_M or not base_shows(volumes, scene):
        # what little there is of the base is drawn as the roof beside
        beside, _ = roof_heights(continued(volumes, narrow), *where)
        now = np.where(top > 0, now, misfits(z, beside, scene))
    reach = scene.dead + scene.width
    first, last = np.searchsorted(z, z - reach, "right"), np.searchsorted(z, z + reach, "left")
    near = slice(*max(zip(first, last, strict=True), key=lambda ends: ends[1] - ends[0]))
    height = median(z[near].tolist())
    row[OFFSET : OFFSET + PLANES] = np.inf
    row[OFFSET + LEVEL], row[DIRECTION], row[REPLACES] = height, direction, height < median(roof.tolist())
    row[U0 : V1 + 1] = bay[1:]
    if (now[near] > UNEXPLAINED).sum() < FEWEST or not is_allowed(row, scene.allowed):
        return -np.inf, row
    return float(now.sum() - misfits(z, height, scene).sum()) - BAY_UNITS * unit, row


def continued(volumes: np.ndarray, by_m: float) -> np.ndarray:
    """The volumes, without the base, so far beyond their edges."""
    wider = volumes[1:].copy()
    wider[:, [U0, V0]] -= by_m
    wider[:, [U1, V1]] += by_m
    return wider


def rectangles_of(outline: shapely.Polygon, plan: Plan, scene: Scene) -> list[np.ndarray]:
    """The bays' rectangles, each once: direction and u0, u1, v0, v1 in its axes."""
    found: list[np.ndarray] = []
    for piece in pieces_of(outline):
        bay = rectangle_around(piece, outline, plan, scene)
        if bay is not None and not any(np.abs(bay - other).max() < SAME_M for other in found):
            found.append(bay)
    return found


def rectangle_around(ring: np.ndarray, outline: shapely.Polygon, plan: Plan, scene: Scene) -> np.ndarray | None:
    """Around a piece's ring (m, 2) in the direction in which it holds least of the outline besides; None where that is too much."""
    own, area = (ring - plan.frame.origin[:2]) @ plan.frame.rotation.T, 0.5 * float(cross(ring, following(ring)).sum())
    best, least = None, FILLED * area
    for direction, (c, s) in enumerate(scene.turn):
        turned = own @ np.array([[c, -s], [s, c]])
        low, high = turned.min(axis=0), turned.max(axis=0)
        narrow, wide = sorted((high - low).tolist())
        if area <= FULL * narrow * wide or narrow < max(LEAST_WIDTH_M, wide / SLENDER):
            continue
        corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])]) @ np.array([[c, s], [-s, c]])
        held = shapely.intersection(shapely.Polygon(plan.frame.xy_local(corners)), outline).area
        if held < least:
            best, least = np.array([direction, low[0], high[0], low[1], high[1]]), held
    return best


def pieces_of(outline: shapely.Polygon) -> list[np.ndarray]:
    """Rings (m, 2), counterclockwise, of what is small of the pieces that walls cut off, drawn on from corners that point inwards."""
    ring = counterclockwise(outline.exterior)[:-1]
    after = following(ring) - ring
    before = np.concatenate([after[-1:], after[:-1]])
    inwards = np.nonzero(cross(before, after) < 0.0)[0]
    if not len(inwards):
        return []
    corners, ways = np.tile(inwards, 2), np.concatenate([before[inwards], -after[inwards]])
    edges, places = first_crossings(ring, corners, ways)
    firsts, lasts, places = np.r_[corners, edges + 1], np.r_[edges, corners], np.tile(places, (2, 1))
    areas, most = areas_of(ring, firsts, lasts, places), min(MOST_M2, MOST_SHARE * outline.area)
    small = np.nonzero((areas >= LEAST_M2) & (areas <= most))[0]
    return [
        closed_at(ring[np.arange(firsts[k], firsts[k] + (lasts[k] - firsts[k]) % len(ring) + 1) % len(ring)], places[k])
        for k in small
    ]


def closed_at(corners: np.ndarray, place: np.ndarray) -> np.ndarray:
    """The `corners` (m, 2) and a `place` after them, where that is none of the two beside it: a line may end at a corner."""
    beside = np.abs(corners[[0, -1]] - place).max(axis=1).min()
    return np.vstack([corners, place]) if beside > SAME_PLACE_M else corners


def areas_of(ring: np.ndarray, firsts: np.ndarray, lasts: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Areas (k,) of what a ring's (n, 2) corners from `firsts` on to `lasts` (k,) enclose with `places` (k, 2)."""
    twice = np.vstack([ring, ring])
    sums = np.r_[0.0, np.cumsum(cross(twice[:-1], twice[1:]))]
    firsts = firsts % len(ring)
    lasts = firsts + (lasts - firsts) % len(ring)
    return 0.5 * (sums[lasts] - sums[firsts] + cross(twice[lasts], places) + cross(places, twice[firsts]))


def following(ring: np.ndarray) -> np.ndarray:
    """The corner after each of a ring's (n, 2)."""
    return np.concatenate([ring[1:], ring[:1]])


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def first_crossings(ring: np.ndarray, corners: np.ndarray, ways: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The edges (k,) of a ring (n, 2), by their numbers, at which lines from its `corners` (k,) along `ways` (k, 2) leave it first, and
    the places (k, 2); without any it is the corner itself."""
    edges, off = following(ring) - ring, ring - ring[corners, None]
    turn = cross(ways[:, None], edges)
    with np.errstate(divide="ignore", invalid="ignore"):
        along, across = cross(off, edges) / turn, cross(off, ways[:, None]) / turn
    meets = (np.abs(turn) > LEAST_TURN) & (along > NEAREST) & (across >= 0.0) & (across <= 1.0)
    every = np.arange(len(corners))
    meets[every, corners] = meets[every, corners - 1] = False
    along = np.where(meets, along, np.inf)
    first = np.argmin(along, axis=1)
    far = along[every, first]
    return first, ring[corners] + np.where(np.isfinite(far), far, 0.0)[:, None] * ways
