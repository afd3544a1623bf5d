"""Add level volumes over bays: near-rectangles that walls cut off an outline.

A person expects a roof of its own there. A bay has few points, and many of them lie next to its
walls, where points do not count otherwise. On a large roof so few points are worth no volume, but
the corners of the bay are drawn in any case. Each bay is therefore tested by itself, with all its
points.
"""

from __future__ import annotations

from statistics import median
from typing import NamedTuple

import numpy as np
import shapely

from ...geometry.rings import counterclockwise
from .add import UNEXPLAINED
from .objective import compute_misfits, is_base_visible
from .plan import Plan
from .prices import BAY_UNITS
from .regions import THICK_M
from .scene import Scene
from .volumes import (
    COLUMNS,
    DIRECTION,
    LEVEL,
    N_PLANES,
    OFFSET0,
    REPLACES,
    U0,
    U1,
    UNSORTED,
    V0,
    V1,
    compute_roof_heights,
    is_allowed,
)

LEAST_BAY_M2 = 0.25  # Smallest area (m2) of a bay.
MOST_BAY_M2 = 12.0  # Largest area (m2) of a bay: the search has enough points for a larger one.
MOST_BAY_SHARE = 0.34  # Largest share of the outline that a bay has.
LEAST_BAY_WIDTH_M = 0.3  # Smallest width (m) of a bay.
FILLED = 1.25  # The rectangle around a bay covers at most this much of the outline, in bays' areas.
# Share of its rectangle that a bay covers at least. A bay window covers 0.7, and a wedge beside a
# wall that bends covers a half.
FULL = 0.6
SLENDER = 10.0  # Largest ratio of a bay's length and width.
SAME_BAY_M = 0.1  # Rectangles whose sides all lie nearer (m) belong to one bay.
# Fewest points that the roof leaves unexplained and the level volume explains.
FEWEST_BAY_POINTS = 2
LEAST_TURN = 1e-9  # Sine of the angle between two walls below which they are numerically parallel.
NEAREST = 1e-3  # A line begins beyond this share of a wall's length from the wall's end.
EQUAL_CORNER_M = 1e-6  # Distance (m) within which two places are numerically one.


class BuildingPoints(NamedTuple):
    """All points of a building, those next to the border included.

    U, V (directions, n) and z (n,) ascend by z.
    """

    U: np.ndarray
    V: np.ndarray
    z: np.ndarray


def add_bays(
    volumes: np.ndarray, outline: shapely.Polygon, plan: Plan, scene: Scene, unit: float
) -> np.ndarray:
    """Add a level volume in each bay of `outline` where it is worth its price.

    `unit` are the points that one unit of structure must explain.
    """
    remaining = list_bay_rectangles(outline, plan, scene)
    if not remaining:
        return volumes
    points = gather_points(plan, scene)
    while remaining:
        gains, levels = zip(
            *(fit_level_volume(bay, volumes, points, scene, unit) for bay in remaining), strict=True
        )
        best = int(np.argmax(gains))
        if gains[best] <= 0.0:
            break
        volumes = np.vstack([volumes, levels[best]])
        del remaining[best]
    return volumes


def gather_points(plan: Plan, scene: Scene) -> BuildingPoints:
    (u, v, z), c, s = plan.border, scene.turn[:, :1], scene.turn[:, 1:]
    all_z = np.concatenate([scene.z[: scene.n], z])
    order = np.argsort(all_z, kind="stable")
    U = np.concatenate([scene.U[:, : scene.n], c * u + s * v], axis=1)
    V = np.concatenate([scene.V[:, : scene.n], c * v - s * u], axis=1)
    return BuildingPoints(U[:, order], V[:, order], all_z[order])


