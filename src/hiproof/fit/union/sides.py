"""The sides of the volumes as straight lines: along the outline, between its corners, or shared with a neighbour.

Walls are seldom quite at right angles. Lines near a side of a volume's rectangle compete for it: edges of the outline, lines
between two of its corners, and the side as it was found. Each costs what its points say and, the less outline lies along
it, up to the price of a loose edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely

from ...compiled import compiled
from .around import look_around, roof_everywhere
from .objective import ghost_cost, point_cost
from .plan import Plan
from .prices import FAR_COST_A_METRE, LOOSE_COST, UNSUPPORTED_COST
from .scene import Scene
from .volumes import DIRECTION, U0, V0, V1

LEAN = 0.5  # of a line that a side may take
GAP_M = 1.0  # how far off it may be in the middle of the side; a line that leans is further off at its ends
ALONG_M, BESIDE_M, SHORTEST_M = 0.12, 6.0, 0.7  # outline so near a line lies along it; edges so far beside carry on
CHORD_END_M, MOST_CORNERS = 0.6, 40  # how far beyond a side the ends of a line between corners may be
SHARED_M = 0.3  # m within which a side takes its neighbour's line
SHOWN_M = 0.5  # m next to a side in which points need its volume, or else it lies hidden
MOVED_M, MOVES = 1.0, 50  # how far, in how many steps, a side is moved to see how well its points say where it is
REACH_M = max(GAP_M, MOVED_M)  # beyond a volume's edges, where its sides do not lean
NATS_A_POINT = 3.0  # of likelihood that a point explained or not makes
NEEDED, FEWEST_NEEDED = 0.3, 3  # a point that costs so much more without a volume needs it; fewer show nothing
PLACE_M = 0.03  # standard deviation of where points themselves are in plan: of their swath and in their beam
CORNER_SIDES = (0, 2), (1, 2), (1, 3), (0, 3)  # the sides that meet in each corner, in order around a volume
LEAST_KNOWN = 0.05  # a place so likely at the end of the way is not known


class Lines(NamedTuple):
    """Lines x = start + lean * y through the outline's edges and chords that may be sides, from one to the other of y (2, m).

    The ends of all edges, across and along, are `x_edges`, `y_edges` (2, n). The whole outline reaches
    over `x_extent` and `y_extent` (2,), lowest and highest, also where only some of its edges are near.
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
    """A line x = at + lean * y in the axes of its volume's direction: x across the side, y along it.

    `anchored` to the outline: its eave is where the outline is. `sigma` (m) is the standard deviation of where it is, 0 where
    the outline gives it, infinite where no points tell, or where other volumes hide it.
    """

    at: float
    lean: float = 0.0
    anchored: bool = False
    sigma: float = 0.0


def list_lines(
    edges: np.ndarray, chords: np.ndarray, turns: np.ndarray, outline: np.ndarray
) -> list[list[Lines]]:
    """The lines that sides across u and across v may take, by direction: along edges and chords (2, m, 2).

    `outline` (2, n, 2) are all edges of the outline, of which `edges` may be only some.
    """
    ends = np.concatenate([edges, chords], axis=1)
    found = []
    for c, s in turns:
        axes = np.array([[c, -s], [s, c]])
        x, y = np.moveaxis(ends @ axes, 2, 0)
        x_all, y_all = (np.array([ends.min(), ends.max()]) for ends in np.moveaxis(outline @ axes, 2, 0))
        long = np.hypot(x[1] - x[0], y[1] - y[0]) > SHORTEST_M
        across_u = lines_across(x, y, long, edges.shape[1], x_all, y_all)
        found.append([across_u, lines_across(y, x, long, edges.shape[1], y_all, x_all)])
    return found


