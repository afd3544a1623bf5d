"""Compiled: where the points say that a volume ends.

On one side of a line points lie on a volume, on the other they do not. The line that tells most of
them apart is where it ends.
"""

from __future__ import annotations

import numpy as np

from ...compiled import compiled
from ..candidates.volumes import SLOPE_HIGH, SLOPE_LOW
from ..prices import LEAN_UNITS
from .tables import N_SIDES, find_lowest_plane, measure_middle

REACH_M = 2.5  # Distance (m) from a side within which it may lie instead.
FEWEST = 4  # Fewest points on either side of a line that points show.
MOST = 600  # Most points that are asked. Of more, every k-th is.
BIN_M = 0.02  # Width (m) of a bin of points.
LEANS = 12  # Ways to lean to either side.
PAIRS = 24  # Pairs of points through which a plane is tried.
LEAST_RUN_M = 0.4  # Least distance (m) between the points of a pair, across the side.
NO_SIDE = -1  # Of points that lie inside of all sides.
LEAN_STEP = 0.02  # Steps (rise over run) in which a line leans.


@compiled
def find_end(roof, k, s, site, leans):
    """Return a, b, c of the line along which side s of volume k tells most points apart.

    It may lean (`leans`). All are 0 where points do not say so clearly that it pays.
    """
    x, y, length = measure_middle(roof, k, s, site.bounds)
    if length == 0.0:
        return 0.0, 0.0, 0.0
    a, b, c = roof.half_planes[k, s]
    across, along, is_on, step = list_near(roof, k, s, x, y, site)
    count = len(is_on)
    n_on = is_on.sum()
    if n_on < FEWEST or count - n_on < FEWEST:
        return 0.0, 0.0, 0.0
    best, best_lean, best_end = 0, 0.0, 0.0
    for i in range(count):
        best += int(is_on[i] == (across[i] >= 0.0))
    best += int(LEAN_UNITS * site.unit / step) if leans else 0
    is_better, middle = False, 0.0
    for turn in range(2 * LEANS + 3 if leans else 1):
        lean = (turn + 1) // 2 * (LEAN_STEP if turn % 2 else -LEAN_STEP)
        if turn == 2 * LEANS + 1:
            middle = best_lean
        if turn > 2 * LEANS:  # at last, beside the best
            lean = middle + (0.5 if turn % 2 else -0.5) * LEAN_STEP
        places = across - lean * along
        if bound_right(places, is_on, n_on) <= best:
            continue
        order = np.argsort(places, kind="mergesort")
        right = n_on
        for i in range(count - 1):
            right += -1 if is_on[order[i]] else 1
            if right > best:
                best, best_lean, is_better = right, lean, True
                best_end = 0.5 * (places[order[i]] + places[order[i + 1]])
    if not is_better:
        return 0.0, 0.0, 0.0
    # across - lean * along = end, with along = b (x - x0) - a (y - y0) in plan
    d, e = a - best_lean * b, b + best_lean * a
    norm = np.sqrt(d * d + e * e)
    f = c - best_end + best_lean * (b * x - a * y)
    return d / norm, e / norm, f / norm


@compiled
def bound_right(places, is_on, n_on):
    """Return no fewer than the most points (n,) that an end tells apart, without sorting them."""
    low = places.min()
    steps = np.zeros((int((places.max() - low) / BIN_M) + 1, 2), np.int64)
    for i in range(len(places)):
        steps[int((places[i] - low) / BIN_M), int(is_on[i])] += 1
    right, most = n_on, n_on
    for b in range(len(steps)):
        most = max(most, right + steps[b, 0])
        right += steps[b, 0] - steps[b, 1]
    return most


@compiled
def list_near(roof, k, s, x, y, site):
    """List the points near side s of volume k and between its other sides.

    Returns their distances from the side and along it from x, y, whether they lie on the volume,
    and that each of them stands for so many.
    """
    numbers, half = list_between(roof, k, s, REACH_M, site), roof.half_planes[k, s]
    step = 1 + max(len(numbers) - 1, 0) // MOST
    numbers = numbers[::step]
    along = half[1] * (site.x[numbers] - x) - half[0] * (site.y[numbers] - y)
    is_on = np.abs(measure_gaps(roof, k, site, numbers)) < site.dead + site.width
    return measure_from(roof, k, s, site, numbers), along, is_on, step