def fit_level_volume(
    bay: np.ndarray, volumes: np.ndarray, points: BuildingPoints, scene: Scene, unit: float
) -> tuple[float, np.ndarray]:
    """Fit a level volume over a bay, at the height that most of its points have.

    Returns what it gains (points), and the volume.
    """
    row, direction = np.zeros(COLUMNS), int(bay[0])
    u, v = points.U[direction], points.V[direction]
    is_inside = (u >= bay[1]) & (u <= bay[2]) & (v >= bay[3]) & (v <= bay[4])
    z = points.z[is_inside]
    if len(z) < FEWEST_BAY_POINTS:
        return -np.inf, row
    coordinates = [np.ascontiguousarray(axis[:, is_inside]) for axis in (points.U, points.V)]
    roof, top = compute_roof_heights(volumes, *coordinates, UNSORTED)
    current = compute_misfits(z, roof, scene)
    narrow = min(bay[2] - bay[1], bay[4] - bay[3])
    if narrow < 2.0 * THICK_M or not is_base_visible(volumes, scene):
        # The little that is visible of the base is drawn as the roof beside it.
        widened = widen_volumes(volumes, narrow)
        neighbour_z, _ = compute_roof_heights(widened, *coordinates, UNSORTED)
        current = np.where(top > 0, current, compute_misfits(z, neighbour_z, scene))
    reach = scene.dead + scene.width
    first, last = np.searchsorted(z, z - reach, "right"), np.searchsorted(z, z + reach, "left")
    band = slice(*max(zip(first, last, strict=True), key=lambda ends: ends[1] - ends[0]))
    height = median(z[band].tolist())
    row[OFFSET0 : OFFSET0 + N_PLANES] = np.inf
    row[OFFSET0 + LEVEL], row[DIRECTION], row[REPLACES] = (
        height,
        direction,
        height < median(roof.tolist()),
    )
    row[U0 : V1 + 1] = bay[1:]
    if (current[band] > UNEXPLAINED).sum() < FEWEST_BAY_POINTS or not is_allowed(
        row, scene.allowed
    ):
        return -np.inf, row
    return float(current.sum() - compute_misfits(z, height, scene).sum()) - BAY_UNITS * unit, row


def widen_volumes(volumes: np.ndarray, by_m: float) -> np.ndarray:
    """Move the edges of all volumes but the base out by `by_m`."""
    wider = volumes[1:].copy()
    wider[:, [U0, V0]] -= by_m
    wider[:, [U1, V1]] += by_m
    return wider


def list_bay_rectangles(outline: shapely.Polygon, plan: Plan, scene: Scene) -> list[np.ndarray]:
    """List the bays' rectangles, each once: direction and u0, u1, v0, v1 in its axes."""
    rectangles: list[np.ndarray] = []
    for piece in list_small_pieces(outline):
        bay = fit_bay_rectangle(piece, outline, plan, scene)
        if bay is not None and not any(
            np.abs(bay - other).max() < SAME_BAY_M for other in rectangles
        ):
            rectangles.append(bay)
    return rectangles


def fit_bay_rectangle(
    ring: np.ndarray, outline: shapely.Polygon, plan: Plan, scene: Scene
) -> np.ndarray | None:
    """Fit a rectangle around a piece's ring (m, 2).

    It has the direction in which it covers least of the outline besides. Returns None where that is
    too much.
    """
    local_ring, area = (
        (ring - plan.frame.origin[:2]) @ plan.frame.rotation.T,
        0.5 * float(cross_vectors(ring, shift_corners(ring)).sum()),
    )
    best, least_area = None, FILLED * area
    for direction, (c, s) in enumerate(scene.turn):
        turned = local_ring @ np.array([[c, -s], [s, c]])
        lower, upper = turned.min(axis=0), turned.max(axis=0)
        narrow, wide = sorted((upper - lower).tolist())
        if area <= FULL * narrow * wide or narrow < max(LEAST_BAY_WIDTH_M, wide / SLENDER):
            continue
        corners = np.array([lower, (upper[0], lower[1]), upper, (lower[0], upper[1])]) @ np.array(
            [[c, s], [-s, c]]
        )
        covered_area = shapely.intersection(
            shapely.Polygon(plan.frame.xy_local(corners)), outline
        ).area
        if covered_area < least_area:
            best, least_area = (
                np.array([direction, lower[0], upper[0], lower[1], upper[1]]),
                covered_area,
            )
    return best


