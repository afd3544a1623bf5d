"""From a layout in the building's frame to disjoint pieces of roof over the outline, in local coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from ...model import Piece
from .layout import OVERLAYS, ROOT, Layout
from .plan import Plan

BEYOND_M = 1.0  # leaves at the rim of the plan reach so far beyond it: the outline clips them
THIN_M = 0.08  # pieces narrower than this on average go to their neighbour
CLAMP_M = 0.4  # no height leaves the range of the points by more

Rows = tuple[int, ...]


@dataclass(frozen=True)
class RowPiece:
    """A piece in local coordinates and the rows (k,) of the layout's table its planes came from, -1 for a clamp."""

    piece: Piece
    rows: np.ndarray


def disjoint_pieces(layout: Layout, plan: Plan, outline: shapely.Polygon) -> list[RowPiece]:
    """Pieces that cover `outline` without overlap: leaves of the same planes united, overlays cut out of what lies below."""
    regions = [
        (rows, polygon)
        for rows, region in plan_regions(layout, plan)
        for polygon in polygons_of(shapely.intersection(shapely.transform(region, plan.frame.xy_local), outline))
    ]
    regions = without_thin(regions)
    low, high = plan.cloud.z.min() - CLAMP_M, plan.cloud.z.max() + CLAMP_M
    z_median = plan.frame.origin[2]
    pieces = []
    for rows, polygon in regions:
        rows = np.array(rows)
        planes = plan.frame.plane_local(layout.table[rows])
        kept = active_planes(planes, polygon)
        whole = RowPiece(Piece(polygon, planes[kept]), rows[kept])
        pieces += within_heights(whole, low + z_median, high + z_median)
    return pieces


def leaf_boxes(layout: Layout, plan: Plan) -> list[tuple[int, tuple[float, float, float, float]]]:
    """Holder and (u0, v0, u1, v1) of every leaf."""
    u, v = plan.grid.u, plan.grid.v
    whole = (u[0] - BEYOND_M, v[0] - BEYOND_M, u[-1] + BEYOND_M, v[-1] + BEYOND_M)
    stack, boxes = [(int(layout.count[ROOT]), whole)], []
    while stack:
        node, (u0, v0, u1, v1) = stack.pop()
        at = float(layout.at[node])
        if layout.axis[node] < 0:
            boxes.append((int(layout.holder[node]), (u0, v0, u1, v1)))
        elif layout.axis[node] == 0:
            at = min(max(at, u0), u1)
            stack += [(layout.child[node, 0], (u0, v0, at, v1)), (layout.child[node, 1], (at, v0, u1, v1))]
        else:
            at = min(max(at, v0), v1)
            stack += [(layout.child[node, 0], (u0, v0, u1, at)), (layout.child[node, 1], (u0, at, u1, v1))]
    return boxes


def plan_regions(layout: Layout, plan: Plan) -> list[tuple[tuple[int, ...], shapely.Geometry]]:
    """Table rows and plan region of every set of planes in use, in the building's frame."""
    by_rows: dict[tuple[int, ...], list] = {}

    def put(holder, region):
        rows = tuple(sorted(int(r) for r in layout.plane_of[holder, : layout.planes_of[holder]]))
        by_rows.setdefault(rows, []).append(region)

    covered = None
    for q in range(layout.count[OVERLAYS] - 1, -1, -1):
        h = int(layout.overlays[q])
        u0, u1, v0, v1 = layout.rect[h]
        box = shapely.box(u0, v0, u1, v1)
        put(h, box if covered is None else shapely.difference(box, covered))
        covered = box if covered is None else shapely.union(covered, box)
    for h, bounds in leaf_boxes(layout, plan):
        box = shapely.box(*bounds)
        put(h, box if covered is None else shapely.difference(box, covered))
    return [
        (rows, regions[0] if len(regions) == 1 else shapely.union_all(regions)) for rows, regions in by_rows.items()
    ]


def polygons_of(geometry: shapely.Geometry) -> list[shapely.Polygon]:
    return [g for g in shapely.get_parts(geometry) if g.geom_type == "Polygon" and g.area > 1e-9]


def is_thin(polygon: shapely.Polygon) -> bool:
    return 2.0 * polygon.area < THIN_M * polygon.length or polygon.area < 0.02