@compiled
def list_between(roof, k, s, reach, site):
    """List the points inside the sides of volume k, and those so near (m) side s, if it has one."""
    box = roof.boxes[k]
    first = np.searchsorted(site.x[: site.n], box[0] - reach)
    last = np.searchsorted(site.x[: site.n], box[1] + reach)
    numbers, count = np.empty(last - first, np.int64), 0
    for i in range(first, last):
        is_inside = True
        for t in range(N_SIDES):
            half = roof.half_planes[k, t]
            distance = half[0] * site.x[i] + half[1] * site.y[i] + half[2]
            is_inside &= abs(distance) < reach if t == s else distance >= 0.0
        if is_inside:
            numbers[count] = i
            count += 1
    return numbers[:count]


@compiled
def measure_gaps(roof, k, site, numbers):
    """Return how far (m) points of such `numbers` (n,) lie above the planes of volume k."""
    gaps = np.empty(len(numbers))
    for m in range(len(numbers)):
        i = numbers[m]
        lowest, _ = find_lowest_plane(roof, k, site.x[i], site.y[i])
        gaps[m] = site.z[i] - lowest
    return gaps


@compiled
def list_inside(roof, k, site):
    """List the points inside the sides of volume k, and how far (m) each lies above its planes."""
    numbers = list_between(roof, k, NO_SIDE, 0.0, site)
    return numbers, measure_gaps(roof, k, site, numbers)


@compiled
def measure_from(roof, k, s, site, numbers):
    """Return the distances (n,) of the points of such `numbers` (n,) from side s of volume k."""
    half = roof.half_planes[k, s]
    return half[0] * site.x[numbers] + half[1] * site.y[numbers] + half[2]


@compiled
def find_plane(roof, k, s, height, site):
    """Return height and slope of a plane that rises from side s of volume k.

    Most points well below the volume lie on it. It rises from a given `height`, unless that is NaN.
    The slope is NaN if points show no plane.
    """
    reach, best_height, best_slope, most = site.dead + site.width, 0.0, np.nan, FEWEST - 1
    numbers, gaps = list_inside(roof, k, site)
    below = numbers[gaps < -reach]
    below = below[:: 1 + len(below) // MOST]
    n, distances, heights = len(below), measure_from(roof, k, s, site, below), site.z[below]
    order = np.argsort(distances, kind="mergesort")
    distances, heights = distances[order], heights[order]
    for pair in range(PAIRS if n >= FEWEST else 0):
        i = pair * n // PAIRS
        j = (i + n // 2 - pair % 3 * n // 6) % n
        run, rise = distances[j] - distances[i], heights[j] - heights[i]
        if not np.isnan(height):
            run, rise = distances[i], heights[i] - height
        if abs(run) < LEAST_RUN_M or not SLOPE_LOW < rise / run < SLOPE_HIGH:
            continue
        start = heights[i] - rise / run * distances[i]
        count = int(np.count_nonzero(np.abs(heights - start - rise / run * distances) < reach))
        if count > most:
            most, best_height, best_slope = count, start, rise / run
    return best_height, best_slope


@compiled
def find_split(roof, k, s, site):
    """Return how far from side s of volume k its points begin to lie higher or lower.

    Also returns how far (m) those beyond lie above its planes. The distance is 0 if hardly a point
    lies on the volume.
    """
    numbers, gaps = list_inside(roof, k, site)
    is_on = np.abs(gaps) < 2.0 * (site.dead + site.width)
    n = np.count_nonzero(is_on)
    if n < 2 * FEWEST:
        return 0.0, 0.0
    distances = measure_from(roof, k, s, site, numbers[is_on])
    order = np.argsort(distances, kind="mergesort")
    distances, sums = distances[order], np.cumsum(gaps[is_on][order])
    before = np.arange(FEWEST, n - FEWEST + 1)
    sum_before, total = sums[before - 1], sums[-1]
    m = np.argmax(sum_before**2 / before + (total - sum_before) ** 2 / (n - before))
    place = 0.5 * (distances[before[m] - 1] + distances[before[m]])
    return place, (total - sum_before[m]) / (n - before[m])


@compiled
def find_gable(roof, k, s, site):
    """Return height and slope of two planes that rise from side s of volume k and from across.

    They fit the points within a metre of the volume. The slope is NaN if they do not rise.
    """
    numbers, gaps = list_inside(roof, k, site)
    near = numbers[np.abs(gaps) < 1.0]
    if len(near) < FEWEST:
        return 0.0, np.nan
    first, second = measure_from(roof, k, s, site, near), measure_from(roof, k, s ^ 1, site, near)
    runs, heights = np.minimum(first, second), site.z[near]
    spread = ((runs - runs.mean()) ** 2).sum()
    slope = ((runs - runs.mean()) * heights).sum() / max(spread, 1e-9)
    if not SLOPE_LOW < slope < SLOPE_HIGH:
        return 0.0, np.nan
    return heights.mean() - slope * runs.mean(), slope
