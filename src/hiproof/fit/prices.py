"""The table of prices: what a roof costs, in points and in units of structure.

    misfit of every point and unobserved cell
    + unit * (volumes + unknowns + corners + metres of low steps)

A unit is as many points as it must explain. Nothing but this table decides between two roofs. The
search compares roofs that are not drawn: it knows no corners and steps, and prices volumes higher
and loose edges in their place.
"""

from __future__ import annotations

import numpy as np

# The unit: as many points as a unit of structure must explain.

DENSE_CLOUD, DENSE_GROWTH = 8.0, 0.3
"""Density [points/m2] from which on a unit explains a larger area, and its growth.

Residuals of neighbouring points are not independent, the less so the denser the cloud
(`benchmarks.hand_drawn`, with footprints: 83.0 to 84.1 % of edges).
"""

DETAIL_FACTOR = {"fine": 0.5, "full": 1.0, "main": 4.0}
"""Price of structure by detail: below a half every chimney is a part, above four even wings go."""

# What a roof costs.

DEAD_M = 0.08  # Difference (m) that a person would leave out: it costs nothing.
VOLUME_UNITS = 0.5  # A visible volume.
UNKNOWN_UNITS = 0.45  # A height or a slope, however many planes share it.
SKEW_UNITS = 0.1  # A plane that is not square to the first of its volume, but nearly.
LEAN_UNITS = 1.0  # A line with a direction of its own.
CORNER_UNITS = 0.3  # A corner of the drawn roof, at any level.
LOW_STEP_UNITS = 0.23  # A metre of a step lower than half a metre.
NARROW_M = 1.0  # Nobody draws what is narrower (m).
SPAN_UNITS = 0.2  # A volume under all of the roof: what is hidden reaches no further than it must.
LACK_UNITS = 4.0  # A m2 that a volume lacks to be as wide: what its points would explain.
GIVEN_UNITS = 1.0  # The same between two lines of the outline.
NARROW_UNITS = 0.6  # A metre of a step beside a narrower strip, unless it runs along a wall.

# Where a side of a volume of the search begins: along no line of the outline, between two of its
# corners, each metre off.
LOOSE_UNITS, CHORD_UNITS, OFF_UNITS_A_METRE = 2.0, 0.3, 0.1


def compute_unit(density: float, settings) -> float:
    """Compute the points that one unit of structure must explain, at a density (points/m2).

    They are those of an area, and never too few. Residuals of neighbouring points are not
    independent, the less so the denser the cloud, so the area grows there. `settings` are those of
    [compound].
    """
    area_m2 = settings.evidence_area_m2 * max(density / DENSE_CLOUD, 1.0) ** DENSE_GROWTH
    points = max(settings.evidence_points, area_m2 * density)
    return float(points) * DETAIL_FACTOR[settings.detail]


# What structure costs in the search, which draws nothing, in units.

PART_COST = 1.0  # a volume, besides its offsets and slopes
REPLACING_COST, BASE_COST = 0.5, 0.95  # a volume that replaces others; a visible base
LOOSE_COST = 0.6  # an edge where neither a corner of the outline nor another volume has one

KIND_COST = np.array([1.0, 1.4, 1.4, 1.9])
"""A plane among the candidates: level, sloping along u, along v, and freely."""

# What a change must gain besides, in units.

FREE_UNITS, FREELY_UNITS = 1.5, 8.0  # a plane that faces no wall; a new volume with such a plane
REGROWN_UNITS = 0.5  # a roof grown anew: less is gained by cutting finer, too

# How far above the best a change may begin and still become the best, in units.

BEGIN_UNITS, BEGIN_SHARE = 2.0, 0.01  # a move of one volume; besides, a share of the points
NEW_UNITS, NEW_MOVED_UNITS = 6.0, 1.0
"""A new volume, and one whose edges were moved once."""

# How much the points of a place must cost for a volume to be looked for.

ROOF_UNITS = 5.0  # of a roof that explains all but poorly
