"""Add volumes where a roof leaves points unexplained.

Planes are found among these points, each with the rectangle in which it gains most, and volumes
nearby are copied. A new volume joins the others or replaces them. The one with which the roof is
cheapest is kept if the roof, improved, is cheaper than without.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..candidates.listing import find_best_rectangles, list_candidates
from ..candidates.volumes import DIRECTION, REPLACES, U0
from ..layout.scene import Scene, open_window
from ..layout.whole import Box, Whole
from ..misfit import compute_costs
from .accept import add_new, improve_new
from .copies import add_copy, list_copies
from .draft import Draft
from .draw import compute_heights
from .price import OVER_M, Site
from .start import add_volume
from .tables import VOLUME_COUNT, Tables

UNEXPLAINED = 0.98  # Share of the highest misfit from which on a point counts as unexplained.
FEWEST_UNEXPLAINED = 4  # Fewest unexplained points that are worth a further volume.
SQUARE_M = 3.0  # Size (m) of a square in which unexplained points are counted.
AROUND = 2  # Squares around one that count, too.
MOST_PLACES = 10  # Most places of a roof that are tried: a limit on time.
PLACE_UNITS = 4.0  # Units that the points must be worth that a place leaves unexplained.
WINDOW_M = 20.0  # Size (m) of a place's window.
TRIED = 4  # Candidates that join, that replace, and that are copies: those that gain most.
IMPROVED = 3  # Additions, the cheapest before their moves, that are improved until one saves.
ROWS = np.array([1, 16, 16])  # Most volumes, lines and unknowns that a new volume takes.


def add_at_places(draft: Draft, whole: Whole, most_points: int) -> np.ndarray:
    """Add volumes to a roof at each place where that saves.

    Returns which volumes (v,) of the roof then lie where any was added.
    """
    windows = []
    for box in list_places(draft.roof, draft.site):
        scene = open_window(whole, box, most_points)
        new = draft if scene is None else add_all(draft, scene, box)
        if new is not draft:
            windows.append(box)
            draft.roof, draft.known = new.roof, new.known
    (x0, x1, y0, y1), near = draft.roof.boxes.T, np.zeros(len(draft.roof.sides), np.bool_)
    for u0, u1, v0, v1 in windows:
        near |= (x0 < u1) & (x1 > u0) & (y0 < v1) & (y1 > v0)
    return near


def list_places(roof: Tables, site: Site) -> Iterator[Box]:
    """Yield windows on the places of a roof that leave most points unexplained, the most first."""
    x, y, z = (column[: site.n] for column in (site.x, site.y, site.z))
    is_far = np.abs(find_heights(roof, x, y) - z) > site.dead + site.width
    i = ((x - site.bounds[0]) / SQUARE_M).astype(int).clip(0)
    j = ((y - site.bounds[2]) / SQUARE_M).astype(int).clip(0)
    counts = np.zeros((i.max() + 1 + 2 * AROUND, j.max() + 1 + 2 * AROUND))
    np.add.at(counts, (i[is_far] + AROUND, j[is_far] + AROUND), 1.0)
    size, half = 2 * AROUND + 1, 0.5 * WINDOW_M
    for _ in range(MOST_PLACES):
        sums = np.lib.stride_tricks.sliding_window_view(counts, (size, size)).sum(axis=(2, 3))
        a, b = np.unravel_index(int(sums.argmax()), sums.shape)
        if sums[a, b] < PLACE_UNITS * site.unit:
            return
        u, v = site.bounds[0] + (a + 0.5) * SQUARE_M, site.bounds[2] + (b + 0.5) * SQUARE_M
        yield Box(u - half, u + half, v - half, v + half)
        counts[a : a + size, b : b + size] = 0.0


def add_all(draft: Draft, scene: Scene, box: Box) -> Draft:
    """Add volumes in a window as long as one saves. Returns the roof with them."""
    for better in add_each(draft, scene, box):
        draft = better
    return draft


def add_each(draft: Draft, scene: Scene, box: Box) -> Iterator[Draft]:
    """Yield the roof after each volume that is added in a window, as long as one saves."""
    better = add_best(draft, scene, box)
    while better is not None:
        yield better
        better = add_best(better, scene, box)


def add_best(draft: Draft, scene: Scene, box: Box) -> Draft | None:
    """Return a roof with one volume more in a window, None if none saves or there is no room."""
    roof = draft.roof
    if (roof.counts + ROWS > [len(roof.sides), len(roof.lines), len(roof.values)]).any():
        return None
    found = []
    for new, k in list_additions(draft, scene, box):
        new.known = add_new(roof, new.roof, new.site, new.drawing, new.known, k)
        found.append((new, k))
    for new, k in sorted(found, key=lambda addition: addition[0].price)[:IMPROVED]:
        new.known = improve_new(new.roof, new.trial, new.site, new.drawing, new.known, k)
        if new.price < draft.price - draft.least_gain:
            return new
    return None


def list_additions(draft: Draft, scene: Scene, box: Box) -> Iterator[tuple[Draft, int]]:
    """Yield roofs with one volume more in a window, and its number: a copy or a new one."""
    site = draft.site
    for source, x, y in list_copies(draft.roof, site, np.array(box), UNEXPLAINED)[:TRIED]:
        new = draft.copy()
        yield new, add_copy(new.roof, int(source), x, y)
    for volume in list_volumes(draft.roof, scene):
        new = draft.copy()
        yield new, add_volume(new.roof, volume, scene.turn, site, True)


def list_volumes(roof: Tables, scene: Scene) -> Iterator[np.ndarray]:
    """Yield volumes that may explain what a roof leaves."""
    z = find_heights(roof, scene.U[0], scene.V[0])
    costs = compute_costs(z, scene)
    unexplained = np.flatnonzero(costs[: scene.n] > UNEXPLAINED)
    if len(unexplained) < FEWEST_UNEXPLAINED:
        return
    candidates = list_candidates(scene, unexplained)
    for replaces in (False, True):
        gains, rectangles = find_best_rectangles(scene, candidates, costs, z, replaces)
        candidates[:, REPLACES] = replaces
        for m in np.argsort(-gains, kind="stable")[:TRIED].tolist():
            if gains[m] > 0.0:
                lines = scene.lines[int(candidates[m, DIRECTION])]
                for edge in range(4):
                    candidates[m, U0 + edge] = lines[edge // 2, rectangles[m, edge]]
                yield candidates[m]


def find_heights(roof: Tables, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the heights (n,) of a roof at places x, y (n,)."""
    heights, volumes = np.empty(len(x)), np.empty(len(x), np.int64)
    view = np.arange(roof.counts[VOLUME_COUNT])
    compute_heights(roof, view, x, y, OVER_M, heights, volumes)
    return heights
