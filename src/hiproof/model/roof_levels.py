"""Levels below which a share of a roof lies. Compiled.

Exact areas of its triangles below a level are searched.
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled
from ..geometry.arrays import list_distinct

LEVEL_TRIANGLE_M = 1e-9  # a triangle whose corners differ in height by less is level


@compiled
def measure_area_below(level: float, z: np.ndarray, plan: np.ndarray) -> float:
    """Return the plan area of triangles at or below `level`.

    They have sorted heights `z` (t, 3) and signed plan areas `plan` (t,).
    """
    area = 0.0
    for t in range(len(z)):
        low_value, middle, high_value = z[t, 0], z[t, 1], z[t, 2]
        if high_value - low_value < LEVEL_TRIANGLE_M:
            area += plan[t] if low_value <= level else 0.0
            continue
        lower, upper = max(middle - low_value, 1e-12), max(high_value - middle, 1e-12)
        rising = min(max(level - low_value, 0.0), lower) ** 2 / lower
        falling = upper - min(max(high_value - level, 0.0), upper) ** 2 / upper
        area += plan[t] * (rising + falling) / (lower + upper)
    return area


@compiled
def find_level(share: float, z: np.ndarray, plan: np.ndarray) -> float:
    """Return the level below which `share` of the roof's plan area lies.

    Between corner heights the area below a level is quadratic in the level, at the height of a
    level triangle it jumps: both are solved exactly.
    """
    target = share * plan.sum()
    # so that rounding does not decide where the share ends just at a level part
    is_enough = target * (1 - 1e-12)
    knots = list_distinct(z.ravel())
    count, upper = 0, len(knots) - 1
    if measure_area_below(knots[count], z, plan) >= is_enough:
        return knots[count]
    while upper - count > 1:
        between = (count + upper) // 2
        if measure_area_below(knots[between], z, plan) >= is_enough:
            upper = between
        else:
            count = between
    span = knots[upper] - knots[count]
    start = measure_area_below(knots[count], z, plan)
    middle = measure_area_below(knots[count] + 0.5 * span, z, plan)
    end = 0.0  # just below the upper knot, so without the triangles that lie level in it
    for t in range(len(z)):
        if z[t, 0] < knots[upper]:
            end += measure_area_below(knots[upper], z[t : t + 1], plan[t : t + 1])
    if end < is_enough:
        return knots[upper]
    curvature = 2 * (start + end - 2 * middle)
    linear, missing = end - start - curvature, target - start
    t = 2 * missing / (linear + np.sqrt(max(linear**2 + 4 * curvature * missing, 0.0)))
    return knots[count] + min(t, 1.0) * span