def sides_of(volumes: np.ndarray, lines: list[list[Lines]], scene: Scene) -> list[list[Side]]:
    """The four sides (u low, u high, v low, v high) of every volume, on the `lines` of its direction where these are near.

    The sides of the base are far away.
    """
    sides = [[Side(float(x)) for x in volumes[0, U0 : V1 + 1]]]
    for k in range(1, len(volumes)):
        at, lean, anchored, sigma = sides_of_volume(volumes, k, *lines[int(volumes[k, DIRECTION])], scene)
        sides.append(
            [Side(*side) for side in zip(at.tolist(), lean.tolist(), anchored.tolist(), sigma.tolist(), strict=True)]
        )
    return share_lines(volumes, sides)


def plan_edges(outline: shapely.Polygon, plan: Plan) -> np.ndarray:
    """Starts and ends (2, m, 2) of the outline's edges in the plan's first direction."""
    rings = [outline.exterior, *outline.interiors]
    corners = [(shapely.get_coordinates(r) - plan.frame.origin[:2]) @ plan.frame.rotation.T for r in rings]
    return np.array([np.concatenate([c[:-1] for c in corners]), np.concatenate([c[1:] for c in corners])])


def plan_chords(outline: shapely.Polygon, plan: Plan) -> np.ndarray:
    """Starts and ends (2, m, 2) of the straight lines inside the outline between two of its corners; none of too many."""
    corners = np.array(sorted(set(map(tuple, shapely.get_coordinates(outline).tolist()))))
    if len(corners) > MOST_CORNERS:
        return np.zeros((2, 0, 2))
    number, wider = np.arange(len(corners)), shapely.buffer(outline, ALONG_M)
    ends = corners[np.array(np.nonzero(number[:, None] < number))]
    shapely.prepare(wider)
    within = shapely.contains_properly(wider, shapely.linestrings(ends.swapaxes(0, 1)))
    return (ends[:, within] - plan.frame.origin[:2]) @ plan.frame.rotation.T


def lines_across(
    x: np.ndarray, y: np.ndarray, long: np.ndarray, edges: int, x_extent: np.ndarray, y_extent: np.ndarray
) -> Lines:
    """Those `long` (m,) of the lines from one to the other of x, y (2, m) that are nearly square to the axis x."""
    across, along = x[1] - x[0], y[1] - y[0]
    kept = np.nonzero(long & (np.abs(across) < LEAN * np.abs(along)))[0]
    lean = across[kept] / along[kept]
    start = x[0, kept] - lean * y[0, kept]
    x_edges, y_edges = np.ascontiguousarray(x[:, :edges]), np.ascontiguousarray(y[:, :edges])
    return Lines(start, lean, np.ascontiguousarray(y[:, kept]), kept < edges, x_edges, y_edges, x_extent, y_extent)


@compiled
def sides_of_volume(volumes, k, across_u, across_v, scene):
    """What `Side` says of each side of volume k, on the cheapest of the lines `across_u` and `across_v`: four arrays (4,)."""
    direction = int(volumes[k, DIRECTION])
    near = near_places(volumes[k], across_u, scene.U[direction], scene.V[direction])
    gain = gain_of_volume(volumes, k, near, scene)
    uv = scene.U[direction][near], scene.V[direction][near]
    at, lean, anchored, sigma = volumes[k, U0 : V1 + 1].copy(), np.zeros(4), np.zeros(4, np.bool_), np.zeros(4)
    for edge in range(4):
        lines = across_u if edge < 2 else across_v
        m = cheapest_line(volumes[k], edge, lines, uv, gain, scene.evidence)
        if m >= 0:
            at[edge], lean[edge], anchored[edge] = lines.start[m], lines.lean[m], True
        sigma[edge] = sigma_of_side(volumes[k], edge, lines, uv, gain, m >= 0)
    return at, lean, anchored, sigma


@compiled
def near_places(volume, across_u, u, v):
    """The numbers of the places u, v that a volume's sides, or walls beside these, depend on."""
    least_u, most_u = across_u.x_extent[0], across_u.x_extent[1]
    least_v, most_v = across_u.y_extent[0], across_u.y_extent[1]
    wide, deep = volume[U0 + 1] - volume[U0], volume[V1] - volume[V0]
    reach_u, reach_v = REACH_M + 0.5 * LEAN * deep, REACH_M + 0.5 * LEAN * wide
    u0, u1 = min(volume[U0], most_u) - reach_u, max(volume[U0 + 1], least_u) + reach_u
    v0, v1 = min(volume[V0], most_v) - reach_v, max(volume[V1], least_v) + reach_v
    return np.nonzero((u >= u0) & (u <= u1) & (v >= v0) & (v <= v1))[0]


