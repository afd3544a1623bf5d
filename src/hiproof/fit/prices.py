"""The table of prices: what a roof costs, in points and in units of structure.

    misfit of every point and unobserved cell
    + unit * (volumes + unknowns + corners + metres of low steps)

A unit is as many points as it must explain. Nothing but this table decides between two roofs.
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
VOLUME_UNITS = 0.25  # A visible volume.
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

# Where a side of a new volume begins: along no line of the outline, between two of its
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


KIND_COST = np.array([1.0, 1.4, 1.4, 1.9])
"""A plane among the candidates: level, sloping along u, along v, and freely."""
