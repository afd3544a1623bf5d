"""Chimneys and other objects on a roof, found by the points above it.

Points at least half a metre above all of the roof around them are grouped in plan. A group is an
object if it is small, stands on the roof and has a top: leaves and wires have none.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely
from scipy.spatial import cKDTree

from ..compose.settle import round_number
from ..geometry.components import label_components
from ..model import Installation, Part, Roof
from ..model.heights import find_highest
from ..model.installation import CHIMNEY, ROOF_OBJECT

LEAST_OBJECT_RISE_M = 0.5  # above the roof; less is a gutter, a panel or a fault of the roof
FEWEST_OBJECT_POINTS = 4  # fewer are birds and noise
BESIDE_OBJECT_M = 0.3  # around a point, the roof has to be lower: nearer ones lie on a wall
# Between points of one object: metres, or spacings of points if they are more.
OBJECT_GAP_M, OBJECT_GAP_SPACINGS = 0.75, 1.5
MOST_OBJECT_RISE_M, MOST_OBJECT_SIDE_M = 5.0, 6.0  # larger ones are parts of the roof, or trees
MOST_OBJECT_RATIO = 5.0  # of an object's sides; a thinner one is a wall that the roof lacks
OBJECT_TOP_M, OBJECT_TOP_SHARE = 0.4, 0.5  # how much of an object's points lie so near its top
LEAST_OBJECT_SIDE_M = 0.3  # of an object; no smaller one returns four points
OFF_NEIGHBOUR_M = 0.3  # from the outline to an object's middle; nearer is a neighbour's wall
CHIMNEY_SIDES_M = (2.5, 1.3)  # longest and widest chimney; a terrace's stack is so long


def find_installations(roof: Roof, points: np.ndarray) -> tuple[Installation, ...]:
    """Return the objects on a `roof` that its `points` (n, 3) show, in its frame.

    They are in the order of their positions.
    """
    above = points[:, 2] - measure_surroundings(roof.parts, points[:, :2])
    high = points[np.isfinite(above) & (above >= LEAST_OBJECT_RISE_M)]
    if len(high) < FEWEST_OBJECT_POINTS:
        return ()
    spacing_m = math.sqrt(roof.outline.area / len(points))
    gap_m = max(OBJECT_GAP_M, OBJECT_GAP_SPACINGS * spacing_m)
    links = cKDTree(high[:, :2]).query_pairs(gap_m, output_type="ndarray").T
    labels = label_components(len(high), links)
    groups = (high[labels == number] for number in range(labels.max() + 1))
    found = [make_installation(roof, group) for group in groups if has_top(group)]
    return tuple(
        sorted((item for item in found if item is not None), key=lambda i: i.position.tolist())
    )


def measure_surroundings(parts: tuple[Part, ...], xy: np.ndarray) -> np.ndarray:
    """Return the greatest height (n,) of the roof around places (n, 2)."""
    angles = np.arange(8) * math.pi / 4
    offsets = BESIDE_OBJECT_M * np.column_stack([np.cos(angles), np.sin(angles)])
    around = [find_highest(parts, xy + offset)[0] for offset in (np.zeros(2), *offsets)]
    return np.max(around, axis=0)


def has_top(group: np.ndarray) -> bool:
    """Return whether enough points (n, 3) lie near the top of them."""
    top = np.quantile(group[:, 2], 0.9)
    return len(group) >= FEWEST_OBJECT_POINTS and bool(
        np.mean(group[:, 2] >= top - OBJECT_TOP_M) >= OBJECT_TOP_SHARE
    )


def make_installation(roof: Roof, group: np.ndarray) -> Installation | None:
    """Return the box around points (n, 3), None where it is none of an object.

    It is parallel to the part below. Of n points spread evenly over a length L, the first and the
    last are L (n - 1) / (n + 1) apart on average, so sides are longer than what the points span.
    """
    middle = group[:, :2].mean(axis=0)
    kappa = roof.parts[int(find_highest(roof.parts, middle[None])[1][0])].kappa
    axes = np.array([[math.cos(kappa), math.sin(kappa)], [-math.sin(kappa), math.cos(kappa)]])
    uv = group[:, :2] @ axes.T
    span = np.ptp(uv, axis=0)
    sides = np.maximum(span * (len(group) + 1) / (len(group) - 1), LEAST_OBJECT_SIDE_M)
    xy = 0.5 * (uv.min(axis=0) + uv.max(axis=0)) @ axes
    if sides[1] > sides[0]:
        sides, kappa = sides[::-1], kappa + 0.5 * math.pi
    box = Installation(
        ROOF_OBJECT, float(sides[0]), float(sides[1]), 0.0, kappa, np.array([*xy, 0.0])
    )
    base = find_base(roof, box)
    height = float(np.quantile(group[:, 2], 0.9)) - base
    edge = shapely.distance(shapely.Point(xy), shapely.boundary(roof.outline))
    is_inside = shapely.contains_xy(roof.outline, *xy) and edge >= OFF_NEIGHBOUR_M
    is_small = 0.0 < height <= MOST_OBJECT_RISE_M and sides[0] <= MOST_OBJECT_SIDE_M
    if not (is_inside and is_small and sides[0] <= MOST_OBJECT_RATIO * sides[1]):
        return None
    is_chimney = bool((sides <= CHIMNEY_SIDES_M).all())
    return round_installation(
        replace(
            box,
            type=CHIMNEY if is_chimney else ROOF_OBJECT,
            height=height,
            position=np.array([*xy, base]),
        )
    )


def find_base(roof: Roof, box: Installation) -> float:
    """Return the lowest height of the roof under a box's corners and middle."""
    c, s = math.cos(box.kappa), math.sin(box.kappa)
    corners = np.array([(0, 0), (-1, -1), (1, -1), (1, 1), (-1, 1)])
    offsets = corners * [0.5 * box.length, 0.5 * box.width] @ np.array([[c, s], [-s, c]])
    z = find_highest(roof.parts, box.position[:2] + offsets)[0]
    return float(z[np.isfinite(z)].min(initial=math.inf))


def round_installation(box: Installation) -> Installation:
    """Round an installation as it is written."""
    return Installation(
        box.type,
        round_number(box.length),
        round_number(box.width),
        round_number(box.height),
        math.radians(round_number(math.degrees(box.kappa))),
        np.array([round_number(value) for value in box.position]),
    )
