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

OVERHANG_REACH_M = 1.5  # behind and beyond an edge, within which points are looked at
LONGEST_OVERHANG_M = 1.2  # beyond, a roof is another one; shorter edges are not measured
SHORTEST_OVERHANG_M = 0.1  # an overhang; less is within the accuracy of footprints
ON_PLANE_M = 0.15  # from the roof's plane at right angles, within which a point continues it
EAVE_BLUR_M = 0.07  # standard deviation of the roof's end in the points: theirs, the beam's width
STRAY_DENSITY = 0.02  # density of other points near the plane, by that of the roof's
EAVE_STEP_M = 0.05  # between the places that are compared across an edge
LEAST_SIGMA_M = EAVE_STEP_M / math.sqrt(12.0)  # of a place known to one step
FEWEST_POINTS = 4  # behind an edge, or on the ground before it
LEAST_FILL = 0.5  # of the points that an overhang should hold by the density behind the edge
OVERHANG_SIGMAS = 3.0  # that an overhang is long at least, and pooled lengths differ at most
SAME_AXIS = math.sin(math.radians(5.0))  # sine of the angle up to which edges are parallel
JUST_INSIDE_M = 0.02  # from an edge, where the plane is taken that goes on beyond
PARTY_M = 0.3  # between an edge and a neighbour's outline, below which they share a wall
MILLIMETRE_DIGITS = 3  # of lengths (m) as they are written
ROOF_ENDS_M = 0.2  # how near to a roof's own outline its points end
ROOF_ENDS_SHARE = 0.75  # of the outline at which they do

ACROSS_M = np.arange(-OVERHANG_REACH_M + EAVE_STEP_M / 2, OVERHANG_REACH_M, EAVE_STEP_M)


class RoofReach(NamedTuple):
    """How far a roof reaches beyond the edges (n,) of its outline.

    Each edge has its length (m), 0 where the points show none, with its standard deviation. Edges
    before which a neighbour stands, so near that none has room, are not `free`. `is_roof_edge` says
    whether the points end at most of the outline.
    """

    lengths: np.ndarray
    sigmas: np.ndarray
    free: np.ndarray
    is_roof_edge: bool


class Measurement(NamedTuple):
    """The end of a roof before an edge (m), and its standard deviation.

    `found` points lie between the edge and the end, of those `expected` by the density behind it.
    """

    length: float
    sigma: float
    found: int
    expected: float


class EdgeFrame(NamedTuple):
    """The frame of an edge of the outline.

    It has its `start`, unit vectors along the edge and outwards, and the edge's `length`.
    """

    start: np.ndarray
    along: np.ndarray
    outwards: np.ndarray
    length: float


UNMEASURED = Measurement(math.nan, math.inf, 0, 0.0)


def measure_reach(roof: Roof, points: np.ndarray, neighbours: shapely.Geometry) -> RoofReach:
    """Measure how far a `roof` reaches beyond its outline.

    Its `points` (n, 3), inside and around, and the area of its `neighbours` are in its frame.
    """
    outline = roof.outline
    edges = list_outline_edges(outline)
    shapely.prepare(outline)
    near = find_near(points, outline, neighbours)
    gaps = np.array([measure_gap(edges, k, neighbours) for k in range(len(edges.starts))])
    is_measured = (gaps > PARTY_M) & (edges.lengths >= LONGEST_OVERHANG_M)
    measured = [
        measure_edge(roof, edges, k, near, neighbours) if is_measured[k] else UNMEASURED
        for k in range(len(edges.starts))
    ]
    lengths, sigmas = pool_sides(edges, measured)
    lengths = np.where(gaps <= PARTY_M, 0.0, lengths)
    is_blocked = (gaps <= PARTY_M) | (gaps < lengths + EAVE_STEP_M)
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
    """Measure where the roof ends before an edge.

    The likelihood of an end is that of points which lie evenly over the clear area up to it.
    """
    start, end, outwards = (values[number] for values in edges[:3])
    length = float(edges.lengths[number])
    frame = EdgeFrame(start, (end - start) / length, outwards, length)
    across, clear = cut_strip(roof, frame, points, neighbours)
    behind = int((across < 0.0).sum())
    if behind < FEWEST_POINTS or not clear[ACROSS_M < 0.0].any():
        return UNMEASURED
    at_points, at_places = (
        STRAY_DENSITY + (1.0 - STRAY_DENSITY) * ndtr((ACROSS_M[:, None] - x) / EAVE_BLUR_M)
        for x in (across, ACROSS_M)
    )
    log_likelihood = np.log(at_points).sum(axis=1) - len(across) * np.log(at_places @ clear)
    first = float(find_chances(log_likelihood) @ ACROSS_M)
    chance = find_chances(log_likelihood / measure_clumping(across[across < first]))
    reach = float(chance @ ACROSS_M)
    sigma = max(math.sqrt(float(chance @ (ACROSS_M - reach) ** 2)), LEAST_SIGMA_M)
    before = (ACROSS_M > 0.0) & (reach > ACROSS_M)
    expected = behind * float(clear[before].sum() / clear[ACROSS_M < 0.0].sum())
    return Measurement(reach, sigma, int(((across > 0.0) & (across < reach)).sum()), expected)


