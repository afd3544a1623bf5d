"""Parts of the new roof that continue parts of the earlier one.

A part continues another where both take the same place and have nearly the same planes there. It
keeps that part's number where it can: parts that continue others come first, in the earlier order.
"""

from __future__ import annotations

import numpy as np

from ..model import Building, Roof
from ..model.heights import find_highest
from ..parametric.building import build
from ..write.parameters import building_record

PART_GRID_M = 0.5  # of the places where parts are compared

SAME_PLACE = 0.5
"""Intersection over union of the places of two parts from which on one continues the other."""


def continue_parts(old: Building, new: Building) -> tuple[Building, list[int | None]]:
    """Return the new building with its parts in the earlier order.

    The numbers of the parts that they continue come with it, None for new parts.
    """
    pairs = match_parts(old, new)
    order = sorted(range(len(new.parts)), key=lambda k: (k not in pairs, pairs.get(k, k), k))
    lineage = [pairs.get(k) for k in order]
    if order == list(range(len(order))):
        return new, lineage
    record = building_record(new)
    record["parts"] = [record["parts"][k] for k in order]
    return build(record, new.model.compose), lineage


def match_parts(old: Building, new: Building) -> dict[int, int]:
    """Return the earlier part that each new part continues, where one does.

    Both have to show at the same places of a grid. Pairs of the largest overlap go first, and every
    part is taken once.
    """
    x0, y0, x1, y1 = old.roof.outline.bounds
    x, y = np.meshgrid(np.arange(x0, x1, PART_GRID_M), np.arange(y0, y1, PART_GRID_M))
    xy = np.column_stack([x.ravel(), y.ravel()])
    shift = old.roof.frame.origin - new.roof.frame.origin
    before, after = show_parts(old.roof, xy), show_parts(new.roof, xy + shift[:2])
    pairs, counts = np.unique(np.column_stack([after, before]), axis=0, return_counts=True)
    scores: list[tuple[float, int, int]] = []
    for (k, j), common in zip(pairs.tolist(), counts.tolist(), strict=True):
        share = common / ((after == k).sum() + (before == j).sum() - common)
        if min(k, j) >= 0 and share >= SAME_PLACE:
            scores.append((-round(float(share), 6), k, j))
    result: dict[int, int] = {}
    for _, k, j in sorted(scores):
        if k not in result and j not in result.values():
            result[k] = j
    return result


def show_parts(roof: Roof, xy: np.ndarray) -> np.ndarray:
    """Return the part (n,) that shows at `xy` (n, 2), -1 beside the roof."""
    heights, top = find_highest(roof.parts, np.ascontiguousarray(xy))
    return np.where(np.isfinite(heights), top, -1)
