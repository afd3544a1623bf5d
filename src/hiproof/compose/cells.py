"""From a roof to the cells of its plan.

Outline, pieces and the lines where the active plane changes are arranged. Cells too small or thin
to be a face are given to their neighbours.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from ..errors import CompositionError
from ..geometry.components import label_components
from ..model import Roof
from ..primitives.catalogue import SMOOTH
from .arrangement import (
    GRID_M,
    OUTSIDE,
    UNCOVERED,
    HalfEdges,
    PlanCells,
    dissolve,
    heights,
    meeting_lines,
    node,
    renumber_vertices,
    trace_faces,
)

NO_CURVE = -1  # Of what is no facet of a curved part.
SAME_UNITS = 1e-3  # of heights that are one
UNSEEN_UNITS = 100.0  # a centimetre: a face thinner than that is none
BEYOND_UNITS = 1000.0  # a decimetre by which a face may rise or fall further than what is around it


def merge_slivers(
    xy: np.ndarray,
    edges: np.ndarray,
    traced: HalfEdges,
    label: np.ndarray,
    patched: np.ndarray,
    problem: PlanProblem,
    min_area: float,
    min_width: float,
) -> None:
    """Give every region too small or thin to a neighbour, smallest first, in `label` (f,).

    Facets of one curve are as thin as they are together.

    The neighbour is the one with the longest common border. A patch alone comes last, for what lies
    between it and the region it belongs to may become that region's. One that would carry its plane
    on to where no roof is around keeps out, unless nobody could see the region.
    """
    sides, length = traced.face.reshape(-1, 2), np.hypot(*np.diff(xy[edges], axis=1)[:, 0].T)
    area = shapely.area(traced.polygons)
    keeps_out = np.zeros(len(label), bool)
    curves = np.where(np.isin(problem.part, problem.curved), problem.part, NO_CURVE)
    for _ in range(len(label)):
        links = sides[label[sides[:, 0]] == label[sides[:, 1]]].T
        region = label_components(len(label), links)
        first = np.unique(region, return_index=True)[1]
        size = np.bincount(region[1:], area, len(first))
        is_patch = np.bincount(region[1:], ~patched[1:], len(first)) == 0
        beside = region[sides]
        is_border = beside[:, 0] != beside[:, 1]
        border = np.bincount(beside.ravel(), np.repeat(length * is_border, 2), len(first))
        is_inner = is_border & (label[sides] != OUTSIDE).all(axis=1)
        curve = np.where(label >= 0, curves[np.maximum(label, 0)], NO_CURVE)[sides]
        is_rim = is_border & ((curve[:, 0] != curve[:, 1]) | (curve[:, 0] == NO_CURVE))
        rim = np.bincount(beside.ravel(), np.repeat(length * is_rim, 2), len(first))
        is_sliver = (size < min_area) | (2 * size < min_width * rim)
        slivers = np.unique(beside[is_inner])
        slivers = slivers[is_sliver[slivers] & ~keeps_out[first[slivers]]]
        if not len(slivers):
            break
        smallest = slivers[np.lexsort((size[slivers], is_patch[slivers]))[0]]
        is_unseen = bool(
            size[smallest] < min_area
            or 2 * size[smallest] < min(min_width, UNSEEN_UNITS) * border[smallest]
        )
        is_end = (beside[is_border] == smallest).any(axis=1)
        ends, at = xy[edges[is_border][is_end]], beside[is_border][is_end]
        neighbour = np.where(at[:, 0] == smallest, at[:, 1], at[:, 0])
        shared = length[is_border][is_end]
        heir = choose_heir(
            ends, neighbour, shared, label[first], problem.planes, smallest, is_unseen
        )
        if heir == OUTSIDE:
            keeps_out |= region == smallest
        else:
            label[region == smallest] = heir


def choose_heir(
    ends: np.ndarray,
    neighbour: np.ndarray,
    length: np.ndarray,
    label: np.ndarray,
    planes: np.ndarray,
    sliver: int,
    anyone: bool,
) -> int:
    """Return the label of the region that takes a sliver over, OUTSIDE where there is none.

    It shares the longest border with the sliver, and its planes stay over it within the heights
    around it (or it is `anyone`). The sliver's border has edges with `ends` (m, 2, 2), of a
    `length` (m,), beside the region `neighbour` (m,). `label` (r,) is that of regions.
    """
    x, y = np.moveaxis(ends, -1, 0)
    shared = np.bincount(neighbour, length * (label[neighbour] != OUTSIDE), len(label))
    around = []
    for regions in (np.full_like(neighbour, sliver), neighbour):
        is_roofed = label[regions] >= 0
        roofs = planes[label[regions[is_roofed]], None]
        around.append(heights(roofs, x[is_roofed], y[is_roofed]).ravel())
    z_around = np.concatenate(around)
    lower, upper = z_around.min(initial=np.inf), z_around.max(initial=-np.inf)
    fits = shared > 0.0
    for r in np.flatnonzero(fits & (label >= 0)):
        z = heights(planes[label[r]], x, y)
        fits[r] = ((lower - BEYOND_UNITS < z) & (z < upper + BEYOND_UNITS)).all()
    if label[sliver] < 0 or (anyone and not fits.any()):
        fits = shared > 0.0
    return int(label[np.where(fits, shared, 0.0).argmax()]) if fits.any() else OUTSIDE


def keep_largest_component(traced: HalfEdges, label: np.ndarray) -> None:
    """Turn all but the largest connected inside to OUTSIDE in `label` (f,), cut at necks."""
    sides, is_inside = traced.face.reshape(-1, 2), label != OUTSIDE
    component = label_components(len(label), sides[is_inside[sides].all(axis=1)].T)
    size = np.bincount(component, np.append(0.0, shapely.area(traced.polygons)) * is_inside)
    label[component != size.argmax()] = OUTSIDE


# units of the grid, 3 mm: beside a shorter edge no face can be flat to val3dity's 20 degrees
SHORT_UNITS = 30.0


# m from the frame's origin: on the integer grid, areas beyond would not fit 64 bits
MAX_EXTENT_M = 50_000.0


class PlanPiece(NamedTuple):
    """A piece of a roof: its edges (m, 4), `planes` (k, 3) of heights in grid units, its part."""

    soup: np.ndarray
    planes: np.ndarray
    part: int


@dataclass(frozen=True)
class PlanProblem:
    """A roof in grid units.

    Polygons are soups of edges. `curved` are the curved roof parts. `patches` are (soup, label)
    pairs that overrule the height function.
    """

    outline: np.ndarray
    pieces: tuple[PlanPiece, ...]
    curved: tuple[int, ...]
    patches: tuple[tuple[np.ndarray, int], ...] = ()

    @cached_property
    def planes(self) -> np.ndarray:
        """The planes (p, 3) of all pieces."""
        return np.concatenate([piece.planes for piece in self.pieces])

    @cached_property
    def piece(self) -> np.ndarray:
        """The number (p,) of each plane's piece."""
        return np.repeat(range(len(self.pieces)), [len(piece.planes) for piece in self.pieces])

    @cached_property
    def part(self) -> np.ndarray:
        """The roof part (p,) that each plane belongs to."""
        return np.array([piece.part for piece in self.pieces])[self.piece]

    @cached_property
    def group(self) -> np.ndarray:
        """The first plane (p,) equal to each."""
        return equal_planes(self.planes * [1, 1, GRID_M])


