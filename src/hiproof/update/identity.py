"""Which earlier building each of new footprints is.

Outlines that overlap are linked. A pair that is linked to nothing else is one building, which keeps
its id, and so is a pair of nearly the same outline. Of the others, some were split, some merged:
new buildings with predecessors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from ..geometry.components import label_components

LINKED_SHARE, LINKED_M2 = 0.1, 2.0
"""Share of the smaller outline, and area (m2), that two have in common where they are linked.
Neighbours overlap by less, as footprints of two sources are drawn."""

PAIR_SHARE = 0.7
"""Intersection over union from which on two among several on both sides are one building."""

SAME_OUTLINE = 0.9
"""Intersection over union from which on an outline was drawn again rather than changed."""

SHARE_DIGITS = 6  # of these shares: the last bits decide nothing


@dataclass(frozen=True)
class Successor:
    """What a new footprint is.

    It is one earlier building, or the successor of some, or a new one. `earlier` is the number of
    the earlier building, -1 for none. `is_same_outline` says whether the earlier outline stands.
    `predecessors` are numbers of earlier buildings that were split or merged.
    """

    earlier: int = -1
    is_same_outline: bool = False
    predecessors: tuple[int, ...] = ()


def match_outlines(old: list[shapely.Polygon], new: list[shapely.Polygon]) -> list[Successor]:
    """Return what each of the `new` outlines is."""
    links, shares = link_outlines(old, new)
    labels = label_components(len(old) + len(new), np.stack([links[0], links[1] + len(old)]))
    members_old = group_members(labels[: len(old)])
    members_new = group_members(labels[len(old) :])
    share_of = {(int(i), int(j)): float(s) for i, j, s in zip(*links, shares, strict=True)}
    result = [Successor()] * len(new)
    for label, after in members_new.items():
        before = members_old.get(label, [])
        for j, successor in zip(after, match_group(before, after, share_of), strict=True):
            result[j] = successor
    return result


def link_outlines(
    old: list[shapely.Polygon], new: list[shapely.Polygon]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the links (2, k) of old and new outlines, and their overlaps (k,).

    An overlap is an intersection over union.
    """
    first, second = np.array(old, object), np.array(new, object)
    j, i = shapely.STRtree(first).query(second, predicate="intersects")
    common = shapely.area(shapely.intersection(first[i], second[j]))
    areas = shapely.area(first)[i], shapely.area(second)[j]
    linked = (common >= LINKED_SHARE * np.minimum(*areas)) & (common >= LINKED_M2)
    shares = np.round(common / np.maximum(areas[0] + areas[1] - common, 1e-9), SHARE_DIGITS)
    order = np.lexsort([j[linked], i[linked]])
    return np.stack([i[linked][order], j[linked][order]]), shares[linked][order]


def compute_overlap(first: shapely.Geometry, second: shapely.Geometry) -> float:
    """Return the intersection over union of two outlines."""
    common = shapely.intersection(first, second).area
    return float(common / max(first.area + second.area - common, 1e-9))


def group_members(labels: np.ndarray) -> dict[int, list[int]]:
    """Return the members of each component."""
    result: dict[int, list[int]] = {}
    for member, label in enumerate(labels.tolist()):
        result.setdefault(label, []).append(member)
    return result


def match_group(
    before: list[int], after: list[int], share_of: dict[tuple[int, int], float]
) -> list[Successor]:
    """Return what each outline `after` is, among the linked ones `before`."""
    pairs: dict[int, int] = {}
    if len(before) == len(after) == 1:
        pairs[after[0]] = before[0]
    else:
        least = PAIR_SHARE if min(len(before), len(after)) > 1 else SAME_OUTLINE
        ranked = sorted((-share_of.get((i, j), 0.0), i, j) for i in before for j in after)
        for share, i, j in ranked:
            if -share >= least and j not in pairs and i not in pairs.values():
                pairs[j] = i
    result = []
    for j in after:
        if j in pairs:
            is_same = share_of.get((pairs[j], j), 0.0) >= SAME_OUTLINE
            result.append(Successor(pairs[j], is_same))
        else:
            taken = set(pairs.values())
            others = (i for i in before if (i, j) in share_of and i not in taken)
            result.append(Successor(predecessors=tuple(others)))
    return result