def find_chances(log_likelihood: np.ndarray) -> np.ndarray:
    """Return the chances (k,) of places by their likelihood."""
    chance = np.exp(log_likelihood - log_likelihood.max())
    return chance / chance.sum()


def measure_clumping(across: np.ndarray) -> float:
    """Return how many of the points (n,) across an edge count as one.

    It is 1 where they lie evenly. Scan lines that run along an edge leave gaps g. From the last of
    them, the roof goes on by E(g^2) / 2 E(g) on average (renewal theory), by E(g) where points lie
    evenly.
    """
    gaps = np.diff(np.sort(across))
    if not gaps.any():
        return 1.0
    return max(float((gaps**2).mean() / (2.0 * gaps.mean() ** 2)), 1.0)


def cut_strip(
    roof: Roof, frame: EdgeFrame, points: np.ndarray, neighbours: shapely.Geometry
) -> tuple[np.ndarray, np.ndarray]:
    """Return where points of a roof lie across an edge (n,), and the clear share (k,).

    Beyond the edge these are points that continue its plane. The share is that of the edge before
    which each of the places ACROSS_M is clear.
    """
    offset = points[:, :2] - frame.start
    along, across = offset @ frame.along, offset @ frame.outwards
    within = (along >= 0.0) & (along <= frame.length) & (np.abs(across) <= OVERHANG_REACH_M)
    points, along, across = points[within], along[within], across[within]
    z, slack = continue_planes(roof, frame, along, across)
    is_low = (across > 0.0) & (points[:, 2] < z - slack)
    z_ground = np.median(points[is_low, 2]) if is_low.sum() >= FEWEST_POINTS else -np.inf
    is_clear = find_clear(roof, frame, along, across, neighbours, z_ground)
    z = np.where(across < 0.0, roof.height_at(points[:, :2]), z)
    shares = (np.arange(len(ACROSS_M)) + 0.5) / len(ACROSS_M)
    places = np.meshgrid(shares * frame.length, ACROSS_M)
    clear = find_clear(roof, frame, places[0].ravel(), places[1].ravel(), neighbours, z_ground)
    return (
        across[is_clear & (np.abs(points[:, 2] - z) <= slack)],
        clear.reshape(places[0].shape).mean(axis=1),
    )


def find_clear(
    roof: Roof,
    frame: EdgeFrame,
    along: np.ndarray,
    across: np.ndarray,
    neighbours: shapely.Geometry,
    z_ground: float,
) -> np.ndarray:
    """Return which places (n,) show the roof, or whether it goes on before an edge.

    There, neither the outline nor a neighbour lies, and the plane is clear of the ground.
    """
    x, y = (frame.start + along[:, None] * frame.along + across[:, None] * frame.outwards).T
    result = shapely.contains_xy(roof.outline, x, y) == (across < 0.0)
    if not neighbours.is_empty:
        result &= ~shapely.contains_xy(neighbours, x, y)
    z, slack = continue_planes(roof, frame, along, across)
    return result & ((across < 0.0) | (z - slack > z_ground + ON_PLANE_M))


def continue_planes(
    roof: Roof, frame: EdgeFrame, along: np.ndarray, across: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Continue the planes just inside an edge to places (n,) in its frame.

    Returns heights, and how far off upright points may lie.
    """
    feet, number = np.unique(along, return_inverse=True)
    foot = frame.start + feet[:, None] * frame.along - JUST_INSIDE_M * frame.outwards
    planes = find_planes(roof, foot)[number]
    xy = foot[number] + (across + JUST_INSIDE_M)[:, None] * frame.outwards
    z = (xy * planes[:, :2]).sum(axis=1) + planes[:, 2]
    return z, ON_PLANE_M * np.sqrt(1.0 + (planes[:, :2] ** 2).sum(axis=1))


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
            found, expected = (sum(values) for values in list(zip(*known, strict=True))[2:])
            if is_long and found >= LEAST_FILL * expected:
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
    return all(abs(item.length - mean) <= OVERHANG_SIGMAS * item.sigma for item in known)


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
