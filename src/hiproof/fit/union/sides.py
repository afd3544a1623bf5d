"""Choose the sides of the volumes as straight lines.

They lie along the outline, between its corners, or are shared with a neighbour. Walls are seldom
quite at right angles. Lines near a side of a volume's rectangle compete for it: edges of the
outline, lines between two of its corners, and the side as the search left it. Each costs what its
points say and, the less outline lies along it, up to the price of a loose edge. A side on no such
line leans where its points show that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely

from ...compiled import compiled
from ...geometry.rings import is_convex
from .around import compute_roof_everywhere, measure_context
from .objective import compute_cell_cost, compute_point_cost
from .plan import Plan
from .prices import FAR_COST_A_METRE, LEANING_SIDE_UNITS, LOOSE_COST, UNSUPPORTED_COST
from .scene import Scene
from .volumes import DIRECTION, U0, V0, V1

MOST_SIDE_LEAN = 0.5  # Largest lean of a line that a side may take.
# Furthest (m) that the line may lie from the middle of the side. A line that leans is further off
# at its ends.
MOST_OFFSET_M = 1.0
ALONG_M = 0.12  # Outline so near a line (m) lies along it.
OUTLINE_REACH_M = 6.0  # Edges so far (m) beside a side carry on along it.
SHORTEST_LINE_M = 0.7  # Shortest length (m) of a line.
CHORD_END_M = 0.6  # Distance (m) beyond a side of the ends of a line between corners.
MOST_CHORD_CORNERS = 40  # Most corners of an outline with such lines.
SHARED_M = 0.3  # A side takes its neighbour's line within this distance (m).
LEANING_STEPS_M = (0.2, 0.04)  # Steps (m) in which the ends of a leaning side are sought.
LEANING_PLACES = 5  # Places each way in which each end is tried.


class SideLines(NamedTuple):
    """Lines x = start + lean * y through the outline that may be sides.

    They follow its edges and chords, from one to the other of y (2, m). The ends of all edges,
    across and along, are `x_edges`, `y_edges` (2, n). The whole outline reaches over `x_extent` and
    `y_extent` (2,), lowest and highest, also where only some of its edges are near.
    """

    start: np.ndarray
    lean: np.ndarray
    y: np.ndarray
    is_edge: np.ndarray
    x_edges: np.ndarray
    y_edges: np.ndarray
    x_extent: np.ndarray
    y_extent: np.ndarray


@dataclass(frozen=True)
class Side:
    """A line x = offset + lean * y in the axes of its volume's direction.

    x is across the side, y along it. If it is `anchored` to the outline, its eave is where the
    outline is. `sigma` (m) is the standard deviation of its place. It is 0 where the outline gives
    the place, and infinite where no points determine it or other volumes hide it.
    """

    offset: float
    lean: float = 0.0
    anchored: bool = False
    sigma: float = 0.0


def gather_lines(outline: shapely.Polygon, plan: Plan, turns: np.ndarray) -> list[list[SideLines]]:
    """List the lines of an outline that sides may take, by direction, across u and across v."""
    edges = list_edges(outline, plan)
    return list_lines(edges, list_chords(outline, plan), turns, edges)


def list_lines(
    edges: np.ndarray, chords: np.ndarray, turns: np.ndarray, outline: np.ndarray
) -> list[list[SideLines]]:
    """List the lines that sides across u and across v may take, by direction.

    They lie along `edges` and `chords` (2, m, 2). `outline` (2, n, 2) are all edges of the outline,
    of which `edges` may be only some.
    """
    ends = np.concatenate([edges, chords], axis=1)
    lines_by_direction = []
    for c, s in turns:
        axes = np.array([[c, -s], [s, c]])
        x, y = (ends @ axes).transpose(2, 0, 1)
        x_all, y_all = (
            np.array([along.min(), along.max()]) for along in (outline @ axes).transpose(2, 0, 1)
        )
        long = np.hypot(x[1] - x[0], y[1] - y[0]) > SHORTEST_LINE_M
        across_u = select_lines(x, y, long, edges.shape[1], x_all, y_all)
        lines_by_direction.append(
            [across_u, select_lines(y, x, long, edges.shape[1], y_all, x_all)]
        )
    return lines_by_direction


def choose_sides(
    volumes: np.ndarray, lines: list[list[SideLines]], scene: Scene
) -> list[list[Side]]:
    """Choose the four sides (u low, u high, v low, v high) of every volume.

    They lie on the `lines` of its direction where these are near. The sides of the base are far
    away.
    """
    sides = [[Side(float(x)) for x in volumes[0, U0 : V1 + 1]]]
    for k in range(1, len(volumes)):
        chosen = choose_volume_sides(volumes, k, *lines[int(volumes[k, DIRECTION])], scene)
        sides.append([Side(*side) for side in zip(*(x.tolist() for x in chosen), strict=True)])
    return share_lines(volumes, sides)


def list_edges(outline: shapely.Polygon, plan: Plan) -> np.ndarray:
    """Return starts and ends (2, m, 2) of the outline's edges in the first direction."""
    rings = [outline.exterior, *outline.interiors]
    corners = [
        (shapely.get_coordinates(r) - plan.frame.origin[:2]) @ plan.frame.rotation.T for r in rings
    ]
    return np.array(
        [np.concatenate([c[:-1] for c in corners]), np.concatenate([c[1:] for c in corners])]
    )


