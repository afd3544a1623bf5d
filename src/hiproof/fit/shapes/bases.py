"""Lay one level part under and around a curved shape, such as the top of a tower.

What the search leaves of a tower's top are strips beside the shape. Where its eave lies lower than
they do, a moat would surround it.
"""

from __future__ import annotations

import numpy as np
import shapely

from ...geometry.rings import OVERLAY_GRID_M
from .drums import is_at_level
from .judged import JudgedRoof, make_flat, measure_gain, measure_slope, scale_cap
from .regions import exclude_parts, list_polygons, unite_outlines


def lay_base(roof: JudgedRoof) -> JudgedRoof:
    """Return the roof with a level part under its last, if points lie as near then.

    It replaces the level parts beside the shape that are as high as the largest of them.
    """
    *others, shape = roof.parts
    plan, xy = unite_outlines([shape]), roof.points[:, :2]
    beside = [
        part
        for part in others
        if part.type == "flat" and shapely.dwithin(unite_outlines([part]), plan, OVERLAY_GRID_M)
    ]
    if not beside:
        return roof
    level = float(max(beside, key=lambda part: part.area).translation[2])
    group = [part for part in beside if is_at_level(part, level)]
    is_in_group = np.array([any(part is one for one in group) for part in roof.parts])
    is_on_group = is_in_group[roof.highest[1]]
    if not is_on_group.any() or (len(group) == 1 and level <= shape.translation[2]):
        return roof
    area = unite_outlines([*group, shape])
    base = make_flat(list_polygons(area), shape, roof.points[is_on_group, 2])
    new = JudgedRoof([*exclude_parts(others, group), base, shape], roof.points, roof.outline)
    judged = shapely.contains_xy(area, *xy.T)
    gain = measure_gain(roof, new, judged, scale_cap(measure_slope(shape)))
    return new if gain > 0.0 else roof
