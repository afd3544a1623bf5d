"""Heights, slopes, ridge and volume of a solid, integrated exactly over its faces.

Every face is cut into the fan of triangles (o, a, b) that its first vertex o spans with each edge
a-b of its rings. Counted with the sign of their area the triangles of inner rings cancel what holes
take away, so areas, the volume (divergence theorem) and the share of roof below a level need no
triangulation.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..geometry.flat_shell import FlatShell, cross_2d
from .building import Building
from .solid import GROUND, ROOF, Solid

LEVEL_TRIANGLE_M = 1e-9  # a triangle whose corners differ in height by less is level
LEVEL_RIDGE_M = 0.05  # ends of a ridge differ in height by less
# a face below drains but does not slope to the eye; it has no azimuth worth telling
FLAT_SLOPE_DEG = 3.0
STEEP = np.tan(np.radians(FLAT_SLOPE_DEG))


@dataclass(frozen=True)
class RoofFigures:
    """Figures of one solid: heights in world metres, angles in degrees.

    A figure is NaN where there is nothing to measure.

    `h_50p` and `h_70p` are the levels that 50 and 70 % of the roof's plan area lie below; `h_ridge`
    the height of the longest level edge from which two faces fall away, `h_eave` that which the
    eaves of half of the plan area lie below. `slope_deg` and `azimuth_deg` (clockwise from north,
    the way water runs) are those of the largest roof face, `face_slope_deg` and `face_azimuth_deg`
    (faces,) those of every face, `face_area_m2` (faces,) the true area of roof faces, 0 of others.
    """

    h_min: float
    h_50p: float
    h_70p: float
    h_max: float
    h_ridge: float
    h_eave: float
    h_base: float
    volume_m3: float
    plan_area_m2: float
    roof_area_m2: float
    slope_deg: float
    azimuth_deg: float
    roof_faces: int
    face_slope_deg: np.ndarray
    face_azimuth_deg: np.ndarray
    face_area_m2: np.ndarray

    @property
    def roofer_type(self) -> str:
        """The roof in roofer's words: horizontal, multiple horizontal or slanted."""
        slopes = self.face_slope_deg[np.isfinite(self.face_slope_deg)]
        if slopes.size and slopes.max() >= FLAT_SLOPE_DEG:
            return "slanted"
        return "multiple horizontal" if self.h_max - self.h_min > LEVEL_RIDGE_M else "horizontal"


def find_ground_height(building: Building, figures: RoofFigures | None) -> float:
    """Return the ground's height of reconstruction, else the solid's base, else NaN."""
    if math.isfinite(building.z_ground) or figures is None:
        return building.z_ground
    return figures.h_base


def roof_figures(solid: Solid) -> RoofFigures:
    """Return the figures of `solid`.

    Its vertices are in world metres, its faces oriented outwards. Raises ValueError when no face is
    a RoofSurface.

    >>> from hiproof.model import Face
    >>> xyz = np.array([[x, y, z] for z in (0, 3) for x, y in ((0, 0), (4, 0), (4, 5), (0, 5))],
    ...     float)
    >>> walls = [Face(((i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4),), "WallSurface") for i in range(4)]
    >>> box = Solid(xyz, (Face(((3, 2, 1, 0),), "GroundSurface"), Face(((4, 5, 6, 7),),
    ...     "RoofSurface"), *walls))
    >>> figures = roof_figures(box)
    >>> figures.volume_m3, figures.h_70p, figures.roofer_type
    (60.0, 3.0, 'horizontal')
    """
    if not solid.select_faces(ROOF):
        raise ValueError("its solid has no RoofSurface")
    z_origin, shell = float(solid.vertices.mean(axis=0)[2]), solid.shell
    area, is_roof = shell.face_areas, np.array([face.kind == ROOF for face in solid.faces])
    corners, plan = cut_roof(solid, shell)
    slope, azimuth = slopes_and_azimuths(area, is_roof)
    places, ends = shell.corners[corners], corners[:, 1:]
    faces = shell.face_of[ends[:, 0]]
    edges = roof_edges(places[:, 1:], shell.index[ends], area[faces], faces)
    heights = roof_heights(np.sort(places[:, :, 2], axis=1), plan, z_origin)
    eave = find_eave_height(edges) + z_origin
    size = np.where(is_roof, np.sqrt((area * area).sum(axis=1)), 0.0)
    largest = int(size.argmax())
    return RoofFigures(
        **heights,
        h_ridge=find_ridge_height(edges) + z_origin,
        # it is rounded, and no eave leaves the roof
        h_eave=min(max(eave, heights["h_min"]), heights["h_max"]),
        h_base=find_base_height(solid),
        volume_m3=round(shell.volume, 9),
        plan_area_m2=float(plan.sum()),
        roof_area_m2=float(size.sum()),
        slope_deg=float(slope[largest]),
        azimuth_deg=float(azimuth[largest]),
        roof_faces=int(is_roof.sum()),
        face_slope_deg=slope,
        face_azimuth_deg=azimuth,
        face_area_m2=size,
    )