@compiled
def gain_of_volume(volumes, k, near, scene):
    """How much more the places `near` (m,) cost were volume k everywhere than without it (m,)."""
    U, V = scene.U[:, near], scene.V[:, near]
    around = look_around(volumes, U, V, k)
    everywhere, without = roof_everywhere(volumes, U, V, k, around), around.without
    gain = np.zeros(len(near))
    for i in range(len(near)):
        if everywhere[i] != without[i]:
            gain[i] = cost_at(near[i], everywhere[i], scene) - cost_at(near[i], without[i], scene)
    return gain


@compiled
def cost_at(i, z, scene):
    """What point or ghost i costs under a roof so high."""
    if i < scene.n:
        return point_cost(scene.z[i], z, scene.dead, scene.width)
    return ghost_cost(z, scene.weight[i], scene.shade[i], scene.low, scene.high)


@compiled
def cheapest_line(volume, edge, lines, uv, gain, evidence):
    """Which of the lines is cheapest for a side of a volume; -1 where the side as it is is cheaper than all."""
    axis, at = edge // 2, volume[U0 + edge]
    low = max(volume[V0 - 2 * axis], lines.y_extent[0])
    high = min(volume[V1 - 2 * axis], lines.y_extent[1])
    sign = -1.0 if edge % 2 == 0 else 1.0
    x, y = uv[axis], uv[1 - axis]
    strip = np.nonzero((y >= low) & (y <= high) & (sign * (x - volume[U0 + (edge ^ 1)]) >= 0.0))[0]
    x, y, gain = sign * x[strip], sign * y[strip], gain[strip]
    best, cheapest = -1, gain[x <= sign * at].sum() + evidence * LOOSE_COST
    for m in range(len(lines.start)):
        if not may_be_side(lines, m, at, low, high):
            continue
        start, lean = lines.start[m], lines.lean[m]
        bare = 1.0 - min(support(start, lean, lines.x_edges, lines.y_edges, low, high) / max(high - low, 1e-6), 1.0)
        off = abs(start + lean * 0.5 * (low + high) - at)
        price = evidence * (UNSUPPORTED_COST * bare + FAR_COST_A_METRE * off)
        for i in range(len(x)):
            if x[i] - lean * y[i] <= sign * start:
                price += gain[i]
        if price < cheapest:
            best, cheapest = m, price
    return best


@compiled
def sigma_of_side(volume, edge, lines, uv, gain, anchored):
    """The `sigma` of a side, which the outline gives where it is `anchored`."""
    if not shows_at(volume, edge, lines, uv, gain):
        return np.inf
    return 0.0 if anchored else sigma_of_place(volume, edge, uv, gain)


@compiled
def shows_at(volume, edge, lines, uv, gain):
    """Whether points next to an edge of the volume, or to the outline where it lies beyond that, need the volume."""
    axis, sign = edge // 2, -1.0 if edge % 2 == 0 else 1.0
    at = min(max(volume[U0 + edge], lines.x_extent[0]), lines.x_extent[1])
    x, y = uv[axis], uv[1 - axis]
    count = 0
    for i in range(len(x)):
        within = volume[V0 - 2 * axis] <= y[i] <= volume[V1 - 2 * axis] and -SHOWN_M < sign * (x[i] - at) <= 0.0
        count += int(within and gain[i] < -NEEDED)
    return count >= FEWEST_NEEDED