def polygon_soups(polygons: list[shapely.Polygon]) -> list[np.ndarray]:
    """Return the edges (m, 4) of all rings of each polygon on the grid, none without length."""
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
    """Return the roof on the grid; raises CompositionError without outline, pieces or planes."""
    outline, *soups = polygon_soups([roof.outline, *(piece.outline for piece in roof.pieces)])
    parts = [index for index, part in enumerate(roof.parts) for _ in part.pieces]
    planes = [np.reshape(piece.planes, (-1, 3)) / [1, 1, GRID_M] for piece in roof.pieces]
    pieces = tuple(
        piece
        for piece in map(PlanPiece, soups, planes, parts)
        if len(piece.soup) and len(piece.planes)
    )
    if len(outline) == 0 or not pieces:
        raise CompositionError(
            "expected a roof with an outline and at least one piece with planes, got none; fall "
            "back to a flat block"
        )
    curved = tuple(k for k, part in enumerate(roof.parts) if part.type in SMOOTH)
    problem = PlanProblem(outline, pieces, curved)
    if not np.isfinite(problem.planes).all():
        raise CompositionError(
            "expected finite roof planes, got NaN or infinity; fall back to a flat block"
        )
    return problem


SAME_PLANES = 1e-6  # m, and of slope; planes that differ by less are one


