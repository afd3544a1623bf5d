"""Define the table of prices.

It has what a unit is, what structure costs, and what a change must gain. A roof costs its points'
misfit and units of evidence for its structure. Every decision of the search and after it compares
such costs, and all of them are here.
"""

from __future__ import annotations

import math

import numpy as np

# The unit: as many points as a unit of structure must explain.

COMMON_HOUSE_M2 = 60.0  # Larger roofs, up to LARGE_ROOF_M2, ask more of each volume.
LARGE_ROOF_M2 = 200.0
"""Area (m2) from which on the price of structure does not depend on a roof's size.

Larger roofs are searched block by block.
"""

LARGE_ROOF_POINTS = 1.77
"""Points that a unit of a large roof must explain at least, times those of a house.

Of many places some gain a point or two by chance. At 2 points/m2 The Hague draws too much for less.
"""

DENSE_CLOUD, DENSE_GROWTH = 8.0, 0.3
"""Density [points/m2] from which on a unit of a large roof explains a larger area, and its growth.

Residuals of neighbouring points are not independent, the less so the denser the cloud
(`benchmarks.hand_drawn`, with footprints: 83.0 to 84.1 % of edges).
"""

DETAIL_FACTOR = {"fine": 0.5, "full": 1.0, "main": 4.0}
"""Price of structure by detail: below a half every chimney is a part, above four even wings go."""


def compute_unit_points(density: float, area_m2: float, settings) -> float:
    """Compute the points that one unit of structure must explain.

    They are those of an area that grows with the roof's, and never too few.
    """
    large = area_m2 > LARGE_ROOF_M2
    dense = max(density / DENSE_CLOUD, 1.0) ** DENSE_GROWTH
    factor = dense if large else math.sqrt(max(area_m2 / COMMON_HOUSE_M2, 1.0))
    points = settings.evidence_points * (LARGE_ROOF_POINTS if large else 1.0)
    share = settings.evidence_area_m2 * factor
    return float(max(points, share * density)) * DETAIL_FACTOR[settings.detail]


# What structure costs, in units.

PART_COST, PARAMETER_COST = 1.0, 0.45  # a volume, and each of its offsets and its own slopes
REPLACING_COST, BASE_COST = 0.5, 0.95  # a volume that replaces others; a visible base
LOOSE_COST = 0.6  # an edge where neither a corner of the outline nor another volume has one
LEANING_COST = 0.1  # each plane that leans: the wall says how, but which wall is a choice

KIND_COST = np.array([1.0, 1.4, 1.4, 1.9])
"""A plane among the candidates: level, sloping along u, along v, and freely."""

# What a change must gain besides, in units.

FREE_UNITS, FREELY_UNITS = 1.5, 8.0  # a plane that faces no wall; a new volume with such a plane
REGROWN_UNITS = 0.5  # a roof grown anew: less is gained by cutting finer, too

# What a change may cost that a draughtsman would make, in units.

SLACK_UNITS = 0.02  # drawing a hidden edge in: what is hidden explains nothing

# How far above the best a change may begin and still become the best, in units.

BEGIN_UNITS, BEGIN_SHARE = 2.0, 0.01  # a move of one volume; besides, a share of the points
NEW_UNITS, NEW_MOVED_UNITS = 6.0, 1.0
"""A new volume, and one whose edges were moved once."""

# How much the points of a place must cost for a volume to be looked for.

ROOF_UNITS = 5.0  # of a roof that explains all but poorly

# How nearly two roofs must cost the same to be one, and before the last volume is fitted in.
SAME_UNITS, SAME_BEFORE_UNITS = 0.1, 2.0