def list_chords(outline: shapely.Polygon, plan: Plan) -> np.ndarray:
    """Return starts and ends (2, m, 2) of the lines between two corners.

    They lie inside the outline. There are none if it has too many corners.
    """
    corners = np.array(sorted(set(map(tuple, shapely.get_coordinates(outline).tolist()))))
    if len(corners) > MOST_CHORD_CORNERS:
        return np.zeros((2, 0, 2))
    number = np.arange(len(corners))
    ends = corners[np.array(np.nonzero(number[:, None] < number))]
    if not is_convex(outline):
        wider = shapely.buffer(outline, ALONG_M)
        shapely.prepare(wider)
        lines = shapely.linestrings(ends.swapaxes(0, 1))
        ends = ends[:, shapely.contains_properly(wider, lines)]
    return (ends - plan.frame.origin[:2]) @ plan.frame.rotation.T


def select_lines(
    x: np.ndarray,
    y: np.ndarray,
    long: np.ndarray,
    edges: int,
    x_extent: np.ndarray,
    y_extent: np.ndarray,
) -> SideLines:
    """Select the `long` (m,) lines that are nearly square to the axis x.

    They run from one to the other of x, y (2, m).
    """
    across, along = x[1] - x[0], y[1] - y[0]
    numbers = np.nonzero(long & (np.abs(across) < MOST_SIDE_LEAN * np.abs(along)))[0]
    lean = across[numbers] / along[numbers]
    start = x[0, numbers] - lean * y[0, numbers]
    x_edges, y_edges = np.ascontiguousarray(x[:, :edges]), np.ascontiguousarray(y[:, :edges])
    return SideLines(
        start,
        lean,
        np.ascontiguousarray(y[:, numbers]),
        numbers < edges,
        x_edges,
        y_edges,
        x_extent,
        y_extent,
    )


@compiled
def choose_volume_sides(volumes, k, across_u, across_v, scene):
    """Choose each side of volume k on the cheapest of the lines across u and across v.

    Returns the first three values of `Side`, as arrays (4,).
    """
    direction = int(volumes[k, DIRECTION])
    numbers = find_near_places(volumes[k], across_u, scene.U[direction], scene.V[direction])
    gain = measure_gain(volumes, k, numbers, scene)
    points_gain = gain.copy()
    for q in range(len(numbers)):
        if numbers[q] >= scene.n:
            points_gain[q] = 0.0
    uv = scene.U[direction][numbers], scene.V[direction][numbers]
    offsets, lean, anchored = volumes[k, U0 : V1 + 1].copy(), np.zeros(4), np.zeros(4, np.bool_)
    for edge in range(4):
        lines = across_u if edge < 2 else across_v
        m = find_cheapest_line(volumes[k], edge, lines, uv, gain, scene.evidence)
        if m >= 0:
            offsets[edge], lean[edge], anchored[edge] = lines.start[m], lines.lean[m], True
        else:
            price = scene.evidence * LEANING_SIDE_UNITS
            offsets[edge], lean[edge] = find_leaning_line(
                volumes[k], edge, lines, uv, points_gain, price
            )
    return offsets, lean, anchored