def equal_planes(planes: np.ndarray) -> np.ndarray:
    """Return the index (p,) of the first plane that equals each.

    Planes (p, 3) are equal within SAME_PLANES of metres and of slope. Parts of one plane share
    faces: where they touch, one face carries the first part's index.
    """
    from scipy.spatial import cKDTree

    nearer = np.nextafter(SAME_PLANES, 0.0)
    pairs = cKDTree(planes).query_pairs(nearer, p=np.inf, output_type="ndarray")
    first = np.arange(len(planes))
    np.minimum.at(first, pairs[:, 1], pairs[:, 0])
    return first


def arrange(
    problem: PlanProblem, reach: float, min_area_m2: float, min_width_m: float
) -> PlanCells:
    """Return the plan cells of a roof, apart by the `reach`; pieces are extended over gaps."""
    for _ in range(4):
        cells = find_cells(problem, reach, min_area_m2 / GRID_M**2, min_width_m / GRID_M)
        if not (cells.side == UNCOVERED).any():
            return drop_short_edges(cells, problem.planes, reach)
        problem = extend_over_gaps(problem, cells)
    raise CompositionError(
        "expected the roof's pieces to reach all of its outline, got gaps that no piece borders"
    )


def find_cells(problem: PlanProblem, reach: float, min_area: float, min_width: float) -> PlanCells:
    """Return the cells of one active plane, small ones merged; some may remain UNCOVERED."""
    borders, planes, _ = zip(*problem.pieces, strict=True)
    start, plane_start = (np.cumsum([0, *map(len, items)]) for items in (borders, planes))
    soup = np.concatenate(borders).astype(float)
    lines = meeting_lines(soup, start, problem.planes, plane_start)
    soups = [problem.outline, soup, *(patch for patch, _ in problem.patches), lines]
    xy, edges = node(np.concatenate(soups).astype(np.int64), reach)
    traced = trace_faces(xy, edges)
    label, patched = label_faces(traced.polygons, problem)
    merge_slivers(xy, edges, traced, label, patched, problem, min_area, min_width)
    keep_largest_component(traced, label)
    return dissolve(PlanCells(xy, edges, label[traced.face].reshape(-1, 2)))


def label_faces(faces: np.ndarray, problem: PlanProblem) -> tuple[np.ndarray, np.ndarray]:
    """Return the label of each face (f + 1,), and which faces have a patch; the first is unbounded.

    The label is the group of the plane that is active in the face, the highest of the covering
    pieces' lowest planes, or that of the last patch over it.
    """
    x, y = shapely.get_coordinates(shapely.point_on_surface(faces)).T
    label, best = np.full(len(x), UNCOVERED), np.full(len(x), -np.inf)
    for k, piece in enumerate(problem.pieces):
        here = np.flatnonzero(is_inside(piece.soup, x, y))
        z = heights(piece.planes[:, None], x[here], y[here])
        lowest = (z <= z.min(axis=0) + SAME_UNITS).argmax(axis=0)
        z = z[lowest, np.arange(len(here))]
        is_higher = z > best[here] + SAME_UNITS
        here = here[is_higher]
        group = problem.group[problem.piece == k]
        label[here], best[here] = group[lowest[is_higher]], z[is_higher]
    label[~is_inside(problem.outline, x, y)] = OUTSIDE
    patched = np.zeros(len(x), bool)
    for soup, own in problem.patches:
        over = is_inside(soup, x, y)
        label[over], patched[over] = own, True
    return np.append(OUTSIDE, label), np.append(False, patched)


