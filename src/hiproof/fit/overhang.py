"""How far a roof reaches beyond each edge of its outline, by the points beyond it.

Points before an edge that continue the roof's plane are as dense as those behind it, up to the
eave. So the place of the eave is where their number falls: its likelihood is that of points which
lie evenly over the roof, and blurred a little at its end. Edges of opposite sides are taken
together where they agree.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import shapely
from scipy.special import ndtr

from ..geometry.outline_edges import OutlineEdges, list_outline_edges
from ..model import Building, Eaves, Overhang, Roof
from ..model.overhang import ROOF_EDGE, WALLS
from ..settings import ReconstructSettings

OVERHANG_REACH_M = 1.5  # beyond an edge, within which points are looked at
BEHIND_EDGE_M = 1.0  # behind an edge, where the roof shows how dense points are
LONGEST_OVERHANG_M = 1.2  # an overhang; a roof that goes on farther is another one
SHORTEST_OVERHANG_M = 0.1  # an overhang; less is within the accuracy of footprints
ON_PLANE_M = 0.15  # from the roof's plane, within which a point continues it
PLAN_ERROR_M = 0.1  # of points; on a steep roof it moves them off the plane
EAVE_BLUR_M = (
    0.07  # standard deviation of the roof's end in the points: their own and the beam's width
)
STRAY_DENSITY = 0.02  # density of other points near the plane, by that of the roof's
ACROSS_STEP_M = 0.05  # between the places at which the free length of a strip is measured
ALONG_STEP_M = 0.25  # the same along an edge
TRIED_M = np.arange(-0.4, 1.4001, 0.02)  # m; those whose likelihood is compared
EDGE_ERROR_M = 0.025  # standard deviation of a straight edge of the footprint or the points
LEAST_EDGE_M = 1.0  # of an edge that is measured; shorter ones follow their side
FEWEST_POINTS = 4  # behind an edge, or on the ground before it
LOW_SHARE = 0.1  # of the points below the roof's plane; lower ones are ground, or noise
CLEAR_ROOM_M = 0.3  # between the roof's plane and the ground, below which either may be meant
OVERHANG_SIGMAS = 2.0  # that an overhang is long at least
LEAST_FILL = 0.6  # of a strip along the edge, and of its density by that behind the edge
POINTS_A_STRETCH = 3.0  # expected on each stretch of an edge that is to be filled
SAME_AXIS = math.sin(math.radians(5.0))  # sine of the angle up to which edges are parallel
AGREEING_SIGMAS = 2.5  # by which lengths that are taken together may differ from their mean
JUST_INSIDE_M = 0.02  # from an edge, where the plane is taken that goes on beyond
PARTY_M = 0.3  # between an edge and a neighbour's outline, below which they share a wall
MILLIMETRE_DIGITS = 3  # of lengths (m) as they are written
ROOF_ENDS_M, ROOF_ENDS_SHARE = (
    0.2,
    0.75,
)  # how near to how much of a roof's own outline its points end


class Strip(NamedTuple):
    """The points at one edge: positions along it and across it (n,), outwards.

    `free` (k,) is the length of the strip that lies clear at each of the places `across`.
    """

    along: np.ndarray
    across: np.ndarray
    free: np.ndarray


class RoofReach(NamedTuple):
    """How far a roof reaches beyond the edges (n,) of its outline.

    Each edge has its length (m), 0 where the points show none, with its standard deviation. Before
    some edges stand neighbours: they are not `free`. `is_roof_edge` says whether the points end at
    most of the outline.
    """

    lengths: np.ndarray
    sigmas: np.ndarray
    free: np.ndarray
    is_roof_edge: bool


class Measurement(NamedTuple):
    """The end of a roof before an edge (m), its standard deviation, and its `fill`.

    That is how full of points the strip up to the end is.
    """

    length: float
    sigma: float
    fill: float


ACROSS_M = np.arange(-BEHIND_EDGE_M + ACROSS_STEP_M / 2, OVERHANG_REACH_M, ACROSS_STEP_M)
UNMEASURED = Measurement(math.nan, math.inf, 0.0)


def measure_reach(roof: Roof, points: np.ndarray, neighbours: shapely.Geometry) -> RoofReach:
    """Measure how far a `roof` reaches beyond its outline.

    Its `points` (n, 3), inside and around, and the area of its `neighbours` are in its frame.
    """
    outline = roof.outline
    edges = list_outline_edges(outline)
    shapely.prepare(outline)
    near = find_near(points, outline, neighbours)
    gaps = np.array([measure_gap(edges, k, neighbours) for k in range(len(edges.starts))])
    measured = [
        measure_edge(roof, edges, k, near, neighbours)
        if gaps[k] > PARTY_M and edges.lengths[k] >= LEAST_EDGE_M
        else UNMEASURED
        for k in range(len(edges.starts))
    ]
    lengths, sigmas = pool_sides(edges, measured)
    lengths = np.where(gaps <= PARTY_M, 0.0, lengths)
    is_blocked = (gaps <= PARTY_M) | (gaps < lengths + ACROSS_STEP_M)
    return RoofReach(lengths, sigmas, ~is_blocked, ends_at_outline(edges, measured))


def find_eaves(
    building: Building,
    points: np.ndarray,
    neighbours: shapely.Geometry,
    settings: ReconstructSettings,
) -> tuple[Eaves, np.ndarray]:
    """Find the overhangs of a building's roof, which has no solid of LoD2.3 yet.

    The length (n,) of each edge that would have one but for its neighbours comes second.

    Without a footprint its outline is that of the roof, and overhangs are assumed, as they are
    where its footprint is one of a roof. Points (n, 3) and neighbours are as in `measure_reach`.
    """
    reach = measure_reach(building.roof, points, neighbours)
    kind, assumed_m = settings.footprint_kind, settings.assumed_overhang_m
    ends = kind == "auto" and assumed_m > 0.0 and reach.is_roof_edge
    if building.footprint is None or ends:
        kind = ROOF_EDGE
    if kind == ROOF_EDGE:
        lengths = np.full(len(reach.lengths), assumed_m)
        sigmas = np.full(len(lengths), math.nan)
    else:
        kind, lengths, sigmas = WALLS, reach.lengths, reach.sigmas
    overhangs = tuple(
        Overhang(
            edge,
            round(float(lengths[edge]), MILLIMETRE_DIGITS),
            round(float(sigmas[edge]), MILLIMETRE_DIGITS),
        )
        for edge in np.flatnonzero(lengths * reach.free).tolist()
    )
    along = list_outline_edges(building.roof.outline).lengths
    behind_neighbours = np.where(reach.free, 0.0, along * (lengths > 0.0))
    return Eaves(overhangs, settings.roof_thickness_m, kind), behind_neighbours


def find_near(
    points: np.ndarray, outline: shapely.Polygon, neighbours: shapely.Geometry
) -> np.ndarray:
    """Return the points (n, 3) in an outline and around it, outside its neighbours."""
    lower, upper = np.array(outline.bounds).reshape(2, 2) + [
        [-OVERHANG_REACH_M],
        [OVERHANG_REACH_M],
    ]
    near = points[((points[:, :2] >= lower) & (points[:, :2] <= upper)).all(axis=1)]
    if neighbours.is_empty:
        return near
    return near[~shapely.contains_xy(neighbours, near[:, 0], near[:, 1])]


def measure_gap(edges: OutlineEdges, number: int, neighbours: shapely.Geometry) -> float:
    """Return the distance of an edge to what stands before it.

    It is infinite where nothing does.
    """
    if neighbours.is_empty:
        return math.inf
    start, end, normal = (values[number] for values in edges[:3])
    inset = 0.05 * (end - start)
    start, end = start + inset, end - inset
    strip = shapely.polygons(
        [start, end, end + OVERHANG_REACH_M * normal, start + OVERHANG_REACH_M * normal]
    )
    before = shapely.get_coordinates(shapely.intersection(strip, neighbours))
    return float(((before - start) @ normal).min(initial=math.inf))


def measure_edge(
    roof: Roof, edges: OutlineEdges, number: int, points: np.ndarray, neighbours: shapely.Geometry
) -> Measurement:
    """Measure where the roof ends before an edge."""
    strip = cut_strip(roof, edges, number, points, neighbours)
    behind = strip.across < 0.0
    if behind.sum() < FEWEST_POINTS or not (strip.free[ACROSS_M < 0] > 0).any():
        return UNMEASURED
    density = behind.sum() / max(float(strip.free[ACROSS_M < 0].sum()) * ACROSS_STEP_M, 1e-6)
    shape = STRAY_DENSITY + (1.0 - STRAY_DENSITY) * ndtr(
        (TRIED_M[:, None] - strip.across) / EAVE_BLUR_M
    )
    whole = STRAY_DENSITY + (1.0 - STRAY_DENSITY) * ndtr(
        (TRIED_M[:, None] - ACROSS_M) / EAVE_BLUR_M
    )
    log_likelihood = np.log(shape).sum(axis=1) - len(strip.across) * np.log(whole @ strip.free)
    chance = np.exp(log_likelihood - log_likelihood.max())
    chance /= chance.sum()
    length = float(chance @ TRIED_M)
    spread = float(chance @ (TRIED_M - length) ** 2)
    further, variance = measure_gaps(strip.across[strip.across < length])
    length += further
    sigma = math.sqrt(spread + variance + EDGE_ERROR_M**2)
    return Measurement(length, sigma, measure_fill(strip, length, density, edges.lengths[number]))


def measure_gaps(across: np.ndarray) -> tuple[float, float]:
    """Return how much farther a roof ends than evenly spread points show.

    The variance of that comes second. Points at places `across` (n,) lie on scan lines, which may
    run along the edge. From the last of them, the roof goes on by a part of the gap to the next: of
    gaps g, E(g^2) / 2 E(g) on average, and E(g^3) / 3 E(g) in the square (renewal theory). What
    evenly spread points have is part of their likelihood.
    """
    gaps = np.diff(np.sort(across))
    if len(gaps) < FEWEST_POINTS:
        return 0.0, 0.0
    mean = float(gaps.mean())
    rest = float((gaps**2).mean()) / (2.0 * mean)
    variance = float((gaps**3).mean()) / (3.0 * mean) - rest**2
    return max(rest - mean, 0.0), max(variance - mean**2, 0.0)


def cut_strip(
    roof: Roof, edges: OutlineEdges, number: int, points: np.ndarray, neighbours: shapely.Geometry
) -> Strip:
    """Return the points that lie on the roof behind an edge, or continue it beyond."""
    start, end, normal = (values[number] for values in edges[:3])
    length = float(edges.lengths[number])
    direction = (end - start) / length
    offset = points[:, :2] - start
    along, across = offset @ direction, offset @ normal
    within = (
        (along >= 0) & (along <= length) & (across >= -BEHIND_EDGE_M) & (across <= OVERHANG_REACH_M)
    )
    points, along, across = points[within], along[within], across[within]
    is_inside = shapely.contains_xy(roof.outline, points[:, 0], points[:, 1])
    foot = start + along[:, None] * direction - JUST_INSIDE_M * normal
    planes = find_planes(roof, foot)
    z = np.where(
        is_inside,
        roof.height_at(points[:, :2]),
        (points[:, :2] * planes[:, :2]).sum(axis=1) + planes[:, 2],
    )
    slack = ON_PLANE_M + PLAN_ERROR_M * np.hypot(planes[:, 0], planes[:, 1])
    room_m = measure_room(points[:, 2], z - slack, np.where(is_inside, -np.inf, across))
    keep = (np.abs(points[:, 2] - z) <= slack) & (is_inside == (across < 0.0)) & (across < room_m)
    free = measure_free(roof.outline, start, end, normal, neighbours)
    return Strip(along[keep], across[keep], np.where(room_m > ACROSS_M, free, 0.0))


def measure_room(z: np.ndarray, lowest: np.ndarray, across: np.ndarray) -> float:
    """Return the distance from an edge at which the plane reaches the ground.

    Points before the edge have heights `z` (n,), continue the plane if not below `lowest` (n,),
    and lie so far `across`, those behind it nowhere.
    """
    below = np.isfinite(across) & (z < lowest)
    if below.sum() < FEWEST_POINTS:
        return math.inf
    ground = float(np.quantile(z[below], LOW_SHARE))
    return float(across[np.isfinite(across) & (lowest < ground + CLEAR_ROOM_M)].min(initial=np.inf))


def find_planes(roof: Roof, xy: np.ndarray) -> np.ndarray:
    """Return the plane (n, 3) of the roof at places (n, 2), NaN beside it."""
    highest, result = np.full(len(xy), -np.inf), np.full((len(xy), 3), np.nan)
    for piece in roof.pieces:
        z = xy @ piece.planes[:, :2].T + piece.planes[:, 2]
        lowest = z.min(axis=1)
        is_seen = shapely.intersects_xy(piece.outline, xy[:, 0], xy[:, 1]) & (lowest > highest)
        highest[is_seen] = lowest[is_seen]
        result[is_seen] = piece.planes[z.argmin(axis=1)[is_seen]]
    return result


def measure_free(
    outline: shapely.Polygon,
    start: np.ndarray,
    end: np.ndarray,
    normal: np.ndarray,
    neighbours: shapely.Geometry,
) -> np.ndarray:
    """Return the length (k,) of an edge that lies clear at each place across."""
    length = float(np.hypot(*(end - start)))
    count = max(math.ceil(length / ALONG_STEP_M), 1)
    share = (np.arange(count) + 0.5) / count
    xy = (start + share[:, None] * (end - start))[:, None] + ACROSS_M[:, None] * normal
    x, y = xy[..., 0], xy[..., 1]
    is_free = shapely.contains_xy(outline, x, y) == (ACROSS_M < 0.0)
    if not neighbours.is_empty:
        is_free &= ~shapely.contains_xy(neighbours, x, y)
    return is_free.sum(axis=0) * length / count


def measure_fill(strip: Strip, length: float, density: float, along_m: float) -> float:
    """Return how full of points a strip is up to its `length`.

    The share is the less of that along it and that by their density.
    """
    area = float(strip.free[(ACROSS_M > 0.0) & (length > ACROSS_M)].sum()) * ACROSS_STEP_M
    expected = density * area
    before = strip.along[(strip.across > 0.0) & (strip.across < length)]
    if expected <= 0.0:
        return 0.0
    stretches = max(int(expected / POINTS_A_STRETCH), 1)
    filled = np.unique(np.floor(before / along_m * stretches).clip(0, stretches - 1))
    return min(len(filled) / stretches, len(before) / expected)


def pool_sides(edges: OutlineEdges, measured: list[Measurement]) -> tuple[np.ndarray, np.ndarray]:
    """Return lengths and standard deviations (n,) of edges.

    Those of opposite sides are equal where they agree; else those of one side are, and else each
    has its own.
    """
    count = len(measured)
    lengths, sigmas = np.zeros(count), np.full(count, np.inf)
    for axis in group_by_axis(edges):
        side = edges.normals[axis] @ edges.normals[axis[0]] > 0.0
        for group in choose_groups([axis, axis[side], axis[~side]], measured):
            known = [measured[k] for k in group if np.isfinite(measured[k].sigma)]
            if not known:
                continue
            mean, sigma = average(known)
            sigmas[group] = sigma
            is_long = max(OVERHANG_SIGMAS * sigma, SHORTEST_OVERHANG_M) < mean <= LONGEST_OVERHANG_M
            if is_long and np.median([item.fill for item in known]) >= LEAST_FILL:
                lengths[group] = mean
    return lengths, sigmas


def group_by_axis(edges: OutlineEdges) -> list[np.ndarray]:
    """Return the numbers of edges that are parallel, the longest first."""
    rest = np.argsort(-edges.lengths, kind="stable")
    groups = []
    while len(rest):
        first = edges.normals[rest[0]]
        sine = np.abs(edges.normals[rest] @ [-first[1], first[0]])
        groups.append(rest[sine <= SAME_AXIS])
        rest = rest[sine > SAME_AXIS]
    return groups


def choose_groups(options: list[np.ndarray], measured: list[Measurement]) -> list[np.ndarray]:
    """Return the groups of edges whose lengths agree.

    They are both sides, or each side, or each edge of it.
    """
    both, *sides = options
    if agree([measured[k] for k in both]):
        return [both]
    groups: list[np.ndarray] = []
    for side in sides:
        whole = agree([measured[k] for k in side])
        groups += [side] if whole else [np.array([k]) for k in side]
    return groups


def agree(measured: list[Measurement]) -> bool:
    """Return whether all that is known may be one length."""
    known = [item for item in measured if math.isfinite(item.sigma)]
    if len(known) < 2:
        return True
    mean, _ = average(known)
    return all(abs(item.length - mean) <= AGREEING_SIGMAS * item.sigma for item in known)


def average(known: list[Measurement]) -> tuple[float, float]:
    """Return the weighted mean of lengths, and its standard deviation."""
    weights = np.array([item.sigma**-2.0 for item in known])
    mean = float(weights @ [item.length for item in known] / weights.sum())
    return mean, float(weights.sum() ** -0.5)


def ends_at_outline(edges: OutlineEdges, measured: list[Measurement]) -> bool:
    """Return whether the roof's points end at most of the outline that shows it."""
    known = np.array([math.isfinite(item.sigma) for item in measured])
    ends = np.array([abs(item.length) <= ROOF_ENDS_M for item in measured])
    whole = float(edges.lengths[known].sum())
    return whole > 0.0 and float(edges.lengths[known & ends].sum()) >= ROOF_ENDS_SHARE * whole