def list_small_pieces(outline: shapely.Polygon) -> list[np.ndarray]:
    """List the small pieces that lines of walls cut off an outline.

    The lines carry walls on from corners that point inwards. The rings (m, 2) are counterclockwise.
    """
    ring = counterclockwise(outline.exterior)[:-1]
    next_edges = shift_corners(ring) - ring
    previous_edges = np.concatenate([next_edges[-1:], next_edges[:-1]])
    inwards = np.nonzero(cross_vectors(previous_edges, next_edges) < 0.0)[0]
    if not len(inwards):
        return []
    corners, ways = (
        np.tile(inwards, 2),
        np.concatenate([previous_edges[inwards], -next_edges[inwards]]),
    )
    edges, places = find_first_crossings(ring, corners, ways)
    firsts, lasts, places = (
        np.concatenate([corners, edges + 1]),
        np.concatenate([edges, corners]),
        np.tile(places, (2, 1)),
    )
    areas, most_area = (
        measure_areas(ring, firsts, lasts, places),
        min(MOST_BAY_M2, MOST_BAY_SHARE * outline.area),
    )
    small = np.nonzero((areas >= LEAST_BAY_M2) & (areas <= most_area))[0]
    return [
        close_ring(
            ring[
                np.arange(firsts[k], firsts[k] + (lasts[k] - firsts[k]) % len(ring) + 1) % len(ring)
            ],
            places[k],
        )
        for k in small
    ]


def close_ring(corners: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Append a `place` to `corners` (m, 2), unless it is the first or last of them.

    A line may end at a corner.
    """
    distance = np.abs(corners[[0, -1]] - place).max(axis=1).min()
    return np.vstack([corners, place]) if distance > EQUAL_CORNER_M else corners


def measure_areas(
    ring: np.ndarray, firsts: np.ndarray, lasts: np.ndarray, places: np.ndarray
) -> np.ndarray:
    """Return the areas (k,) of a ring's corners from `firsts` to `lasts` and `places`.

    The ring is (n, 2), `firsts` and `lasts` (k,) are numbers of corners, and `places` (k, 2) close
    each area.
    """
    twice = np.vstack([ring, ring])
    sums = np.append(0.0, np.cumsum(cross_vectors(twice[:-1], twice[1:])))
    firsts = firsts % len(ring)
    lasts = firsts + (lasts - firsts) % len(ring)
    return 0.5 * (
        sums[lasts]
        - sums[firsts]
        + cross_vectors(twice[lasts], places)
        + cross_vectors(places, twice[firsts])
    )


def shift_corners(ring: np.ndarray) -> np.ndarray:
    """Return the corner after each of a ring's (n, 2)."""
    return np.concatenate([ring[1:], ring[:1]])


def cross_vectors(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def find_first_crossings(
    ring: np.ndarray, corners: np.ndarray, ways: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find where lines from corners of a ring (n, 2) leave it first.

    The lines begin at `corners` (k,) and run along `ways` (k, 2). Returns the numbers of the edges
    (k,) that they cross and the places (k, 2). A line without a crossing ends at its corner.
    """
    edges, offsets = shift_corners(ring) - ring, ring - ring[corners, None]
    turn = cross_vectors(ways[:, None], edges)
    with np.errstate(divide="ignore", invalid="ignore"):
        along, across = (
            cross_vectors(offsets, edges) / turn,
            cross_vectors(offsets, ways[:, None]) / turn,
        )
    meets = (np.abs(turn) > LEAST_TURN) & (along > NEAREST) & (across >= 0.0) & (across <= 1.0)
    numbers = np.arange(len(corners))
    meets[numbers, corners] = meets[numbers, corners - 1] = False
    along = np.where(meets, along, np.inf)
    first = np.argmin(along, axis=1)
    distances = along[numbers, first]
    return first, ring[corners] + np.where(np.isfinite(distances), distances, 0.0)[:, None] * ways
