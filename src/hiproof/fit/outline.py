"""The outline of a building without a footprint, from the plan positions of its points.

A building that one primitive stands for takes that primitive's rectangle: the likelihood finds its sides without bias.
Any other takes the alpha shape of its points, pushed out by half the spacing (it runs through the outermost points, so
its edges lie that far inside) and drawn with as few straight edges as will do, along the two main directions where they
run near them.
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from .alpha_shape import alpha_shape, default_radius

CLOSING_SPACINGS, PUSH_SPACINGS, SIMPLIFY_SPACINGS = 1.0, 0.5, 0.8
ALONG_AXIS_DEG = 30.0
SAME_LINE_SPACINGS = 1.2
RECTANGLE_IOU, FAITHFUL_IOU = 0.8, 0.85


def estimate_outline(xy: np.ndarray, kappa: float | None = None) -> shapely.Polygon:
    """Outline (a polygon without holes) of points `xy` (n, 2) in metres, straightened along `kappa` (rad) and across.

    Without `kappa` the outline's own main direction is taken. Raises FitError for points that span no area.
    """
    xy = np.asarray(xy, float)
    shape = alpha_shape(xy, 1.2 * default_radius(xy))
    spacing = math.sqrt(shape.area / max(len(xy), 1))
    shape = shapely.buffer(shape, CLOSING_SPACINGS * spacing, join_style="mitre")
    shape = largest(shapely.buffer(shape, (PUSH_SPACINGS - CLOSING_SPACINGS) * spacing, join_style="mitre"))
    rough = largest(shapely.simplify(shapely.Polygon(shape.exterior), SIMPLIFY_SPACINGS * spacing))
    if kappa is None:
        kappa = longest_direction(rough)
    straight = straightened(rough, kappa, SAME_LINE_SPACINGS * spacing)
    return straight if iou(straight, shape) >= FAITHFUL_IOU else rough


def is_rectangular(rectangle: shapely.Polygon, xy: np.ndarray) -> bool:
    """Whether the rectangle of a fitted primitive covers much the same plan as the outline of the points `xy` (n, 2)."""
    return iou(rectangle, estimate_outline(xy)) >= RECTANGLE_IOU


def iou(one: shapely.Polygon, other: shapely.Polygon) -> float:
    """Intersection over union of two polygons, 0 where one is empty or invalid."""
    if one.is_empty or other.is_empty or not (one.is_valid and other.is_valid):
        return 0.0
    common = shapely.intersection(one, other).area
    return common / (one.area + other.area - common)


def largest(geometry: shapely.Geometry) -> shapely.Polygon:
    return max(shapely.get_parts(geometry), key=lambda part: part.area)


def longest_direction(outline: shapely.Polygon) -> float:
    """Direction (rad) of the smallest rectangle around the outline."""
    edges = np.diff(shapely.get_coordinates(shapely.minimum_rotated_rectangle(outline)), axis=0)
    longest = edges[np.argmax(np.hypot(edges[:, 0], edges[:, 1]))]
    return math.atan2(longest[1], longest[0])


def straightened(outline: shapely.Polygon, kappa: float, same_line_m: float) -> shapely.Polygon:
    """The outline redrawn with edges along `kappa` and across it wherever its own run within 30 degrees of them."""
    turn = np.array([[math.cos(kappa), math.sin(kappa)], [-math.sin(kappa), math.cos(kappa)]])
    corners = shapely.get_coordinates(outline.exterior)[:-1] @ turn.T
    lines = joined(edge_lines(corners), same_line_m)
    if len(lines) < 3:
        return shapely.Polygon()
    vertices = []
    for before, after in zip(lines, lines[1:] + lines[:1], strict=True):
        normals = np.array([before[0], after[0]])
        if abs(np.linalg.det(normals)) < 0.15:  # nearly parallel: no corner to speak of
            return shapely.Polygon()
        vertices.append(np.linalg.solve(normals, [before[1], after[1]]))
    return shapely.Polygon(np.array(vertices) @ turn)


Line = tuple[tuple[float, float], float, float, np.ndarray]  # unit normal, offset along it, length, end point


def edge_lines(corners: np.ndarray) -> list[Line]:
    """The line of every edge, level or upright where its edge runs near it."""
    lines = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        step = end - start
        length = float(np.hypot(*step))
        if length < 1e-9:
            continue
        angle = math.degrees(math.atan2(abs(step[1]), abs(step[0])))
        middle = 0.5 * (start + end)
        if angle < ALONG_AXIS_DEG:
            normal = (0.0, 1.0)
        elif angle > 90.0 - ALONG_AXIS_DEG:
            normal = (1.0, 0.0)
        else:
            normal = (-step[1] / length, step[0] / length)
        lines.append((normal, float(np.dot(normal, middle)), length, end))
    return lines


def joined(lines: list[Line], same_line_m: float) -> list[Line]:
    """Neighbours of one direction become one line where they nearly coincide; else a step is put between them."""
    start = next((k for k in range(len(lines)) if lines[k][0] != lines[k - 1][0]), 0)
    result: list[Line] = []
    for line in lines[start:] + lines[:start]:
        if result and result[-1][0] == line[0]:
            normal, offset, length, end = result[-1]
            if abs(offset - line[1]) < same_line_m:
                total = length + line[2]
                result[-1] = (normal, (offset * length + line[1] * line[2]) / total, total, line[3])
                continue
            across = (normal[1], -normal[0])
            result.append((across, float(np.dot(across, end)), 0.0, end))
        result.append(line)
    return result
