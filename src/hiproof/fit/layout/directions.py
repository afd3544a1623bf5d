"""Find the directions in which volumes of a building may lie."""

from __future__ import annotations

import math

import numpy as np
import shapely

from ...frames import PlanFrame
from ..direction import measure_support, quarter_gap

# Most directions along walls that volumes of a building may follow, the main one first.
MOST_WALL_DIRECTIONS = 2
APART_RAD = math.radians(7.0)  # Directions differ by more (rad).
NEAR_RAD = math.radians(3.0)  # Edges within this angle (rad) support a direction.
LEAST_SUPPORT_M = 4.0  # Least length (m) of edges for a further direction.
LEAST_SUPPORT_SHARE = 0.06  # Least share of the outline's edges for a further direction.


def find_directions(outline: shapely.Polygon, frame: PlanFrame) -> list[float]:
    """Find the angles (rad) of the building's directions from the plan's own.

    They are those of the outline's edges, and the plan's own comes first. Between two of them comes
    a third: where a house bends, its wings end on one line, square to neither, and their planes
    lean to either side from there.
    """
    step = np.diff(shapely.get_coordinates(outline.exterior), axis=0) @ frame.rotation.T
    length, angle = (
        np.hypot(step[:, 0], step[:, 1]),
        np.arctan2(step[:, 1], step[:, 0]) % (math.pi / 2),
    )
    directions = [0.0]
    while len(directions) < MOST_WALL_DIRECTIONS:
        new = np.all(
            [np.abs(quarter_gap(angle - other)) > APART_RAD for other in directions], axis=0
        )
        if not new.any():
            break
        support = measure_support(angle[new], angle, length, NEAR_RAD)
        best = int(np.argmax(support))
        if support[best] < max(LEAST_SUPPORT_M, LEAST_SUPPORT_SHARE * length.sum()):
            break
        directions.append(float(angle[new][best]))
    return (
        [*directions, 0.5 * float(quarter_gap(np.array(directions[1])))]
        if len(directions) == 2
        else directions
    )