def without_thin(regions: list[tuple[Rows, shapely.Polygon]]) -> list[tuple[Rows, shapely.Polygon]]:
    """Give every sliver to the neighbour with which it shares the longest border."""
    thin = [r for r in regions if is_thin(r[1])]
    wide = [r for r in regions if not is_thin(r[1])]
    if not thin or not wide:
        return regions
    for own, sliver in thin:
        near = shapely.buffer(sliver, 1e-4, quad_segs=1)
        shared = [shapely.intersection(near, polygon).area for _, polygon in wide]
        best = int(np.argmax(shared))
        rows, polygon = wide[best]
        merged = polygons_of(shapely.union(polygon, shapely.union(sliver, shapely.intersection(near, polygon))))
        if shared[best] > 0.0 and len(merged) == 1:
            wide[best] = (rows, merged[0])
        else:
            wide.append((own, sliver))
    return wide


def active_planes(planes: np.ndarray, polygon: shapely.Polygon) -> list[int]:
    """Indices of the planes that are not everywhere above some single other one over `polygon`."""
    corners = shapely.get_coordinates(polygon)
    z = corners @ planes[:, :2].T + planes[:, 2]
    kept = list(range(len(planes)))
    for k in range(len(planes)):
        if any(j != k and (z[:, j] <= z[:, k] + 1e-9).all() for j in kept):
            kept.remove(k)
    return kept


def within_heights(whole: RowPiece, low: float, high: float) -> list[RowPiece]:
    """The piece with every height held between `low` and `high`: a flat cap above, flat pieces where it would be below."""
    planes, rows, polygon = whole.piece.planes, whole.rows, whole.piece.outline
    z = shapely.get_coordinates(polygon) @ planes[:, :2].T + planes[:, 2]
    if (z.max(axis=0) > high).all() and rises_above(planes, high, polygon):
        planes, rows = np.vstack([planes, [0.0, 0.0, high]]), np.append(rows, -1)
        kept = active_planes(planes, polygon)
        planes, rows = planes[kept], rows[kept]
    if z.min() >= low:
        return [RowPiece(Piece(polygon, planes), rows)]
    above = where_above(planes, low, polygon)
    found = []
    for part in polygons_of(above):
        kept = active_planes(planes, part)
        found.append(RowPiece(Piece(part, planes[kept]), rows[kept]))
    flat = np.array([[0.0, 0.0, low]])
    return found + [RowPiece(Piece(p, flat), np.array([-1])) for p in polygons_of(shapely.difference(polygon, above))]


def rises_above(planes: np.ndarray, height: float, polygon: shapely.Polygon) -> bool:
    """Whether the min of `planes` is above `height` somewhere over `polygon`, holes not asked: its ring cut by each plane."""
    ring = shapely.get_coordinates(polygon.exterior)[:-1].tolist()
    for a, b, c in planes.tolist():
        ring = ring_above(ring, a, b, c - height)
    doubled = sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(ring, ring[1:] + ring[:1], strict=True))
    return abs(doubled) > 1e-9


def ring_above(ring: list[list[float]], a: float, b: float, c: float) -> list[list[float]]:
    """The part of a ring of vertices where a x + b y + c > 0 (Sutherland and Hodgman 1974)."""
    signed = [a * x + b * y + c for x, y in ring]
    kept = []
    for k, (vertex, z) in enumerate(zip(ring, signed, strict=True)):
        z_before = signed[k - 1]
        if (z > 0.0) != (z_before > 0.0):
            (x0, y0), share = ring[k - 1], z_before / (z_before - z)
            kept.append([x0 + share * (vertex[0] - x0), y0 + share * (vertex[1] - y0)])
        if z > 0.0:
            kept.append(vertex)
    return kept


def where_above(planes: np.ndarray, height: float, polygon: shapely.Polygon) -> shapely.Geometry:
    """The region of `polygon` where the min of `planes` is above `height`."""
    region = polygon
    for plane in planes:
        region = shapely.intersection(region, half_plane(plane - [0.0, 0.0, height], polygon))
    return region


def half_plane(line: np.ndarray, polygon: shapely.Polygon) -> shapely.Polygon:
    """Where a x + b y + c >= 0 within the bounds of `polygon`, as a polygon."""
    x0, y0, x1, y1 = shapely.bounds(polygon)
    a, b, c = line
    box = shapely.box(x0 - 1.0, y0 - 1.0, x1 + 1.0, y1 + 1.0)
    slope = np.hypot(a, b)
    if slope < 1e-12:
        return box if c >= 0.0 else shapely.Polygon()
    normal, reach = np.array([a, b]) / slope, np.hypot(x1 - x0, y1 - y0) + 4.0
    centre = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
    on_line = centre - normal * (centre @ [a, b] + c) / slope
    along = np.array([-normal[1], normal[0]]) * reach
    deep = normal * 2.0 * (reach + abs(centre @ [a, b] + c) / slope)
    return shapely.intersection(
        box, shapely.Polygon([on_line - along, on_line + along, on_line + along + deep, on_line - along + deep])
    )