@compiled
def sigma_of_place(volume, edge, uv, gain):
    """Standard deviation (m) of where the edge of a volume is, by what its points cost were it elsewhere within MOVED_M; infinite
    where they do not tell, or where another place is better than the volume's own."""
    axis, at = edge // 2, volume[U0 + edge]
    sign = -1.0 if edge % 2 == 0 else 1.0
    x, y = uv[axis], uv[1 - axis]
    moved = (np.arange(2 * MOVES + 1) - MOVES) * MOVED_M / MOVES
    cost = np.zeros(len(moved))
    for i in range(len(x)):
        beside = volume[V0 - 2 * axis] <= y[i] <= volume[V1 - 2 * axis]
        if gain[i] != 0.0 and beside and abs(x[i] - at) < MOVED_M:
            for m in range(len(cost)):
                cost[m] += gain[i] if sign * (x[i] - at) <= moved[m] else 0.0
    weight = np.exp(-NATS_A_POINT * (cost - cost.min()))
    if max(weight[0], weight[-1]) > LEAST_KNOWN * weight.max():
        return np.inf
    return np.sqrt((weight * moved**2).sum() / weight.sum() + PLACE_M**2)


@compiled
def may_be_side(lines, m, at, low, high):
    """Whether line m is near enough to the side x = at from y = low to high."""
    start, lean = lines.start[m], lines.lean[m]
    first, last = min(lines.y[0, m], lines.y[1, m]), max(lines.y[0, m], lines.y[1, m])
    if lines.is_edge[m]:
        near = last > low - BESIDE_M and first < high + BESIDE_M
    else:
        near = first > low - CHORD_END_M and last < high + CHORD_END_M
    return near and abs(start + lean * 0.5 * (low + high) - at) < GAP_M


@compiled
def support(start, lean, x_edges, y_edges, low, high):
    """Length (m) of outline along the line x = start + lean y, between y = low and high."""
    total = 0.0
    for e in range(x_edges.shape[1]):
        if (
            abs(x_edges[0, e] - start - lean * y_edges[0, e]) < ALONG_M
            and abs(x_edges[1, e] - start - lean * y_edges[1, e]) < ALONG_M
        ):
            first, last = min(y_edges[0, e], y_edges[1, e]), max(y_edges[0, e], y_edges[1, e])
            total += max(min(last, high) - max(first, low), 0.0)
    return total


def share_lines(volumes: np.ndarray, sides: list[list[Side]]) -> list[list[Side]]:
    """The sides, on anchored lines of other volumes where edges of these lie where theirs do."""
    anchored: dict[tuple[float, int], list[tuple[int, Side]]] = {}
    directions = volumes[:, DIRECTION].tolist()
    for k, own in enumerate(sides):
        for edge, side in enumerate(own):
            if side.anchored:
                anchored.setdefault((directions[k], edge // 2), []).append((k, side))
    found = [sides[0]]
    for k in range(1, len(sides)):
        u0, u1, v0, v1 = volumes[k, U0 : V1 + 1].tolist()
        middles = 0.5 * (v0 + v1), 0.5 * (u0 + u1)
        among = [anchored.get((directions[k], axis), []) for axis in (0, 1)]
        lines = [[line for j, line in own if j != k] for own in among]
        axes = zip((0, 0, 1, 1), sides[k], strict=True)
        found.append([shared(side, lines[axis], middles[axis]) for axis, side in axes])
    return found


def shared(own: Side, lines: list[Side], middle: float) -> Side:
    """The side, or the nearest of the `lines` of others where that is near at its `middle`."""
    if own.anchored or not lines:
        return own
    gaps = [abs(line.at + line.lean * middle - own.at) for line in lines]
    nearest = lines[gaps.index(min(gaps))]
    return Side(nearest.at, nearest.lean) if min(gaps) < SHARED_M else own


def corners_of(sides: list[Side]) -> np.ndarray:
    """The corners (4, 2) where a volume's sides meet, those of CORNER_SIDES, in its direction's axes."""
    found = []
    for i, j in CORNER_SIDES:
        a, b = sides[i], sides[j]
        u = (a.at + a.lean * b.at) / (1.0 - a.lean * b.lean)
        found.append((u, b.at + b.lean * u))
    return np.array(found)
