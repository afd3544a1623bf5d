"""Find cones, spires, domes and onions around the tops of parts.

A top is round where heights fall alike in all directions, and points lie nearer to a curve of the
distance from it, or to eight facets, than to the roof.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from ...compiled import compiled
from ...geometry.rings import OVERLAY_GRID_M
from ...model import Part
from ...primitives.cants import list_cants
from ...primitives.catalogue import CATALOGUE
from ...primitives.contract import Q0, Primitive
from ...settings import Settings
from ..direction import outline_rectangle
from ..regular import REGULAR, find_covariance, fit_regular, is_regular, list_heights
from .custom import cut_part, fit_types
from .judged import COMPARED_M, JudgedRoof, scale_cap
from .regions import list_polygons
from .spires import measure_spires

RADII = (0.6, 0.85, 1.15, 1.5)  # Of discs around a part's top, in radii of a circle of its area.
BEYOND = 1.15  # Points so much further off than the disc's radius show where the shape ends.
FEWEST_AROUND = 12  # Points around a top from which heights by direction are known.
TURN_SECTORS = 8  # Directions around a top in which heights are compared.
FEWEST_SECTORS = 7  # Of these must hold points: a whole turn, but for a gap.
# Largest deviation of heights by sector, as a share of their fall from the middle; and from the
# highest point, which lies beside it.
ALL_ROUND, LOOSELY = 0.25, 0.5
LEAST_FALL_M = 0.3  # Least fall (m) from the top: less is a level roof.
CENTRE_ROUNDS = 3  # Rounds in which the middle of a disc is found.
AS_NEAR = 1.2  # Share of the misfit that a curve may leave if it replaces several parts.
BENT = 0.85  # Share of the misfit that a curve leaves of the roof's, at most.
GROWTH_ROUNDS = 2  # Rounds in which a spire is fitted to all points that follow it.
FOLLOW_M = 0.12  # Distance (m), at right angles, within which a point follows a slope.
BENT_TYPES = ("dome", "onion")  # Their slope changes with the distance from the top.
TOP_FOLLOW_M = 0.5  # Points so near (m in height) to a steep top lie on it.
TOP_SEEN = 0.3  # Share of the height of an onion's top that points must reach.
LIKE_OUTLINE = 0.85  # Share of an outline and of a disc in common from which they are the same.


def list_round_shapes(
    roof: JudgedRoof, part: Part, own: np.ndarray, names: tuple[str, ...], settings: Settings
) -> Iterator[Part]:
    """Yield round shapes fitted to discs of points around the top of a part.

    `own` (n,) are the points at which the part is visible.
    """
    points, visible, wide = roof.points, roof.points[own], math.sqrt(part.area / math.pi)
    starts = visible[np.argmax(visible[:, 2]), :2], visible[:, :2].mean(axis=0)
    round_starts = (s for s in starts if measure_fall(points, s, wide, LOOSELY) > 0.0)
    start = next(round_starts, None) if names else None
    if start is None:
        return
    xy = points[:, :2]
    for radius in (share * wide for share in RADII):
        centre = find_centre(points, start, radius)
        fall = measure_fall(points, centre, radius, ALL_ROUND)
        if fall == 0.0:
            continue
        cap = scale_cap(fall / radius)
        disc = np.hypot(*(xy - centre).T) <= radius
        centre, left = fit_radially(roof.points[disc], centre, cap)
        share = BENT if len(np.unique(roof.highest[1][disc])) == 1 else AS_NEAR
        most_left = share * roof.measure_distances(cap)[disc].mean()
        if (
            left > most_left
            and not list_cants(part.parameters)
            and measure_spires(roof.points[disc], centre, cap) > most_left
        ):
            continue
        points_around = roof.points[np.hypot(*(xy - centre).T) <= BEYOND * radius]
        shape = fit_round(roof, points_around, names, settings)
        if shape is not None:
            yield shape


@compiled
def find_centre(points: np.ndarray, start: np.ndarray, radius: float) -> np.ndarray:
    """Return the middle (2,) of what rises above the rest of a disc of points (n, 3)."""
    centre = start.copy()
    for _ in range(CENTRE_ROUNDS):
        u, v = centre[0], centre[1]
        n_near = total = weight = centre_u = centre_v = 0.0
        for i in range(len(points)):
            if math.hypot(points[i, 0] - u, points[i, 1] - v) <= radius:
                n_near, total = n_near + 1.0, total + points[i, 2]
        if n_near == 0.0:
            break
        for i in range(len(points)):
            if math.hypot(points[i, 0] - u, points[i, 1] - v) <= radius:
                above = max(points[i, 2] - total / n_near, COMPARED_M)
                weight += above
                centre_u += above * points[i, 0]
                centre_v += above * points[i, 1]
        centre[0], centre[1] = centre_u / weight, centre_v / weight
    return centre


@compiled
def measure_fall(points: np.ndarray, centre: np.ndarray, radius: float, alike: float) -> float:
    """Return how far (m) heights fall from a disc's middle to its outer half.

    It is 0 where the points (n, 3) hardly fall, or not `alike` in all directions.
    """
    n_inner, inner = 0, 0.0
    counts, sums = np.zeros(TURN_SECTORS), np.zeros(TURN_SECTORS)
    for x, y, z in points:
        x, y = x - centre[0], y - centre[1]
        distance = math.hypot(x, y)
        if distance <= 0.25 * radius:
            n_inner, inner = n_inner + 1, inner + z
        elif 0.5 * radius < distance <= radius:
            turn = math.atan2(y, x) / (2.0 * math.pi) % 1.0
            sector = min(int(turn * TURN_SECTORS), TURN_SECTORS - 1)
            counts[sector], sums[sector] = counts[sector] + 1.0, sums[sector] + z
    n_outer = n_sectors = total = squares = 0.0
    for sector in range(TURN_SECTORS):
        if counts[sector] > 0.0:
            mean = sums[sector] / counts[sector]
            n_outer, n_sectors = n_outer + counts[sector], n_sectors + 1.0
            total, squares = total + mean, squares + mean * mean
    if n_outer < FEWEST_AROUND or n_inner == 0 or n_sectors < FEWEST_SECTORS:
        return 0.0
    fall = inner / n_inner - total / n_sectors
    spread = math.sqrt(max(squares / n_sectors - (total / n_sectors) ** 2, 0.0))
    return fall if fall >= LEAST_FALL_M and spread <= alike * fall else 0.0


def fit_radially(points: np.ndarray, centre: np.ndarray, cap_m: float) -> tuple[np.ndarray, float]:
    """Fit heights a + b r + c r^2 around a centre (2,) to points (n, 3).

    Returns the centre that fits best, and the mean distance (m) left, each at most `cap_m`.
    """
    xy, z = points[:, :2], points[:, 2]
    used, slopes = np.ones(len(z), bool), np.zeros(len(z))
    for _ in range(CENTRE_ROUNDS + 1):
        way = xy - centre
        r = np.maximum(np.hypot(*way.T), COMPARED_M)
        design = np.column_stack([np.ones_like(r), r, r * r, -(way.T * (slopes / r)).T])
        columns = 5 if slopes.any() else 3
        solution = np.linalg.lstsq(design[used, :columns], z[used], rcond=None)[0]
        distances = np.abs(z - design[:, :3] @ solution[:3])
        used = distances <= 2.0 * max(cap_m, float(np.median(distances)))
        slopes = solution[1] + 2.0 * solution[2] * r
        if columns == 5:
            centre = centre + np.clip(solution[3:], -cap_m, cap_m)
    return centre, float(np.minimum(distances, cap_m).mean())


def select_followers(roof: JudgedRoof, part: Part) -> np.ndarray | None:
    """Select the points (k, 3) out to where they leave the slopes of a spire.

    What is round in height, too, is not continued: it returns None.
    """
    if part.type in BENT_TYPES:
        return None
    shape = CATALOGUE[part.type]
    theta = shape.to_theta(part.parameters, part.kappa, part.translation)
    slope = 2.0 * part.parameters["height"] / part.parameters["width"]
    xy, z = roof.points[:, :2], roof.points[:, 2]
    follows = np.abs(z - shape.height_at(theta, xy)) <= FOLLOW_M * math.hypot(1.0, slope)
    order = np.argsort(np.hypot(*(xy - part.translation[:2]).T), kind="stable")
    last = int(np.argmax(np.cumsum(np.where(follows[order], 1, -1))))
    return roof.points[np.sort(order[: last + 1])]


def fit_round(
    roof: JudgedRoof, near: np.ndarray, names: tuple[str, ...], settings: Settings
) -> Part | None:
    """Fit a round shape to the points `near` (n, 3) a top, None if none fits.

    Where it covers the outline, and hardly more, the outline is its plan.
    """
    part = fit_free(near, names, settings)
    if part is not None and not is_top_seen(part, near):
        others = tuple(name for name in names if name != "onion")
        part = fit_free(near, others, settings) if others else None
    for _ in range(GROWTH_ROUNDS):
        wider = None if part is None else select_followers(roof, part)
        if part is None or wider is None or len(wider) <= len(near):
            break
        near, part = wider, fit_free(wider, (part.type,), settings)
    if part is None:
        return None
    ring, outline = part.pieces[0].outline, roof.outline
    common = shapely.intersection(ring, outline, grid_size=OVERLAY_GRID_M)
    if common.area >= LIKE_OUTLINE * max(ring.area, outline.area):
        return fit_over(outline, part, roof.points)
    polygons = list_polygons(common)
    return cut_part(part, max(polygons, key=lambda p: p.area)) if polygons else None


def is_top_seen(part: Part, points: np.ndarray) -> bool:
    """Return whether points (n, 3) reach far enough up the top of an onion.

    It may be as high as anything above them. Other shapes have no top of their own.
    """
    if part.type != "onion":
        return True
    height, neck = part.parameters["height"], part.parameters["neck_height"]
    follows = np.abs(points[:, 2] - part.height_at(points[:, :2])) <= TOP_FOLLOW_M
    reached = points[follows, 2].max(initial=-np.inf) - part.translation[2]
    return bool(reached >= neck + TOP_SEEN * (height - neck))


def fit_free(points: np.ndarray, names: tuple[str, ...], settings: Settings) -> Part | None:
    """Fit a part of one of the types `names` to points (n, 3), None if none fits.

    Spires and onions are as long as wide.
    """
    part = fit_types(points, None, names, settings)
    if part is None or part.type not in REGULAR or is_regular(part.parameters):
        return part
    shape = CATALOGUE[part.type]
    theta = shape.to_theta(part.parameters, part.kappa, part.translation)
    theta = fit_regular(points, shape, theta)
    width_variance = (0.5 * part.sigma.get("width", 0.0)) ** 2
    return make_part(points, shape, theta, REGULAR[part.type], width_variance)


def fit_over(outline: shapely.Polygon, part: Part, points: np.ndarray) -> Part:
    """Fit the heights of a round part again, over all of an outline."""
    from ..likelihood import fit_heights  # compiled code that most roofs never need

    shape = CATALOGUE[part.type]
    theta = shape.to_theta(part.parameters, part.kappa, part.translation)
    theta[:Q0] = outline_rectangle(outline, part.kappa)
    theta, _ = fit_heights(np.column_stack([points, np.ones(len(points))]), shape, theta)
    free = REGULAR.get(part.type, list_heights(shape))
    if part.type in REGULAR:
        theta = fit_regular(points, shape, theta)
    width_variance = (0.5 * part.sigma.get("width", 0.0)) ** 2
    return cut_part(make_part(points, shape, theta, free, width_variance), outline)


def make_part(
    points: np.ndarray,
    shape: Primitive,
    theta: np.ndarray,
    free: tuple[int, ...],
    width_variance: float = 0.0,
) -> Part:
    """Make a part of theta (9,), whose numbers `free` were fitted to points (n, 3).

    Its standard deviations follow from these, and from the variance (m2) of half its width.
    """
    from ..single import find_deviations  # compiled code that most roofs never need

    variant = shape.variant(shape.from_theta(theta)[0])
    covariance = find_covariance(points, variant, theta, free, width_variance)
    return variant.part(theta, find_deviations(variant, theta, covariance))