def is_inside(soup: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return whether the polygon of edges (m, 4) holds places x, y (n,), by the even-odd rule."""
    x0, y0, x1, y1 = soup.T[:, :, None]
    turn = (x - x0) * (y1 - y0) - (y - y0) * (x1 - x0)
    crosses = ((y0 > y) != (y1 > y)) & (turn * (y1 - y0) < 0.0)
    return np.asarray(crosses.sum(axis=0) % 2 == 1)


def drop_short_edges(cells: PlanCells, planes: np.ndarray, reach: float) -> PlanCells:
    """Drop an end of every edge between two cells that is shorter than 3 mm.

    Only an end where nothing else meets can go, of two the one over which the cells are further
    apart. Outlines stay.
    """
    places, ends = cells.xy.tolist(), cells.edges.tolist()
    for e, sides in enumerate(cells.side.tolist()):
        if ends[e][0] < 0 or OUTSIDE in sides:
            continue
        ends_here = [places[v] for v in ends[e]]
        if math.dist(*ends_here) >= SHORT_UNITS:
            continue
        gap = np.abs(np.diff([heights(planes[sides], *place) for place in ends_here])).ravel()
        u, v = ends[e] if gap[0] >= gap[1] else ends[e][::-1]
        for missing, stays in ((u, v), (v, u)):
            meeting = [k for k, pair in enumerate(ends) if missing in pair and k != e]
            distant = [w for k in meeting for w in ends[k] if w != missing]
            if (
                len(meeting) == 1
                and distant != [stays]
                and is_clear(cells.xy, ends, [missing, stays, *distant], reach)
            ):
                ends[meeting[0]] = [stays if w == missing else w for w in ends[meeting[0]]]
                ends[e] = [-1, -1]
                break
    return renumber_vertices(cells._replace(edges=np.array(ends, np.int64).reshape(-1, 2)))


def is_clear(xy: np.ndarray, ends: list[list[int]], corners: list[int], reach: float) -> bool:
    """Return whether a triangle of vertices is farther than the `reach` from all other vertices."""
    others = np.setdiff1d(ends, [-1, *corners])
    triangle = shapely.Polygon(xy[corners])
    return not shapely.dwithin(triangle, shapely.points(xy[others]), reach).any()


def extend_over_gaps(problem: PlanProblem, cells: PlanCells) -> PlanProblem:
    """Add a piece over each uncovered cell with the planes of the piece that borders it most."""
    face, label = trace_faces(cells.xy, cells.edges).face, cells.side.ravel()
    for gap in np.unique(face[label == UNCOVERED]):
        indices = np.flatnonzero((face == gap) & (face[np.arange(len(face)) ^ 1] != gap))
        soup = cells.xy[cells.edges[indices >> 1]].reshape(-1, 4).astype(float)
        problem = cover_gap(problem, soup, label[indices ^ 1])
    return problem


def cover_gap(problem: PlanProblem, gap: np.ndarray, neighbour: np.ndarray) -> PlanProblem:
    """Add a piece over the polygon `gap` (m, 4), whose edges border cells `neighbour` (m,)."""
    length = np.hypot(gap[:, 2] - gap[:, 0], gap[:, 3] - gap[:, 1])
    roofed = neighbour >= 0
    shared = np.bincount(problem.piece[neighbour[roofed]], length[roofed])
    if shared.any():
        piece = problem.pieces[shared.argmax()]
    else:  # that whose border comes nearest to the first corner
        corner = shapely.Point(gap[0, :2])
        piece = min(problem.pieces, key=lambda piece: corner.distance(draw_edges(piece.soup)))
    return replace(problem, pieces=(*problem.pieces, piece._replace(soup=gap)))


def draw_edges(soup: np.ndarray) -> shapely.Geometry:
    return shapely.multilinestrings(list(soup.reshape(-1, 2, 2)))
