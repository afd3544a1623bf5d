"""Passes after the search on a large roof: on some neighbouring volumes after others, seen with what lies around them.

A pass over all volumes at once costs their number times all points. In a window around a few of them it costs what a
house costs. What does not belong to the group returns as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from .agree import Agreement, agreed, hide_again
from .box import Box, box_around
from .cants import Known
from .finish import Planes, found_planes
from .regions import Site
from .scene import Scene
from .sides import Side
from .unite import Drawn, Ends, drawn, ends_within
from .volumes import U0, V1
from .whole import PLACE, Whole
from .window import forget_settled, open_window, restore

MOST_AT_ONCE = 24  # volumes that are looked at all at once, as those of a house
GROUP = 8  # volumes of a group at most
AROUND_M = 2.0  # m around a group that its window shows
WINDOW_POINTS = 6000  # of a group's window at most

# Volumes, what is seen of them, and the numbers of those that may change (None: all): the volumes changed.
Pass = Callable[[np.ndarray, Scene, list[int] | None], np.ndarray]


def run_in_groups(change: Pass, volumes: np.ndarray, site: Site) -> np.ndarray:
    """Let a pass change the volumes: all at once where they are few, else group by group."""
    if len(volumes) <= MOST_AT_ONCE:
        return change(volumes, site.scene, None)
    whole = Whole(site.scene, site.plan, site.outline, volumes)
    for places in [[whole.volumes[k, PLACE].tobytes() for k in group] for group in groups_of(whole)]:
        group = [k for k in map(whole.find, places) if k is not None]
        seen = look_at(whole, group) if group else None
        if seen is None:
            continue
        scene, numbers = seen
        found = change(whole.volumes[numbers].copy(), scene, group)
        others = [k for k in numbers[1:] if k not in group]
        found = restore(found.copy(), whole.volumes, others)
        whole.replace(numbers[1:], found[1:])
    return forget_settled(whole.volumes)


def groups_of(whole: Whole) -> list[list[int]]:
    """The numbers of all volumes but the base in groups of neighbours: halved along the longer axis until small."""
    if len(whole.volumes) < 2:
        return []
    shows = whole.boxes[:, 0] <= whole.boxes[:, 1]
    shows[0] = False
    boxes = np.where(shows[:, None], whole.boxes, 0.0)  # NOWHERE has no middle
    middles = 0.5 * (boxes[:, [0, 2]] + boxes[:, [1, 3]])
    return list(halve(np.flatnonzero(shows), middles))


def halve(numbers: np.ndarray, middles: np.ndarray) -> Iterator[list[int]]:
    if len(numbers) <= GROUP:
        yield numbers.tolist()
        return
    axis = int(np.argmax(np.ptp(middles[numbers], axis=0)))
    order = numbers[np.argsort(middles[numbers, axis], kind="stable")]
    yield from halve(order[: len(order) // 2], middles)
    yield from halve(order[len(order) // 2 :], middles)


def window_of(whole: Whole, group: Sequence[int]) -> Box:
    return box_around(Box(*whole.boxes[k]) for k in group).widen(AROUND_M)


def look_at(whole: Whole, group: Sequence[int]) -> tuple[Scene, list[int]] | None:
    """The scene around a group, and the numbers of the base and of all volumes that reach into it."""
    box = window_of(whole, group)
    scene = open_window(whole, box, WINDOW_POINTS)
    return None if scene is None else (scene, [0, *whole.volumes_in(box)])


def draw_in_groups(volumes: np.ndarray, ends: Ends, site: Site, known: Known) -> tuple[Drawn, Agreement]:
    """The volumes with their sides and planes, and those that agree with their neighbours equal to these.

    Planes `known` of volumes seen all at once are not fitted again. Of volumes that are not looked at
    all at once no common unknowns are known: their agreement has no members.
    """
    if len(volumes) <= MOST_AT_ONCE:
        roof = drawn(volumes, ends, site.scene, known)
        planes = hide_again(volumes, roof.planes, site.scene)
        agreement = agreed(volumes, roof.sides, planes, site.scene)
        return replace(roof, planes=agreement.planes), agreement
    whole = Whole(site.scene, site.plan, site.outline, volumes)
    sides = [[Side(float(x)) for x in row[U0 : V1 + 1]] for row in volumes]
    planes = [found_planes(row, whole.scene) for row in volumes]
    for group in groups_of(whole):
        seen = look_at(whole, group)
        if seen is None:
            continue
        scene, numbers = seen
        rows = whole.volumes[numbers]
        roof = drawn(rows, ends_within(ends, scene), scene, {})
        held = [own if k in group else hold(own) for k, own in zip(numbers, roof.planes, strict=True)]
        together = agreed(rows, roof.sides, held, scene).planes
        for k in group:
            at = numbers.index(k)
            sides[k], planes[k] = roof.sides[at], together[at]
    planes = hide_again(volumes, planes, site.scene)
    agreement = Agreement(planes, {}, np.zeros((0, 0)), np.zeros(0))
    return Drawn(volumes, sides, planes, sum(own.cost + own.price for own in planes)), agreement


def hold(planes: Planes) -> Planes:
    """The planes without unknowns: others do not change them."""
    return replace(planes, design=np.zeros((*planes.design.shape[:2], 0)), covariance=np.zeros((0, 0)))
