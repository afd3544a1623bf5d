"""Fit round shapes over arcs of the outline and around the tops of parts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
import shapely

from ...compiled import compiled
from ...geometry.arrays import compute_median
from ...geometry.rings import intersect
from ...model import Part
from ...primitives.cants import list_cants
from ...primitives.catalogue import CATALOGUE
from ...primitives.cone import BROACH_SIDES, HEXAGON_SIDES
from ...primitives.contract import CX, CY, HALF_LENGTH, HALF_WIDTH, KAPPA, Q0, Q1, Primitive
from ...primitives.facets import find_apothem
from ...primitives.revolved import NECK
from .accept import CIRCLE_NUMBERS, PartsRoof
from .arcs import APSE_DEG, TURRET_DEG, Arc, cut_to_outline
from .regions import cut_part, list_polygons


class RoundShape(NamedTuple):
    """How a shape is fitted around a centre.

    `free` are the numbers of its plan that points determine. Over an arc, it has `sides`, or
    as many as the arc, which is `span_deg` long.
    """

    free: tuple[int, ...]
    sides: int | None = None
    span_deg: tuple[float, float] = (TURRET_DEG, 360.0)


ROUND_SHAPES = {
    "half_cone": RoundShape((), span_deg=APSE_DEG),
    "cone": RoundShape((CX, CY)),
    "broach": RoundShape((CX, CY, KAPPA), BROACH_SIDES),
    "hexagonal_spire": RoundShape((CX, CY, KAPPA), HEXAGON_SIDES),
    "dome": RoundShape((CX, CY, HALF_WIDTH)),
    "onion": RoundShape((CX, CY, HALF_WIDTH)),
}
RADII = (0.6, 0.9, 1.35, 2.0, 3.0)  # Of discs around a top, in radii of its part's area.
LEAST_FALL_M = 0.3  # Least fall (m) from the top: less is a level roof.
FEWEST_POINTS = 6  # A slope and a height, and as many points again to check them.
LEAST_INSIDE = 0.6  # Least share of a disc that lies inside the outline.
MOST_ASKED = 200  # Most points of a disc that say whether it is round: of more, every k-th does.
CENTRE_ROUNDS = 3  # Rounds in which the middle of a disc is found.
LEAST_RISE_M = 0.01  # A point of a disc rises at least so far (m) above its mean.
SPIRE_SIDES = (BROACH_SIDES, HEXAGON_SIDES)  # What the facets of spires repeat.
RIDGE = 1e-6  # It keeps what no point determines.
GROWTH = 3.0  # A shape reaches out to so many times the radius with which it begins at most.
GROWTH_ROUNDS = 2  # Rounds in which a shape is fitted to all points that follow it.
FOLLOW_M = 0.12  # Distance (m), at right angles, within which a point follows a slope.
MOST_OVER = 0.5  # The same above it, in FOLLOW_M: beside a spire on a tower all points lie there.
SLOPES_TRIED, BENDS_TRIED = 24, 7  # Slopes, in equal ratios, and bends of an onion that are tried.
TURNS_TRIED = 3  # Turns of a spire that are tried within one of its facets.
TOP_FOLLOW_M = 0.5  # Points so near (m in height) to a steep top lie on it.
BULGE_SEEN = 0.5  # Share of the points beyond the neck of an onion that lie on it.
TOP_SEEN = 0.3  # Share of the height of an onion's top that points must reach.


def list_arc_shapes(roof: PartsRoof, arc: Arc, names: list[str]) -> Iterator[tuple[Part, int]]:
    """Yield shapes over an arc, with how many numbers of their plans points give.

    The top of a cone or a dome may lie beside the middle of the arc.
    """
    for name in names:
        row = ROUND_SHAPES.get(name)
        if row is None or not row.span_deg[0] <= arc.span_deg <= row.span_deg[1]:
            continue
        if row.sides is not None and arc.sides != row.sides:
            continue
        radius = arc.radius * (find_apothem(arc.sides) if row.sides else 1.0)
        theta = np.array([*arc.centre, arc.facing, radius, radius, 0.0, 0.0, 0.0, 0.0])
        if name == "half_cone":
            theta[KAPPA], theta[HALF_LENGTH] = arc.kappa, 0.5 * radius
            theta[:KAPPA] += 0.5 * radius * arc.way
        hidden = 2 if arc.span_deg <= APSE_DEG[1] and name != "half_cone" else 0
        hidden += name == "cone" and arc.sides in SPIRE_SIDES  # a spire says as much
        for free in ((), (CX, CY)) if name in ("cone", "dome") else ((),):
            fitted = fit_followers(roof.points, CATALOGUE[name], theta, free)
            if fitted is not None:
                for part in cut_to_outline(fitted, arc, roof.outline):
                    yield part, len(free) + hidden


def list_top_shapes(
    roof: PartsRoof, part: Part, own: np.ndarray, names: list[str]
) -> Iterator[tuple[Part, int]]:
    """Yield round shapes around the top of a part, which is seen at the points `own` (k,)."""
    start, wide = roof.points[own, :2].mean(axis=0), math.sqrt(part.area / math.pi)
    disc, density = own[:0], len(roof.points) / roof.outline.area
    for radius in (share * wide for share in RADII):
        last = disc
        centre, disc = find_disc(roof.points, start, radius)
        is_inside = len(disc) >= LEAST_INSIDE * density * math.pi * radius**2
        if np.array_equal(disc, last) or not is_inside:
            continue
        if not roof.is_worth(disc, 0.0, CIRCLE_NUMBERS):
            continue
        some = disc[:: 1 + len(disc) // MOST_ASKED]
        misfit = roof.price_gaps(measure_round_gaps(roof.points[some], centre)).mean() * len(disc)
        # The facets of a spire are named so, and lie as near. A house may have one cant.
        misfit *= len(list_cants(part.parameters)) < 2
        if not roof.is_worth(disc, misfit, CIRCLE_NUMBERS):
            continue
        theta = np.array([*centre, part.kappa, radius, radius, 0.0, 0.0, 0.0, 0.0])
        around = roof.points[roof.find_near(centre, GROWTH * radius)]
        for name in names:
            shape, free = CATALOGUE[name], ROUND_SHAPES[name].free
            fitted = fit_followers(around, shape, theta, free, HALF_WIDTH not in free)
            if fitted is not None:
                ring = fitted.pieces[0].outline
                common = intersect(ring, roof.outline)
                polygons = list_polygons(common)
                if polygons:
                    yield cut_part(fitted, max(polygons, key=lambda p: p.area)), CIRCLE_NUMBERS
        # The others were fitted to all points that follow them.
        names = [name for name in names if HALF_WIDTH in ROUND_SHAPES[name].free]


@compiled
def find_disc(points, start, radius):
    """Return the middle (2,) of what rises above the rest of a disc of points (n, 3), and which.

    It begins with the disc around `start` (2,). Points ascend by x. They are given by number (k,).
    """
    x, y, disc, count = start[0], start[1], np.empty(len(points), np.int64), 0
    for turn in range(CENTRE_ROUNDS + 1):
        if turn > 0:
            level, total, u, v = points[disc[:count], 2].mean(), 0.0, 0.0, 0.0
            for i in disc[:count]:
                rise = max(points[i, 2] - level, LEAST_RISE_M)
                total, u, v = total + rise, u + rise * points[i, 0], v + rise * points[i, 1]
            x, y = u / total, v / total
        first = np.searchsorted(points[:, 0], x - radius)
        last, count = np.searchsorted(points[:, 0], x + radius), 0
        for i in range(first, last):  # a number that does not count is overwritten by the next
            disc[count] = i
            count += (points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2 <= radius**2
        if count == 0:
            break
    return np.array([x, y]), disc[:count]


@compiled
def measure_round_gaps(points, centre):
    """Return about how far points (n, 3) lie from the nearest round shape or spire.

    Without a fall from the middle there is none.
    """
    n, farthest, terms = len(points), 0.0, 5 + 2 * len(SPIRE_SIDES)
    design, is_near, gaps = np.ones((n, terms)), np.ones(n, np.bool_), np.empty(n)
    for i in range(n):
        x, y = points[i, 0] - centre[0], points[i, 1] - centre[1]
        r, turn = np.hypot(x, y), np.arctan2(y, x)
        design[i, 1], design[i, 2] = r, r * r
        design[i, 3], design[i, 4] = np.cos(turn), np.sin(turn)
        for k in range(len(SPIRE_SIDES)):
            angle = SPIRE_SIDES[k] * turn
            design[i, 5 + 2 * k], design[i, 6 + 2 * k] = r * np.cos(angle), r * np.sin(angle)
        farthest = max(farthest, r)
    for _ in range(GROWTH_ROUNDS):
        normal, vector = RIDGE * np.eye(terms), np.zeros(terms)
        for i in range(n):
            for a in range(terms if is_near[i] else 0):
                vector[a] += design[i, a] * points[i, 2]
                for b in range(terms):
                    normal[a, b] += design[i, a] * design[i, b]
        solution = np.linalg.solve(normal, vector)
        for i in range(n):
            gaps[i] = abs(points[i, 2] - (design[i] * solution).sum())
        reach = max(LEAST_FALL_M, 2.0 * compute_median(gaps))
        for i in range(n):
            is_near[i] = gaps[i] <= reach
    falls = -farthest * (solution[1] + solution[2] * farthest) >= LEAST_FALL_M
    return gaps if falls else np.full(n, np.inf)


def fit_followers(
    points: np.ndarray,
    shape: Primitive,
    theta: np.ndarray,
    free: tuple[int, ...],
    grows: bool = False,
) -> Part | None:
    """Fit a part to the points (n, 3) of the plan of theta (9,) that follow it, None for too few.

    Its heights and the numbers `free` are fitted. What `grows` reaches out to where points leave
    its slope: they show nothing else of the width of a cone.
    """
    from ..likelihood import fit_heights  # compiled code that most roofs never need

    numbers, variance = len(free) + shape.theta_size - Q0, 0.0
    inside = points[shapely.contains_xy(shape.part(theta).pieces[0].outline, *points[:, :2].T)]
    turns = np.arange(TURNS_TRIED if KAPPA in free else 1) * 2.0 * math.pi / len(shape.rim)
    asked = inside[:: 1 + len(inside) // MOST_ASKED]
    theta = find_start(asked, shape, theta, turns / TURNS_TRIED)
    for _ in range(GROWTH_ROUNDS):
        near = inside[np.abs(measure_gaps(inside, shape, theta)) <= 3.0]
        if len(near) < max(FEWEST_POINTS, 2 * numbers):
            return None
        theta, _ = fit_heights(weigh(near), shape, theta, free)
        if grows:
            slope, gaps = add_slopes(shape, theta), measure_gaps(points, shape, theta)
            # half the width of a plan whose rim passes through each point, along facets, too
            r = (theta[Q0] - shape.height_at(theta, points[:, :2])) / slope
            order = np.argsort(r, kind="stable")
            follows = (gaps >= -1.0) & (gaps <= MOST_OVER)
            last = int(np.argmax(np.cumsum(np.where(follows[order], 1, -1))))
            theta[[HALF_WIDTH, HALF_LENGTH]] = r[order[last]]
            inside = points[order[: last + 1]]
            variance = (MOST_OVER * FOLLOW_M) ** 2 * (1.0 + 1.0 / slope**2)
            variance += (r[order[last]] / (last + 1.0)) ** 2
    if shape.minima:  # Points on a steep needle lie far off in height.
        theta, _ = fit_heights(weigh(inside), shape, theta, free)
    part = make_part(inside, shape, theta, free, variance)
    return part if is_top_seen(part, inside) else None


def weigh(points: np.ndarray) -> np.ndarray:
    """Return points (n, 4), each of which counts once."""
    return np.column_stack([points, np.ones(len(points))])


def add_slopes(shape: Primitive, theta: np.ndarray) -> float:
    """Return the rise over run of a shape, its bends included."""
    return float(theta[Q1 : Q1 + len(shape.bounds)].sum())


def measure_gaps(points: np.ndarray, shape: Primitive, theta: np.ndarray) -> np.ndarray:
    """Return how far points (n, 3) lie above a shape, at right angles, in FOLLOW_M."""
    reach = FOLLOW_M * math.hypot(1.0, add_slopes(shape, theta))
    return (points[:, 2] - shape.height_at(theta, points[:, :2])) / reach


def find_start(
    points: np.ndarray, shape: Primitive, theta: np.ndarray, turns: np.ndarray
) -> np.ndarray:
    """Return theta (9,) with the height, slopes and turn that most points (n, 3) follow."""
    (lowest, highest), *bends = shape.bounds
    values = [np.geomspace(lowest, highest, SLOPES_TRIED // (1 + len(bends)))]
    values += [np.linspace(*bend, BENDS_TRIED) for bend in bends]
    trials = np.array([[*theta[:Q1], *some, *theta[Q1 + len(some) :]] for some in product(*values)])
    planes, best, most = shape.plane_values(trials), theta, 0
    for turn, m in product(turns, range(len(trials))):
        trial = trials[m].copy()
        trial[KAPPA] += turn
        lows = np.sort(points[:, 2] - shape.height_at(trial, points[:, :2], planes[m]))
        width = 2.0 * FOLLOW_M * math.hypot(1.0, add_slopes(shape, trial))
        counts = np.searchsorted(lows, lows + width, side="right") - np.arange(len(lows))
        first = int(np.argmax(counts)) if len(counts) else 0
        if len(counts) and counts[first] > most:
            most, best = int(counts[first]), trial
            best[Q0] = float(lows[first : first + most].mean())
    return best


def is_top_seen(part: Part, points: np.ndarray) -> bool:
    """Return whether points (n, 3) reach far enough up the top of an onion, and show its bulge.

    It may be as high as anything above them, and a slim spire's bulge may lie below other roofs.
    Other shapes have no top of their own.
    """
    if part.type != "onion":
        return True
    height, neck = part.parameters["height"], part.parameters["neck_height"]
    follows = np.abs(points[:, 2] - part.height_at(points[:, :2])) <= TOP_FOLLOW_M
    reached = points[follows, 2].max(initial=-np.inf) - part.translation[2]
    away = np.hypot(*(points[:, :2] - part.translation[:2]).T)
    bulge = follows[away > 0.5 * NECK * part.parameters["width"]]
    is_bulge_seen = bool(bulge.mean() >= BULGE_SEEN) if len(bulge) else False
    return is_bulge_seen and bool(reached >= neck + TOP_SEEN * (height - neck))


def make_part(
    points: np.ndarray,
    shape: Primitive,
    theta: np.ndarray,
    free: tuple[int, ...],
    width_variance: float,
) -> Part:
    """Make a part of theta (9,), whose numbers `free` were fitted to points (n, 3).

    Its standard deviations follow from these, and from the variance (m2) of half its width.
    """
    from ..likelihood import find_covariance  # compiled code that most roofs never need
    from ..single import find_deviations

    variant = shape.variant(shape.from_theta(theta)[0])
    covariance = find_covariance(weigh(points), shape, theta, free, width_variance)
    return variant.part(theta, find_deviations(variant, theta, covariance))
