"""Run a pass on groups of volumes of a large roof.

A pass over all volumes at once costs their number times all points. In a window around a few of
them it costs as much as on a house. What does not belong to the group returns as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import shapely

from .add import MOST_VOLUMES
from .box import Box, enclose_boxes
from .plan import Plan
from .scene import Scene
from .volumes import SETTLED
from .whole import POSITION, Whole
from .window import forget_digests, open_window, restore_volumes

GROUP = 8  # Most volumes of a group.
GROUP_MARGIN_M = 2.0  # Distance (m) around a group that its window shows.
GROUP_POINTS = 6000  # Most points of a group's window.

# A change of volumes in a scene. It leaves fixed ones as they are.
Pass = Callable[[np.ndarray, Scene], np.ndarray]


def run_in_groups(
    change: Pass, volumes: np.ndarray, scene: Scene, plan: Plan, outline: shapely.Polygon
) -> np.ndarray:
    """Let a pass change the volumes: all at once if they are few, else group by group."""
    if len(volumes) <= MOST_VOLUMES:
        return change(volumes, scene)
    whole = Whole(scene, plan, outline, volumes)
    for places in [
        [whole.volumes[k, POSITION].tobytes() for k in group] for group in group_volumes(whole)
    ]:
        group = [k for k in map(whole.find, places) if k is not None]
        view = open_group(whole, group) if group else None
        if view is None:
            continue
        window, numbers = view
        rows, unmoved = whole.volumes[numbers], [k for k in numbers[1:] if k not in group]
        rows[np.isin(numbers, [0, *unmoved]), SETTLED] = np.inf
        new_rows = restore_volumes(change(rows, window).copy(), whole.volumes, unmoved)
        whole.replace(numbers[1:], new_rows[1:])
    return forget_digests(whole.volumes)


def group_volumes(whole: Whole) -> list[list[int]]:
    """Group the numbers of all volumes but the base: halved along the longer axis."""
    if len(whole.volumes) < 2:
        return []
    shows = whole.boxes[:, 0] <= whole.boxes[:, 1]
    shows[0] = False
    boxes = np.where(shows[:, None], whole.boxes, 0.0)  # EMPTY_BOX has no middle
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


def frame_group(whole: Whole, group: Sequence[int]) -> Box:
    return enclose_boxes(Box(*whole.boxes[k]) for k in group).widen(GROUP_MARGIN_M)


def open_group(whole: Whole, group: Sequence[int]) -> tuple[Scene, list[int]] | None:
    """Return the scene around a group, and the numbers of the volumes in it.

    The base is among them.
    """
    box = frame_group(whole, group)
    scene = open_window(whole, box, GROUP_POINTS)
    return None if scene is None else (scene, [0, *whole.list_volumes(box)])
