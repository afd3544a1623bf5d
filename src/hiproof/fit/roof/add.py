"""Add volumes where a roof leaves points unexplained.

The search takes some of the points of a large or dense roof. Where many are unexplained, planes
are found again among these, each with the rectangle in which it gains most, and volumes nearby are
copied. A new volume joins the others or replaces them. It is kept if the roof with it, improved, is
cheaper.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..union.add import FEWEST_UNEXPLAINED, UNEXPLAINED
from ..union.candidates import (
    MOST_NEW_PLANES,
    find_best_rectangles,
    list_candidates,
)
from ..union.grow import prepare_growth
from ..union.objective import compute_costs
from ..union.scene import Scene, open_window
from ..union.search import BLOCK_POINTS
from ..union.volumes import DIRECTION, REPLACES, U0
from ..union.whole import Box, Whole
from .accept import LEAST_UNITS, improve_new
from .copies import add_copy, list_copies
from .draw import Drawing, compute_heights
from .price import OVER_M, Known, Site, know, price_known
from .start import add_volume, put_on_walls
from .tables import VOLUME_COUNT, Tables, copy_tables, make_tables_like

SQUARE_M = 3.0  # Size (m) of a square in which unexplained points are counted.
AROUND = 2  # Squares around one that count, too.
MOST_PLACES = 10  # Most places of a roof that are tried: a limit on time.
PLACE_UNITS = 4.0  # Units that the points must be worth that a place leaves unexplained.
WINDOW_M = 20.0  # Size (m) of a place's window.
TRIED = 2  # Candidates that join, and that replace, those that gain most.
ROWS = np.array([1, 16, 16])  # Most volumes, lines and unknowns that a new volume takes.


def add_volumes(
    roof: Tables, trial: Tables, site: Site, drawing: Drawing, whole: Whole
) -> np.ndarray:
    """Add volumes to a roof at each place where that saves.

    Returns which volumes (v,) of the roof then lie where any was added.
    """
    known, windows = know(roof, drawing, site), []
    for box in list_places(roof, site):
        scene, start, last = open_window(whole, box, BLOCK_POINTS), known, None
        while scene is not None and known is not last:
            last, known = known, add_best(roof, trial, site, drawing, scene, box, known)
        if known is not start:
            windows.append(box)
    (x0, x1, y0, y1), near = roof.boxes.T, np.zeros(len(roof.sides), np.bool_)
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


def add_best(
    roof: Tables, trial: Tables, site: Site, drawing: Drawing, scene: Scene, box: Box, known: Known
) -> Known:
    """Add the volume that saves most in a window to a roof. Returns what is then known of it."""
    if (roof.counts + ROWS > [len(roof.sides), len(roof.lines), len(roof.values)]).any():
        return known
    best, best_known, lowest = roof, known, price_known(known, site) - LEAST_UNITS * site.unit
    for new, k in list_additions(roof, site, scene, box):
        after = improve_new(roof, new, trial, site, drawing, known, k)
        if price_known(after, site) < lowest:
            best, best_known, lowest = new, after, price_known(after, site)
    if best is not roof:
        copy_tables(best, roof)
    return best_known


def list_additions(
    roof: Tables, site: Site, scene: Scene, box: Box
) -> Iterator[tuple[Tables, int]]:
    """Yield roofs with one volume more in a window, and its number: a copy or a new one."""
    for source, x, y in list_copies(roof, site, np.array(box), UNEXPLAINED)[:TRIED]:
        new = copy_roof(roof)
        yield new, add_copy(new, int(source), x, y)
    for volume in list_volumes(roof, scene):
        new = copy_roof(roof)
        k = add_volume(new, volume, scene.turn)
        put_on_walls(new, k, site, True)
        yield new, k


def copy_roof(roof: Tables) -> Tables:
    new = make_tables_like(roof)
    copy_tables(roof, new)
    return new


def list_volumes(roof: Tables, scene: Scene) -> Iterator[np.ndarray]:
    """Yield volumes that may explain what a roof leaves."""
    z = find_heights(roof, scene.U[0], scene.V[0])
    costs = compute_costs(z, scene)
    unexplained = np.flatnonzero(costs[: scene.n] > UNEXPLAINED)
    if len(unexplained) < FEWEST_UNEXPLAINED:
        return
    candidates = list_candidates(scene, unexplained, MOST_NEW_PLANES)
    ground = prepare_growth(scene, candidates)
    for replaces in (False, True):
        gains, rectangles = find_best_rectangles(
            scene, candidates, ground.cell_u, ground.cell_v, costs, z, replaces
        )
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
