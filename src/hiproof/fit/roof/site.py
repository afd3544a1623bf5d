"""What a roof has to explain: points, unobserved cells, and an outline with its lines."""

from __future__ import annotations

import numpy as np
import shapely

from ...geometry.point_in_polygon import find_inside
from ...geometry.rings import ring_edges
from ..layout.plan import HEIGHT_MARGIN_M
from ..layout.scene import LEAST_CELLS, lay_grid, lay_unobserved_cells
from ..layout.whole import Whole
from ..prices import DEAD_M, NARROW_M
from .draw import RING_CORNERS
from .price import Site

SHORTEST_EDGE_M = 0.7  # Shortest edge (m) of an outline along whose line a volume may end.
SHORTEST_CHORD_M = 1.5  # Shortest line (m) between two corners.
CHORD_CORNERS = 16  # Most corners of an outline with such lines.
MOST_PART_CORNERS = RING_CORNERS // 2  # Most corners of a convex part: cutting it adds some.
BAY_DEPTH_M = 0.3  # Depth (m) from which on a bay is one.
SMALLEST_BAY_M2, LARGEST_BAY_M2 = 0.3, 40.0  # Area (m2) of the smallest and largest bay.
BAY_POINTS = 3  # Fewer points show no height.
CONVEX_PART_M2 = 1e-6  # Area (m2) of the smallest part.


def make_site(whole: Whole, keeps_shapes: bool = False) -> Site:
    """Return the site of a building.

    Of the points beside the border, which may be on walls, those in bays count.
    """
    outline, points, border = whole.outline, whole.plan.uvz, whole.plan.border
    bays, heights, in_bay = list_bays(outline, np.hstack([points, border]).T)
    density, low, high = points.shape[1] / outline.area, points[2].min(), points[2].max()
    grid = lay_grid(shapely.get_coordinates(outline), density, LEAST_CELLS)
    cells = lay_unobserved_cells(whole, grid[0], grid[1], points, density)  # ascending by u
    points = np.hstack([points, border[:, in_bay[points.shape[1] :]]])
    points = points[:, np.argsort(points[0], kind="stable")]
    n, nothing = points.shape[1], np.zeros(cells.shape[1])
    x, y, z = np.hstack([points, [*cells[:2], nothing]])
    weight, shade = np.ascontiguousarray(np.hstack([[np.ones(n), np.zeros(n)], cells[2:]]))
    rings = split_convex(outline)
    parts, sizes = np.zeros((len(rings), RING_CORNERS, 2)), np.array([len(r) for r in rings])
    for part, ring in zip(parts, rings, strict=True):
        part[: len(ring)] = ring
    boxes = np.array([[*np.sort(r[:, 0])[[0, -1]], *np.sort(r[:, 1])[[0, -1]]] for r in rings])
    x0, y0, x1, y1 = outline.bounds
    return Site(
        x,
        y,
        z,
        weight,
        shade,
        n,
        low - HEIGHT_MARGIN_M,
        high + HEIGHT_MARGIN_M,
        DEAD_M,
        whole.width,
        whole.compute_unit(),
        parts,
        sizes,
        boxes,
        list_outline_lines(outline),
        bays,
        heights,
        np.array([x0, x1, y0, y1]),
        outline.area,
        min(NARROW_M, 2.0 * outline.area / outline.length),  # a slender outline is as wide
        keeps_shapes,
    )


def list_outline_lines(outline: shapely.Polygon) -> np.ndarray:
    """List the lines (m, 6) of an outline's edges, and those between two of its corners.

    They are a, b, c, x and y of the middle, and 1 for an edge, else 0.
    """
    starts, ends = ring_edges(shapely.orient_polygons(outline))
    is_long = np.hypot(*(ends - starts).T) >= SHORTEST_EDGE_M
    n_edges = np.count_nonzero(is_long)
    corners = shapely.get_coordinates(outline.exterior)[:-1]
    i, j = np.triu_indices(len(corners) if len(corners) <= CHORD_CORNERS else 0, 2)
    is_chord = (j - i < len(corners) - 1) & (
        np.hypot(*(corners[j] - corners[i]).T) >= SHORTEST_CHORD_M
    )
    start = np.concatenate([starts[is_long], corners[i[is_chord]]])
    end = np.concatenate([ends[is_long], corners[j[is_chord]]])
    along = end - start
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    c = -(normal * start).sum(axis=1)
    is_edge = np.arange(len(start)) < n_edges
    middle = 0.5 * (start + end)
    return np.ascontiguousarray(np.column_stack([normal, c, middle, is_edge]))