@compiled
def find_near_places(volume, across_u, u, v):
    """Return the numbers of the places u, v on which a volume's sides depend.

    Walls beside the sides depend on them, too.
    """
    least_u, most_u = across_u.x_extent[0], across_u.x_extent[1]
    least_v, most_v = across_u.y_extent[0], across_u.y_extent[1]
    wide, deep = volume[U0 + 1] - volume[U0], volume[V1] - volume[V0]
    reach_u, reach_v = (
        MOST_OFFSET_M + 0.5 * MOST_SIDE_LEAN * deep,
        MOST_OFFSET_M + 0.5 * MOST_SIDE_LEAN * wide,
    )
    u0, u1 = min(volume[U0], most_u) - reach_u, max(volume[U0 + 1], least_u) + reach_u
    v0, v1 = min(volume[V0], most_v) - reach_v, max(volume[V1], least_v) + reach_v
    numbers, count = np.empty(len(u), np.int64), 0
    for i in range(len(u)):
        if u0 <= u[i] <= u1 and v0 <= v[i] <= v1:
            numbers[count] = i
            count += 1
    return numbers[:count]


@compiled
def measure_gain(volumes, k, numbers, scene):
    """Return how much more the places `numbers` (m,) cost with volume k everywhere.

    It is compared with the roof without it.
    """
    U, V = scene.U[:, numbers], scene.V[:, numbers]
    context = measure_context(volumes, U, V, scene.order, k)
    everywhere, roof_without = (
        compute_roof_everywhere(volumes, U, V, k, context),
        context.roof_without,
    )
    gain = np.zeros(len(numbers))
    for i in range(len(numbers)):
        if everywhere[i] != roof_without[i]:
            gain[i] = compute_cost_at(numbers[i], everywhere[i], scene) - compute_cost_at(
                numbers[i], roof_without[i], scene
            )
    return gain


@compiled
def compute_cost_at(i, z, scene):
    """Return what point or cell i costs under a roof at height z."""
    if i < scene.n:
        return compute_point_cost(scene.z[i], z, scene.dead, scene.width)
    return compute_cell_cost(z, scene.weight[i], scene.shade[i], scene.low, scene.high)


@compiled
def find_cheapest_line(volume, edge, lines, uv, gain, evidence):
    """Find the cheapest line for a side of a volume, -1 if the side is cheaper.

    A line is cheaper than the side if it explains the points better.
    """
    axis, place = edge // 2, volume[U0 + edge]
    y_low = max(volume[V0 - 2 * axis], lines.y_extent[0])
    y_high = min(volume[V1 - 2 * axis], lines.y_extent[1])
    sign = -1.0 if edge % 2 == 0 else 1.0
    x, y = uv[axis], uv[1 - axis]
    strip = np.nonzero(
        (y >= y_low) & (y <= y_high) & (sign * (x - volume[U0 + (edge ^ 1)]) >= 0.0)
    )[0]
    x, y, gain = sign * x[strip], sign * y[strip], gain[strip]
    best, cheapest = -1, gain[x <= sign * place].sum() + evidence * LOOSE_COST
    for m in range(len(lines.start)):
        if not is_near_side(lines, m, place, y_low, y_high):
            continue
        start, lean = lines.start[m], lines.lean[m]
        bare = 1.0 - min(
            measure_outline_along(start, lean, lines.x_edges, lines.y_edges, y_low, y_high)
            / max(y_high - y_low, 1e-6),
            1.0,
        )
        distance = abs(start + lean * 0.5 * (y_low + y_high) - place)
        price = evidence * (UNSUPPORTED_COST * bare + FAR_COST_A_METRE * distance)
        for i in range(len(x)):
            if x[i] - lean * y[i] <= sign * start:
                price += gain[i]
        if price < cheapest:
            best, cheapest = m, price
    return best


@compiled
def find_leaning_line(volume, edge, lines, uv, gain, price):
    """Find the offset and the lean of the line that points show for a side.

    They are those of the side itself if no line gains more than its `price` (points).
    """
    axis, place = edge // 2, volume[U0 + edge]
    y_low = max(volume[V0 - 2 * axis], lines.y_extent[0])
    y_high = min(volume[V1 - 2 * axis], lines.y_extent[1])
    sign = -1.0 if edge % 2 == 0 else 1.0
    x, y = uv[axis], uv[1 - axis]
    is_beside = (y >= y_low) & (y <= y_high) & (np.abs(x - place) < MOST_OFFSET_M)
    is_beside &= sign * (x - volume[U0 + (edge ^ 1)]) >= 0.0
    strip = np.nonzero(is_beside & (gain != 0.0))[0]
    length = max(y_high - y_low, 1e-6)
    begin, end = move_ends(
        sign * (x[strip] - place), (y[strip] - y_low) / length, gain[strip], price
    )
    lean = sign * (end - begin) / length
    if abs(lean) > MOST_SIDE_LEAN:
        return place, 0.0
    return place + sign * begin - lean * y_low, lean


