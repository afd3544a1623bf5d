"""Levels below which a share of a roof lies, compiled: exact areas of its triangles below a level,
and a search.
"""

from __future__ import annotations

import numpy as np

from ..compiled import compiled

LEVEL_TRIANGLE_M = 1e-9  # a triangle whose corners differ in height by less is level


@compiled
def area_below(level, z, plan):
    """Plan area of the triangles with sorted heights `z` (t, 3) and signed plan areas `plan` (t,)
    at or below `level`.
    """
    area = 0.0
    for t in range(len(z)):
        low, middle, high = z[t, 0], z[t, 1], z[t, 2]
        if high - low < LEVEL_TRIANGLE_M:
            area += plan[t] if low <= level else 0.0
            continue
        lower, upper = max(middle - low, 1e-12), max(high - middle, 1e-12)
        rising = min(max(level - low, 0.0), lower) ** 2 / lower
        falling = upper - min(max(high - level, 0.0), upper) ** 2 / upper
        area += plan[t] * (rising + falling) / (lower + upper)
    return area


@compiled
def level_of_share(share, z, plan):
    """The level that `share` of the roof's plan area lies below; triangles as in `area_below`.

    Between corner heights the area below a level is quadratic in the level, at the height of a
    level triangle it jumps: both are solved exactly.
    """
    target = share * plan.sum()
    # so that rounding does not decide where the share ends just at a level part
    enough = target * (1 - 1e-12)
    knots = np.unique(z.ravel())
    low, high = 0, len(knots) - 1
    if area_below(knots[low], z, plan) >= enough:
        return knots[low]
    while high - low > 1:
        between = (low + high) // 2
        if area_below(knots[between], z, plan) >= enough:
            high = between
        else:
            low = between
    span = knots[high] - knots[low]
    start, middle = area_below(knots[low], z, plan), area_below(knots[low] + 0.5 * span, z, plan)
    end = 0.0  # just below the upper knot, so without the triangles that lie level in it
    for t in range(len(z)):
        if z[t, 0] < knots[high]:
            end += area_below(knots[high], z[t : t + 1], plan[t : t + 1])
    if end < enough:
        return knots[high]
    curvature = 2 * (start + end - 2 * middle)
    linear, missing = end - start - curvature, target - start
    t = 2 * missing / (linear + np.sqrt(max(linear**2 + 4 * curvature * missing, 0.0)))
    return knots[low] + min(t, 1.0) * span