def list_bays(
    outline: shapely.Polygon, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """List the places that the line of a wall cuts off an outline, a bay or a corner.

    Returns their four sides (b, 4, 3), the median height (b,) of their points (n, 3), and which
    points (n,) lie in one.
    """
    in_bay = np.zeros(len(points), bool)
    ring = shapely.get_coordinates(shapely.orient_polygons(outline).exterior)
    reach = np.hypot(*np.ptp(ring, axis=0))
    sides, heights = [], []
    steps = np.diff(ring, axis=0)
    lengths = np.hypot(*steps.T)
    ways = steps / np.maximum(lengths, 1e-9)[:, None]
    outs = np.column_stack([ways[:, 1], -ways[:, 0]])
    depths = (ring @ outs.T).max(axis=0) - (ring[:-1] * outs).sum(axis=1)
    for k in np.flatnonzero((lengths >= SHORTEST_EDGE_M) & (depths >= BAY_DEPTH_M)).tolist():
        start, end, along, out = ring[k], ring[k + 1], ways[k], outs[k]
        beyond = shapely.Polygon(
            [
                start - reach * along,
                start + reach * (out - along),
                end + reach * (out + along),
                end + reach * along,
            ]
        )
        for bay in shapely.get_parts(shapely.intersection(outline, beyond)):
            if bay.geom_type != "Polygon" or not SMALLEST_BAY_M2 < bay.area < LARGEST_BAY_M2:
                continue
            inside = find_inside(bay, points[:, 0], points[:, 1])
            if inside.sum() < BAY_POINTS:
                continue
            in_bay |= inside
            places = shapely.get_coordinates(bay) @ along
            sides.append(
                [
                    [*out, -float(out @ start)],
                    [*-out, float(out @ start) + reach],
                    [*along, -float(places.min())],
                    [*-along, float(places.max())],
                ]
            )
            heights.append(float(np.median(points[inside, 2])))
    return np.array(sides).reshape(-1, 4, 3), np.array(heights), in_bay


def split_convex(polygon: shapely.Polygon) -> list[np.ndarray]:
    """Split a polygon into convex rings (k, 2), counter-clockwise.

    Triangles are merged over their longest common edges as long as the result is convex (Hertel and
    Mehlhorn 1983).
    """
    ring = shapely.get_coordinates(shapely.orient_polygons(polygon).exterior)[:-1]
    if not polygon.interiors and len(ring) <= MOST_PART_CORNERS and is_convex(ring):
        return [ring]
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    triangles = shapely.orient_polygons(triangles[shapely.area(triangles) > CONVEX_PART_M2])
    rings = {i: [tuple(c) for c in t.exterior.coords[:-1]] for i, t in enumerate(triangles)}
    owner = {edge: i for i, ring in rings.items() for edge in list_edges(ring)}
    inner = [edge for edge in owner if edge < edge[::-1] and edge[::-1] in owner]
    for start, end in sorted(inner, key=lambda e: (-np.hypot(*np.subtract(*e)), e)):
        first, second = owner[start, end], owner[end, start]
        merged = merge_rings(rings[first], rings[second], start, end)
        if first == second or len(merged) > MOST_PART_CORNERS or not is_convex(merged):
            continue
        rings[first] = merged
        for edge in list_edges(rings.pop(second)):
            owner[edge] = first
    return [np.array(ring) for ring in rings.values()]


def list_edges(ring: list) -> list[tuple]:
    return list(zip(ring, [*ring[1:], ring[0]], strict=True))


def merge_rings(ring: list, other: list, start: tuple, end: tuple) -> list:
    """Merge two rings over their edge from `start` to `end`, which the other has reversed."""
    i, j = ring.index(end), other.index(start)
    first = [*ring[i:], *ring[:i]]  # from end round to start
    second = [*other[j:], *other[:j]]  # from start round to end
    return [*first, *second[1:-1]]


def is_convex(ring: list | np.ndarray) -> bool:
    step = np.roll(ring, -1, axis=0) - ring
    following = np.roll(step, -1, axis=0)
    return bool((step[:, 0] * following[:, 1] - step[:, 1] * following[:, 0] > -1e-9).all())
