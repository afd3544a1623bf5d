"""From a roof to the cells of its plan.

Outline, pieces and the lines where the active plane changes are arranged.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
import shapely

from ..compiled import compiled
from ..errors import CompositionError
from ..model import Roof
from .arrangement import (
    GRID_M,
    OUTSIDE,
    UNCOVERED,
    half_edge_order,
    is_beside,
    meeting_lines,
    next_half_edges,
    plan_cells,
    renumber_vertices,
    trace_faces,
    turn,
)
from .levels import evaluate_plane

# units of the grid, 3 mm: beside a shorter edge no face can be flat to val3dity's 20 degrees
SHORT_UNITS = 30.0


@compiled
def edges_at(edges, v):
    """Return the first two edges that end in vertex v, and how many do.

    A missing edge is -1.
    """
    result, count = (-1, -1), 0
    for e in range(len(edges)):
        if edges[e, 0] == v or edges[e, 1] == v:
            result = (e, result[1]) if count == 0 else (result[0], e) if count == 1 else result
            count += 1
    return result[0], result[1], count


@compiled
def gap_at(xy, side, planes, e, v):
    """Return how far apart the planes beside edge e are over vertex v."""
    return abs(
        evaluate_plane(planes, side[e, 0], xy[v, 0], xy[v, 1])
        - evaluate_plane(planes, side[e, 1], xy[v, 0], xy[v, 1])
    )


@compiled
def is_clear(xy, edges, missing, stays, distant, reach):
    """Return whether edge (missing, distant) can become (stays, distant).

    No vertex may lie in the triangle between them or within reach of it.
    """
    for e in range(len(edges)):
        for v in edges[e]:
            if v < 0 or v in (missing, stays, distant):
                continue
            if is_beside(xy[v], xy[stays], xy[distant], reach):
                return False
            a, b, c = (
                turn(xy[missing], xy[stays], xy[v]),
                turn(xy[stays], xy[distant], xy[v]),
                turn(xy[distant], xy[missing], xy[v]),
            )
            if (a >= 0) == (b >= 0) and (b >= 0) == (c >= 0):
                return False
    return True


@compiled
def without_short_edges(xy, edges, side, planes, reach):
    """Drop an end of every edge between two cells that is shorter than 3 mm.

    Returns (xy, edges, side), compacted.

    Only an end where nothing else meets can go, of two the one over which the cells are further
    apart. Outlines stay.
    """
    edges = edges.copy()
    for e in range(len(edges)):
        u, v = edges[e]
        if u < 0 or side[e, 0] == OUTSIDE or side[e, 1] == OUTSIDE:
            continue
        if np.hypot(float(xy[u, 0] - xy[v, 0]), float(xy[u, 1] - xy[v, 1])) >= SHORT_UNITS:
            continue
        if gap_at(xy, side, planes, e, u) < gap_at(xy, side, planes, e, v):
            u, v = v, u
        for missing, stays in ((u, v), (v, u)):
            first, second, count = edges_at(edges, missing)
            other = second if first == e else first
            end = 0 if edges[other, 0] == missing else 1
            distant = edges[other, 1 - end]
            if (
                count != 2
                or distant == stays
                or not is_clear(xy, edges, missing, stays, distant, reach)
            ):
                continue
            edges[other, end] = stays
            edges[e, 0] = edges[e, 1] = -1
            break
    return renumber_vertices(xy, edges, side)


# m from the frame's origin: on the integer grid, areas beyond would not fit 64 bits
MAX_EXTENT_M = 50_000.0


@dataclass(frozen=True)
class PlanProblem:
    """A roof in grid units.

    Polygons are soups of edges: polygon 0 is the outline, polygon k + 1 that of piece k.

    `planes` (p, 3) give heights in grid units; `group` (p,) the first plane equal to each within
    its roof part, `part` (p,) the roof part it belongs to. `patches` are (soup, label) pairs that
    overrule the height function.
    """

    soups: list[np.ndarray]
    planes: np.ndarray
    plane_start: np.ndarray
    group: np.ndarray
    part: np.ndarray
    patches: list[tuple[np.ndarray, int]] = field(default_factory=list)


@dataclass(frozen=True)
class PlanCells:
    """The plan as labelled edges.

    `xy` (n, 2) are int64 grid units, `edges` (e, 2), and `side` (e, 2) the labels left and right.

    A label is the index of the plane that roofs the cell, OUTSIDE (-1) beyond the outline.
    """

    xy: np.ndarray
    edges: np.ndarray
    side: np.ndarray


def polygon_soups(polygons: list[shapely.Polygon]) -> list[np.ndarray]:
    """Return the edges (m, 4) of all rings of each polygon, on the grid.

    An item may be several polygons in one. Edges without length are left out.
    """
    parts, polygon_of_part = shapely.get_parts(np.array(polygons, object), return_index=True)
    rings, part_of_ring = shapely.get_rings(parts, return_index=True)
    xy, ring = shapely.get_coordinates(rings, return_index=True)
    if not np.isfinite(xy).all() or np.abs(xy).max(initial=0) > MAX_EXTENT_M:
        raise CompositionError(
            "expected plan coordinates within 50 km of the roof's local origin, got larger or "
            "non-finite ones; give the outline in the roof's local frame"
        )
    xy = np.rint(xy / GRID_M)
    soup = np.concatenate((xy[:-1], xy[1:]), axis=1)
    mask = (ring[:-1] == ring[1:]) & ((soup[:, 0] != soup[:, 2]) | (soup[:, 1] != soup[:, 3]))
    owner = polygon_of_part[part_of_ring[ring[:-1][mask]]]
    soup, ends = soup[mask], np.searchsorted(owner, np.arange(len(polygons) + 1)).tolist()
    return [soup[lower:upper] for lower, upper in itertools.pairwise(ends)]


def plan_problem(roof: Roof) -> PlanProblem:
    """Return the roof on the grid.

    Raises CompositionError when it has no outline, no pieces or planes that are not finite.
    """
    outline, *borders = polygon_soups([roof.outline, *(piece.outline for piece in roof.pieces)])
    part_of_piece = [index for index, part in enumerate(roof.parts) for _ in part.pieces]
    pieces = [
        (border, np.asarray(piece.planes, float).reshape(-1, 3), index)
        for border, piece, index in zip(borders, roof.pieces, part_of_piece, strict=True)
        if len(border) and len(piece.planes)
    ]
    if len(outline) == 0 or not pieces:
        raise CompositionError(
            "expected a roof with an outline and at least one piece with planes, got none; fall "
            "back to a flat block"
        )
    borders, planes, part = zip(*pieces, strict=True)
    counts = [len(plane) for plane in planes]
    stacked = np.concatenate(planes)
    if not np.isfinite(stacked).all():
        raise CompositionError(
            "expected finite roof planes, got NaN or infinity; fall back to a flat block"
        )
    plane_start = np.array([0, *itertools.accumulate(counts)])
    in_grid_units = stacked / [1, 1, GRID_M]
    return PlanProblem(
        [outline, *borders],
        in_grid_units,
        plane_start,
        equal_planes(stacked),
        np.repeat(part, counts),
    )


def equal_planes(planes: np.ndarray, tolerance: float = 1e-6) -> np.ndarray:
    """Return the index (p,) of the first plane that equals each.

    Planes (p, 3) are equal within a `tolerance` of metres and of slope. Sorted by height, few are
    compared. Parts that share a plane share its faces: where they touch, one face carries the first
    part's index.
    """
    order = np.argsort(planes[:, 2], kind="stable")
    in_order, first = planes[order], np.arange(len(planes))
    for step in range(1, len(planes)):
        differences = np.abs(in_order[step:] - in_order[:-step])
        if differences[:, 2].min() >= tolerance:
            break
        is_equal = differences.max(axis=1) < tolerance
        pairs = np.sort([order[:-step][is_equal], order[step:][is_equal]], axis=0)
        np.minimum.at(first, pairs[1], pairs[0])
    return first


def stacked_soups(soups: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return one array of edges and the start of each polygon in it."""
    start = np.array([0, *itertools.accumulate(map(len, soups))])
    edges = np.concatenate(soups) if soups else np.zeros((0, 4))
    return np.ascontiguousarray(edges, float), start