@compiled
def move_ends(x, share, gain, price):
    """Return how far (m) the two ends of a side move out, 0 if that gains no `price`.

    Places (m,) lie x beyond the side, at a `share` of its length. Their `gain` counts if they lie
    within it.
    """
    present = most = 0.0
    for i in range(len(x)):
        present += gain[i] if x[i] <= 0.0 else 0.0
        most += max(gain[i] if x[i] <= 0.0 else -gain[i], 0.0)
    cheapest, best_begin, best_end = present - price, 0.0, 0.0
    if most <= price:
        return best_begin, best_end
    for step in LEANING_STEPS_M:
        middle_begin, middle_end = best_begin, best_end
        for k in range((2 * LEANING_PLACES + 1) ** 2):
            row, column = divmod(k, 2 * LEANING_PLACES + 1)
            begin = middle_begin + (row - LEANING_PLACES) * step
            end = middle_end + (column - LEANING_PLACES) * step
            if begin == end or max(abs(begin), abs(end)) > MOST_OFFSET_M:
                continue
            cost = 0.0
            for i in range(len(x)):
                cost += gain[i] if x[i] <= begin + share[i] * (end - begin) else 0.0
            if cost < cheapest:
                cheapest, best_begin, best_end = cost, begin, end
    return best_begin, best_end


@compiled
def is_near_side(lines, m, place, y_low, y_high):
    """Return whether line m is near the side x = `place` from `y_low` to `y_high`."""
    start, lean = lines.start[m], lines.lean[m]
    first, last = min(lines.y[0, m], lines.y[1, m]), max(lines.y[0, m], lines.y[1, m])
    if lines.is_edge[m]:
        is_near = last > y_low - OUTLINE_REACH_M and first < y_high + OUTLINE_REACH_M
    else:
        is_near = first > y_low - CHORD_END_M and last < y_high + CHORD_END_M
    return is_near and abs(start + lean * 0.5 * (y_low + y_high) - place) < MOST_OFFSET_M


@compiled
def measure_outline_along(start, lean, x_edges, y_edges, y_low, y_high):
    """Return the length (m) of outline along the line x = start + lean y.

    It counts between y = `y_low` and `y_high`.
    """
    total = 0.0
    for e in range(x_edges.shape[1]):
        if (
            abs(x_edges[0, e] - start - lean * y_edges[0, e]) < ALONG_M
            and abs(x_edges[1, e] - start - lean * y_edges[1, e]) < ALONG_M
        ):
            first, last = min(y_edges[0, e], y_edges[1, e]), max(y_edges[0, e], y_edges[1, e])
            total += max(min(last, y_high) - max(first, y_low), 0.0)
    return total


def share_lines(volumes: np.ndarray, sides: list[list[Side]]) -> list[list[Side]]:
    """Move sides to anchored lines of other volumes, whose edges lie where theirs do."""
    anchored: dict[tuple[float, int], list[tuple[int, Side]]] = {}
    directions = volumes[:, DIRECTION].tolist()
    for k, volume_sides in enumerate(sides):
        for edge, side in enumerate(volume_sides):
            if side.anchored:
                anchored.setdefault((directions[k], edge // 2), []).append((k, side))
    shared_sides = [sides[0]]
    for k in range(1, len(sides)):
        u0, u1, v0, v1 = volumes[k, U0 : V1 + 1].tolist()
        middles = 0.5 * (v0 + v1), 0.5 * (u0 + u1)
        among = [anchored.get((directions[k], axis), []) for axis in (0, 1)]
        lines = [[line for j, line in neighbours if j != k] for neighbours in among]
        axes = zip((0, 0, 1, 1), sides[k], strict=True)
        shared_sides.append(
            [take_shared_line(side, lines[axis], middles[axis]) for axis, side in axes]
        )
    return shared_sides


def take_shared_line(side: Side, lines: list[Side], middle: float) -> Side:
    """Return the side, or the nearest of the `lines` of others if it is near.

    It is near at the side's `middle`.
    """
    if side.anchored or side.lean or not lines:
        return side
    gaps = [abs(line.offset + line.lean * middle - side.offset) for line in lines]
    nearest = lines[gaps.index(min(gaps))]
    return Side(nearest.offset, nearest.lean) if min(gaps) < SHARED_M else side