def roof_heights(z: np.ndarray, plan: np.ndarray, z_origin: float) -> dict[str, float]:
    """Return the lowest and highest height, and two between them.

    A share of the roof's area lies below these two. Triangles are given by their corners' heights
    `z` (t, 3) over `z_origin`, in order, and their areas in plan (t,).
    """
    heights = {
        "h_min": z[:, 0].min(),
        "h_max": z[:, 2].max(),
        "h_50p": find_level(0.5, z, plan),
        "h_70p": find_level(0.7, z, plan),
    }
    return {name: float(height + z_origin) for name, height in heights.items()}


def cut_roof(solid: Solid, shell: FlatShell) -> tuple[np.ndarray, np.ndarray]:
    """Return the roof's fan triangles: corners (t, 3) in the shell, signed plan areas (t,)."""
    anchors = shell.ring_start[shell.face_start[shell.face_of]]
    fan = np.stack([anchors, np.arange(len(anchors)), shell.after], axis=1)
    is_roof = np.array([face.kind == ROOF for face in solid.faces])
    corners = fan[is_roof[shell.face_of]]
    return corners, cross_2d(*shell.corners[corners, :2].swapaxes(0, 1)) / 2


def slopes_and_azimuths(area: np.ndarray, is_roof: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return slope and azimuth (degrees) of areas (faces, 3), NaN if no roof, or level."""
    x, y, z = area.T
    slope = np.where(is_roof, np.degrees(np.arctan2(np.hypot(x, y), z)), np.nan)
    azimuth = np.where(slope >= FLAT_SLOPE_DEG, np.degrees(np.arctan2(x, y)) % 360.0, np.nan)
    return slope, azimuth


def find_base_height(solid: Solid) -> float:
    """Return the lowest height of the ground surface, of the solid where none is marked."""
    ground = [index for face in solid.select_faces(GROUND) for ring in face.rings for index in ring]
    return float(solid.vertices[ground or slice(None), 2].min())


class RoofEdges(NamedTuple):
    """The roof's directed edges.

    Each has the height of its middle (m,), its length in plan, a number that is the same for both
    directions, whether it is level, and whether the face left of it falls away from it. `face` is
    the number of that, `plan_m2` its area in plan.
    """

    height: np.ndarray
    length: np.ndarray
    number: np.ndarray
    is_level: np.ndarray
    falls_away: np.ndarray
    face: np.ndarray
    plan_m2: np.ndarray


def roof_edges(
    edges: np.ndarray, ends: np.ndarray, area: np.ndarray, face: np.ndarray
) -> RoofEdges:
    """Return the roof's edges from `edges` (m, 2, 3), start and end.

    `ends` (m, 2) are their vertex indices, `face` (m,) their faces' numbers and `area` (m, 3) their
    vector areas. A face lies left of its edges and falls along its vector area's plan direction, so
    it falls away from an edge when that direction points left.
    """
    start, end = edges[:, 0], edges[:, 1]
    x, y, rise = (end - start).T
    first, last = ends.T
    falls = area[:, 1] * x - area[:, 0] * y > 1e-9
    return RoofEdges(
        (start[:, 2] + end[:, 2]) / 2,
        # rounding to the millimetre keeps a choice among edges of one length, or half of all, from
        # hanging on the last bit
        np.round(np.hypot(x, y), 3),
        np.minimum(first, last) * (int(ends.max()) + 1) + np.maximum(first, last),
        np.abs(rise) < LEVEL_RIDGE_M,
        falls & (np.hypot(area[:, 0], area[:, 1]) > STEEP * area[:, 2]),
        face,
        area[:, 2],
    )


def find_ridge_height(edges: RoofEdges) -> float:
    """Return the height of the longest level ridge, NaN if there is none."""
    usable = np.flatnonzero(edges.falls_away & edges.is_level)
    key = edges.number[usable]
    order = np.argsort(key, kind="stable")
    twice = order[:-1][key[order[1:]] == key[order[:-1]]]
    if not len(twice):
        return float("nan")
    ridges = usable[twice]
    height = edges.height[ridges]
    return float(height[np.lexsort((height, edges.length[ridges]))[-1]])


def find_eave_height(edges: RoofEdges) -> float:
    """Return the height below which the eaves of half of the roof's area lie.

    Eaves are level edges of one roof face alone that does not fall away from them; of a roof
    without one, all its outer edges. Those of a face share its area by their length: a low annex
    has long ones, all around.
    """
    _, number, counts = np.unique(edges.number, return_inverse=True, return_counts=True)
    outer = counts[number] == 1
    eaves = outer & edges.is_level & ~edges.falls_away
    selection = eaves if eaves.any() else outer
    length, face = edges.length[selection], edges.face[selection]
    share = length / np.maximum(np.bincount(face, length)[face], 1e-9)
    # nor does the order hang on it
    height, weight = np.round(edges.height[selection], 4), share * edges.plan_m2[selection]
    order = np.argsort(height, kind="stable")
    return float(
        height[order][np.searchsorted(np.cumsum(weight[order]), 0.5 * weight.sum() - 1e-6)]
    )


def measure_area_below(level: float, z: np.ndarray, plan: np.ndarray) -> float:
    """Return the plan area at or below `level` of triangles, `z` (t, 3), `plan` (t,)."""
    low, middle, high = z.T
    lower, upper = np.maximum(middle - low, 1e-12), np.maximum(high - middle, 1e-12)
    rising = np.clip(level - low, 0.0, lower) ** 2 / lower
    falling = upper - np.clip(high - level, 0.0, upper) ** 2 / upper
    share = np.where(
        high - low < LEVEL_TRIANGLE_M, low <= level, (rising + falling) / (lower + upper)
    )
    return float((plan * share).sum())


def find_level(share: float, z: np.ndarray, plan: np.ndarray) -> float:
    """Return the level below which `share` of the roof's plan area lies.

    Between corner heights the area below a level is quadratic in the level, at the height of a
    level triangle it jumps: both are solved exactly.
    """
    target = share * plan.sum()
    # so that rounding does not decide where the share ends just at a level part
    is_enough = target * (1 - 1e-12)
    knots = np.unique(z).tolist()
    first = bisect_left(knots, is_enough, key=lambda knot: measure_area_below(knot, z, plan))
    if first == 0:
        return knots[0]
    count, upper = first - 1, min(first, len(knots) - 1)
    span = knots[upper] - knots[count]
    start = measure_area_below(knots[count], z, plan)
    middle = measure_area_below(knots[count] + 0.5 * span, z, plan)
    is_below = z[:, 0] < knots[upper]  # just below that knot: no triangle lies level in it
    end = measure_area_below(knots[upper], z[is_below], plan[is_below])
    if end < is_enough:
        return knots[upper]
    curvature = 2 * (start + end - 2 * middle)
    linear, missing = end - start - curvature, target - start
    t = 2 * missing / (linear + np.sqrt(max(linear**2 + 4 * curvature * missing, 0.0)))
    return knots[count] + min(t, 1.0) * span