def arrange(
    problem: PlanProblem, reach: float, min_area_m2: float, min_width_m: float
) -> PlanCells:
    """Return the plan cells of a roof, well separated by the `reach` (grid units).

    Where no piece covers the outline, the piece beside it is extended.
    """
    for _ in range(4):
        soup, soup_start = stacked_soups(problem.soups)
        patches, patch_start = stacked_soups([patch for patch, _ in problem.patches])
        patch_label = np.array([label for _, label in problem.patches], np.int64)
        lines = meeting_lines(soup, soup_start, problem.planes, problem.plane_start)
        segments = np.concatenate((soup.astype(np.int64), patches.astype(np.int64), lines))
        xy, edges, side = plan_cells(
            segments,
            reach,
            soup,
            soup_start,
            problem.planes,
            problem.plane_start,
            problem.group,
            patches,
            patch_start,
            patch_label,
            min_area_m2 / GRID_M**2,
            min_width_m / GRID_M,
        )
        if not (side == UNCOVERED).any():
            return PlanCells(*without_short_edges(xy, edges, side, problem.planes, reach))
        problem = extend_over_gaps(problem, PlanCells(xy, edges, side))
    raise CompositionError(
        "expected the roof's pieces to reach all of its outline, got gaps that no piece borders"
    )


