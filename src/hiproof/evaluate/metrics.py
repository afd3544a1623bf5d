"""Measures of how well a model fits its points: PSD, outline IoU and shares of points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from ..geometry.grid import number_cells
from ..geometry.point_in_polygon import find_inside
from ..geometry.rings import unite
from ..model import ROOF, Fit, Quality, Solid
from .distance import make_polygon, point_surface_distances, vertical_distances

# A point within this vertical distance of the roof counts as explained well (the field's share
# within 20 cm).
NEAR_M = 0.2

FACADE_M = 0.3  # points this close to the outline may be facade returns; the share leaves them out

MIN_INNER_POINTS = 10  # a share of fewer points says nothing

# A cell most of whose points lie farther than this above or below the roof holds something the
# model lacks.
UNEXPLAINED_M = 0.5

CELL_M = 1.0  # side of the plan cells behind the no-data share and the unexplained area

Polygons = Sequence[np.ndarray | Sequence[np.ndarray]]


class Inner(NamedTuple):
    """The points (n,) FACADE_M or more inside an outline, and the area there."""

    holds: np.ndarray
    area_m2: float


def well_inside(points: np.ndarray, outline: shapely.Geometry) -> Inner:
    """Return the points of (n, 2 or 3) that lie well inside the outline."""
    area = shapely.buffer(outline, -FACADE_M)
    return Inner(find_inside(area, points[:, 0], points[:, 1]), area.area)


def roof_polygons(model: Solid | Fit | Polygons) -> list[list[np.ndarray]]:
    """Return roof surfaces as lists of rings (m, 3), the outer first, in the model's frame."""
    if isinstance(model, Solid):
        return list_rings(model, ROOF)
    if isinstance(model, Fit):
        return [[model.vertices[list(face)]] for face in model.faces]
    return [[polygon] if isinstance(polygon, np.ndarray) else list(polygon) for polygon in model]


def list_rings(solid: Solid, kind: str) -> list[list[np.ndarray]]:
    """Return the faces of a kind as lists of rings (m, 3), the outer first."""
    return [[solid.vertices[list(ring)] for ring in f.rings] for f in solid.select_faces(kind)]


def plan_outline(model: Solid | Fit | Polygons) -> shapely.Geometry:
    """Return the union of a model's roof surfaces in plan, empty without any."""
    polygons = [make_polygon(rings) for rings in roof_polygons(model)]
    polygons = [p if p.is_valid else p.buffer(0) for p in polygons]
    return unite(polygons)


def psd(model: Solid | Fit | Polygons, points: np.ndarray) -> np.ndarray:
    """Return the distance (n,) in m of `points` (n, 3) to the model's nearest roof surface."""
    return point_surface_distances(points, roof_polygons(model))


def iou(a: shapely.Geometry, b: shapely.Geometry) -> float:
    """Return the area of the intersection over that of the union, NaN when neither has one.

    >>> iou(shapely.box(0, 0, 2, 1), shapely.box(1, 0, 3, 1))
    0.3333333333333333
    """
    common = shapely.intersection(a, b).area
    together = a.area + b.area - common
    return float(common / together) if together > 0 else float("nan")


def quality(
    model: Solid | Fit | Polygons,
    points: np.ndarray,
    outline: shapely.Polygon | None = None,
    inner: Inner | None = None,
) -> Quality:
    """Return every residual figure of one model on its `points` (n, 3).

    All are in one frame.

    `outline` is the plan polygon asked for (a footprint); without one the alpha shape of the points
    takes its place, as in the paper; `inner` are the finite points well inside it, where that is
    known. `share_within_20cm` (of the points 0.3 m or more inside the outline, NaN for fewer than
    ten) and `unexplained_area_m2` count vertical distances, and a point with no roof over or under
    it as a miss; `nodata_share` is the share of the outline's 1 m cells that hold no point.
    """
    points = np.ascontiguousarray(points, float).reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    polygons = roof_polygons(model)
    outline = observed_outline(points) if outline is None else outline
    outline = None if outline is None or outline.area == 0 else outline
    figures = {}
    if outline is not None:
        figures["outline_iou"] = iou(plan_outline(polygons), outline)
        figures["density"] = len(points) / outline.area
        figures["nodata_share"] = nodata_share(points, outline)
    if len(points) and polygons:
        inner = inner or well_inside(points, plan_outline(polygons) if outline is None else outline)
        dz = vertical_distances(points, polygons)
        distances = point_surface_distances(points, polygons, at_most=dz)
        figures |= {
            "psd_mean": float(distances.mean()),
            "psd_std": float(distances.std()),
            "rmse": float(np.sqrt(np.mean(distances**2))),
            "p95": float(np.quantile(distances, 0.95)),
            "share_within_20cm": compute_share_within_20cm(dz, inner),
            "unexplained_area_m2": unexplained_area(points, dz),
        }
    return Quality(points=len(points), **figures)


def compute_share_within_20cm(dz: np.ndarray, inner: Inner) -> float:
    """Return the share of inner points with |dz| (n,) below 0.2 m, NaN for fewer than ten."""
    well_inside = dz[inner.holds]
    return (
        float(np.mean(well_inside < NEAR_M))
        if len(well_inside) >= MIN_INNER_POINTS
        else float("nan")
    )


def nodata_share(xy: np.ndarray, outline: shapely.Polygon) -> float:
    """Return the share of cells (1 m, centre in `outline`) without points, NaN without cells."""
    west, south, east, north = np.array(outline.bounds) / CELL_M
    west, south = math.floor(west), math.floor(south)
    columns, rows = math.ceil(east) - west, math.ceil(north) - south
    row, column = np.divmod(np.arange(rows * columns), columns)
    mask = find_inside(outline, (column + west + 0.5) * CELL_M, (row + south + 0.5) * CELL_M)
    if not mask.any():
        return float("nan")
    column, row = np.floor(xy[:, 0] / CELL_M) - west, np.floor(xy[:, 1] / CELL_M) - south
    nearby = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    visited = np.zeros(rows * columns, bool)
    visited[(row[nearby] * columns + column[nearby]).astype(np.int64)] = True
    return float(1 - visited[mask].mean())


def unexplained_area(xy: np.ndarray, dz: np.ndarray) -> float:
    """Return the area (m2) of 1 m cells most of whose points lie half a metre off the roof."""
    cell = number_cells(np.floor(xy[:, :2] / CELL_M))[1]
    counts = np.bincount(cell, weights=dz > UNEXPLAINED_M)
    return float(np.count_nonzero(counts > np.bincount(cell) / 2) * CELL_M**2)


def observed_outline(points: np.ndarray) -> shapely.Polygon | None:
    """Return the alpha shape of points in plan, None where they have none."""
    from ..errors import FitError
    from ..geometry.alpha_shape import alpha_shape

    try:
        return alpha_shape(points[:, :2])
    except FitError:
        return None