def extend_over_gaps(problem: PlanProblem, cells: PlanCells) -> PlanProblem:
    """Add a piece over each uncovered cell.

    Its planes are those of the piece that the cell borders most.
    """
    follow = next_half_edges(cells.edges, *half_edge_order(cells.xy, cells.edges))
    face, _ = trace_faces(cells.xy, cells.edges, follow)
    label = cells.side.ravel()
    for gap in np.unique(face[label == UNCOVERED]):
        indices = np.flatnonzero((face == gap) & (face[np.arange(len(face)) ^ 1] != gap))
        soup = cells.xy[cells.edges[indices >> 1]].reshape(-1, 4).astype(float)
        problem = cover_gap(problem, soup, label[indices ^ 1])
    return problem


def cover_gap(problem: PlanProblem, gap: np.ndarray, neighbour: np.ndarray) -> PlanProblem:
    """Add a piece over the polygon `gap` (m, 4).

    Its edges border cells labelled `neighbour` (m,).
    """
    length = np.hypot(gap[:, 2] - gap[:, 0], gap[:, 3] - gap[:, 1])
    piece_of_plane = (
        np.searchsorted(problem.plane_start, np.arange(len(problem.planes)), side="right") - 1
    )
    roofed = neighbour >= 0
    shared = np.bincount(
        piece_of_plane[neighbour[roofed]], length[roofed], minlength=len(problem.plane_start) - 1
    )
    piece = int(shared.argmax()) if shared.any() else nearest_piece(problem, gap)
    lower, upper = problem.plane_start[piece], problem.plane_start[piece + 1]
    return PlanProblem(
        [*problem.soups, gap],
        np.concatenate((problem.planes, problem.planes[lower:upper])),
        np.append(problem.plane_start, problem.plane_start[-1] + upper - lower),
        np.concatenate((problem.group, problem.group[lower:upper])),
        np.concatenate((problem.part, problem.part[lower:upper])),
        problem.patches,
    )


def nearest_piece(problem: PlanProblem, gap: np.ndarray) -> int:
    """Return the piece whose border comes nearest to a gap's first corner.

    `gap` (m, 4) are edges.
    """
    corner = shapely.Point(gap[0, :2])
    borders = [shapely.multilinestrings(list(soup.reshape(-1, 2, 2))) for soup in problem.soups[1:]]
    return int(np.argmin([corner.distance(border) for border in borders]))
