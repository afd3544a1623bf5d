"""From volumes to named parts: each a member of the family of roof shapes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from ...model import Part
from ...primitives.family import AXIS, SIGN, Member, name_among
from .finish import Planes, Wall
from .plan import Plan
from .scene import Scene
from .sides import Side
from .volumes import DIRECTION, LEVEL, SIDES

EACH = np.arange(SIDES)
LEVEL_EAVE_M = 0.5  # an eave that would be level if its side lay so little further out is level
# of the half of its rectangle, by which a side that lies hidden may be moved to where its eave is level
HIDDEN_SHARE = 0.8
APEX_M = 0.15  # a hip whose pairs of sides meet at heights so near each other is a pyramid
STRAIGHT = 1e-9  # rad; numerically the same direction
GIVEN_M = 1e-3  # a rectangle's end further from its side is given by the outline that cuts it off
# standard deviations of a swath's place and height, which no point of a building tells: roofs lie beside their outline by the former
REGISTERED_PLAN_M, REGISTERED_M = 0.03, 0.01
RAISED = np.array([[0.0], [0.0], [REGISTERED_M]])  # a plane (3, 1) changed by the latter
PROBE_M = 0.01  # how far an end is moved to see which parameters depend on it


def part_of(
    volume: np.ndarray,
    planes: Planes,
    sides: list[Side],
    regions: list[shapely.Polygon],
    plan: Plan,
    scene: Scene,
    allowed: tuple[str, ...] = (),
) -> Part:
    """The volume over its `regions` (local coordinates) as a part of the family, called as `allowed` has it where that can be."""
    c, s = scene.turn[int(volume[DIRECTION])]
    axes = np.array([[c, s], [-s, c]]) @ plan.frame.rotation
    corners = shapely.get_coordinates(regions) - plan.frame.origin[:2]
    at = np.column_stack([corners @ axes.T, np.ones(len(corners))])
    rows = np.where(showing(planes.rows, at)[:, None], planes.rows, np.nan)
    registrations = registered(planes, rows, at)
    turn = common_lean(rows)
    axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]]) @ axes
    rows = turned(rows, turn) + [0.0, 0.0, plan.frame.origin[2]]
    sides = [moved(side, k, turn) for k, side in enumerate(sides)]
    ends = rectangle_of(sides, corners @ axes.T)
    known, unknown = ends_moved(sides, ends)
    tried = np.array([ends, ends, ends, *known, *unknown]).T
    every = np.repeat(rows[:, :, None], tried.shape[1], axis=2)
    every[:, :, 1:3] += turned(registrations, turn)
    walls = tuple(wall._replace(facing=wall.facing - turn) for wall in planes.walls)
    hidden = [k for k, side in enumerate(sides) if side.sigma == math.inf and not side.anchored]
    members = regular(every, tried, math.atan2(axes[0, 1], axes[0, 0]), walls, hidden)
    member = members.those(0)
    turns = member.quarter_turns
    modes = np.concatenate([turned(planes.modes, turn), np.tile(RAISED, (len(rows), 1, 1))], axis=2)
    told = np.isfinite(rows[:, 2]) | (np.arange(len(rows)) <= LEVEL)  # of cants those that show
    changes = changed(members, modes[told]).turn(turns)
    member = replace(member.turn(turns), centre=member.centre @ axes + plan.frame.origin[:2])
    return member.part(regions, name_among(member.name, allowed), changes, len(unknown))


def registered(planes: Planes, rows: np.ndarray, at: np.ndarray) -> np.ndarray:
    """By how much (k, 3, 2) planes change were their points' swath to lie further along u or along v by a standard deviation: as those
    that show (`rows`) can over the corners `at` (n, 3), u, v, 1, tied to sides of the outline as they are."""
    there = np.isfinite(rows[:, 2])
    if not rows[there, :2].any():  # level ones stay as high
        return np.zeros((len(rows), 3, 2))
    design = (at @ planes.design[there]).reshape(there.sum() * len(at), planes.design.shape[2])
    shifted = -REGISTERED_PLAN_M * rows[there, :2].repeat(len(at), axis=0)
    return planes.design @ np.linalg.lstsq(design, shifted, rcond=None)[0]


def showing(rows: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Which planes (k,) are not everywhere above some single other one.

    `at` (n, 3) are u, v, 1 of the regions' corners. Where only planes over walls show, the lowest other plane stays: a shape has one.
    """
    there = np.isfinite(rows[:, 2])
    if there.sum() < 2:
        return there
    z = rows @ at.T
    above = (z[None] <= z[:, None] + 1e-9).all(axis=2).tolist()  # [k][j]: plane k nowhere below plane j
    for k in np.nonzero(there)[0].tolist():
        there[k] = not any(above[k][j] for j in np.nonzero(there)[0].tolist() if j != k)
    if not there[: LEVEL + 1].any():
        there[np.nanargmin(z[: LEVEL + 1].mean(axis=1))] = True
    return there


def common_lean(rows: np.ndarray) -> float:
    """The angle (rad) by which axes must turn for a pair of planes that face each other to face along them; 0 if none does."""
    for low, high, axis in ((2, 3, 1), (0, 1, 0)):
        gradients = [rows[k, :2] for k in (low, high) if np.isfinite(rows[k, 2])]
        if not gradients:
            continue
        angles = [math.remainder(math.atan2(g[1], g[0]) - axis * 0.5 * math.pi, math.pi) for g in gradients]
        if len(angles) == 1 or abs(angles[0] - angles[1]) < STRAIGHT:
            return angles[0]
    return 0.0


def turned(rows: np.ndarray, angle: float) -> np.ndarray:
    """Planes (k, 3), or several (k, 3, m), over axes turned by `angle`; what then faces along an axis but for rounding does so exactly."""
    if angle == 0.0:
        return rows
    c, s = math.cos(angle), math.sin(angle)
    rows = (rows.swapaxes(1, -1) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])).swapaxes(1, -1)
    along = rows[EACH, 1 - AXIS]
    rows[EACH, 1 - AXIS] = np.where(np.abs(along) < 1e-8, 0.0, along)
    return rows


def moved(side: Side, edge: int, angle: float) -> Side:
    """The side seen from axes turned by `angle`."""
    if angle == 0.0:
        return side
    slope = math.atan(side.lean) + (angle if edge < 2 else -angle)
    scale = math.cos(math.atan(side.lean)) / math.cos(slope)
    return replace(side, at=side.at * scale, lean=math.tan(slope))


def rectangle_of(sides: list[Side], corners: np.ndarray) -> list[float]:
    """Lowest and highest u, lowest and highest v of the sides in their middle, no further out than the regions' `corners` (n, 2) are."""
    least, most = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    ends = []
    for axis in (0, 1):
        low, high = sides[2 * axis], sides[2 * axis + 1]
        middle = 0.5 * (least[1 - axis] + most[1 - axis])
        start, end = low.at + low.lean * middle, high.at + high.lean * middle
        start = start if low.anchored else max(start, least[axis])
        end = end if high.anchored else min(end, most[axis])
        ends += [least[axis], most[axis]] if end - start < 1e-3 else [start, end]
    return ends


def ends_moved(sides: list[Side], ends: list[float]) -> tuple[list[list[float]], list[list[float]]]:
    """The `ends` (lowest and highest u, v) of a rectangle after each of its sides moved by its standard deviation; and after each of
    those that stand where no points tell moved a little."""
    middle, known, unknown = (0.5 * (ends[0] + ends[1]), 0.5 * (ends[2] + ends[3])), [], []
    for k, side in enumerate(sides):
        given = side.anchored or abs(ends[k] - side.at - side.lean * middle[1 - k // 2]) > GIVEN_M
        if side.sigma == math.inf:
            unknown.append([*ends[:k], ends[k] + PROBE_M, *ends[k + 1 :]])
        elif not given and side.sigma > 0.0:
            known.append([*ends[:k], ends[k] + side.sigma, *ends[k + 1 :]])
    return known, unknown


def regular(
    rows: np.ndarray, ends: np.ndarray, kappa: float, walls: tuple[Wall, ...] = (), hidden: Sequence[int] = ()
) -> Member:
    """Members over m rectangles, lowest and highest u, v `ends` (4, m), with planes `rows` (5 and those over `walls`, 3, m), which all
    have the same sides, in axes of which the first is at `kappa`: with eaves and an apex in common where they nearly are, or where a
    side lies `hidden`."""
    centre, half = 0.5 * (ends[::2] + ends[1::2]), 0.5 * (ends[1::2] - ends[::2])
    there = np.flatnonzero(np.isfinite(rows[: LEVEL + 1, 2, 0])).tolist()
    sides, count = [k for k in there if k < SIDES], rows.shape[2]
    eaves, slopes, leans = np.full((SIDES, count), np.inf), np.zeros((SIDES, count)), np.zeros((SIDES, count))
    for k in sides:
        axis = k // 2
        slopes[k] = SIGN[k] * rows[k, axis]
        leans[k] = rows[k, 1 - axis] / slopes[k]
        eaves[k] = rows[k, 0] * centre[0] + rows[k, 1] * centre[1] + rows[k, 2] - slopes[k] * half[axis]
    top = rows[LEVEL, 2] if LEVEL in there else np.full(count, np.inf)
    if sides:
        centre, half, eaves = level(centre, half, eaves, slopes, leans, sides, hidden)
    return with_one_apex(
        Member(kappa, centre, half, eaves, slopes, top, leans, cants_of(rows[LEVEL + 1 :], walls, centre))
    )


def cants_of(rows: np.ndarray, walls: tuple[Wall, ...], centre: np.ndarray) -> np.ndarray:
    """The cants (4, c, m) of members about `centre` (2, m), whose planes over `walls` are `rows` (n, 3, m), NaN where one shows nowhere."""
    cants = []
    for wall, row in zip(walls, rows, strict=True):
        out = wall.offset - math.cos(wall.facing) * centre[0] - math.sin(wall.facing) * centre[1]
        cants.append([np.full_like(out, wall.facing), out, *eave_and_slope(row, wall.facing, out, centre)])
    shown = [cant for cant in cants if np.isfinite(cant[3]).all()]
    return np.array(shown).reshape(-1, 4, centre.shape[1]).swapaxes(0, 1)


def eave_and_slope(plane: np.ndarray, facing: float, out: Any, centre: np.ndarray) -> tuple[Any, Any]:
    """The height of a plane a, b, c (3, m) at a wall that lies so far `out`, facing that way, from `centre`, and by how much it rises there."""
    (a, b, z), c, s = plane, math.cos(facing), math.sin(facing)
    return a * (centre[0] + out * c) + b * (centre[1] + out * s) + z, -c * a - s * b


def level(
    centre: np.ndarray,
    half: np.ndarray,
    eaves: np.ndarray,
    slopes: np.ndarray,
    leans: np.ndarray,
    sides: list[int],
    hidden: Sequence[int] = (),
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres and halves (2, m) and eaves (4, m) of members with `sides` moved out to the lowest eave's height where that is near.

    Those that lie `hidden` under other parts are where nothing tells, and go there from afar, and inwards as well.
    """
    told = [k for k in sides if k not in hidden] or sides
    lowest, outwards, eaves = eaves[told].min(axis=0), np.zeros_like(eaves), eaves.copy()
    for k in sides:
        further = (eaves[k] - lowest) / slopes[k]
        if k in told:
            outwards[k] = np.where(further < LEVEL_EAVE_M, further, 0.0)
        else:
            outwards[k] = np.where(np.abs(further) < HIDDEN_SHARE * half[k // 2], further, 0.0)
    low, high = outwards[::2], outwards[1::2]
    shift = 0.5 * (high - low)
    for k in sides:
        lower = eaves[k] + slopes[k] * (leans[k] * shift[1 - k // 2] - outwards[k])
        eaves[k] = np.where(np.abs(lower - lowest) < 1e-6, lowest, lower)
    return centre + shift, half + 0.5 * (high + low), eaves


def changed(members: Member, changes: np.ndarray) -> Member:
    """The first of several with its planes changed by each of `changes` (5 and cants, 3, p), its sides where they are; and the others."""
    count = changes.shape[2]
    found = members.those([0] * count + list(range(1, members.eaves.shape[1])))
    for k in members.sides:
        axis = k // 2
        middle = members.centre[:, 0].copy()  # of the side
        middle[axis] -= SIGN[k] * members.half[axis, 0]
        found.slopes[k, :count] += SIGN[k] * changes[k, axis]
        found.eaves[k, :count] += changes[k, 0] * middle[0] + changes[k, 1] * middle[1] + changes[k, 2]
    found.top[:count] += changes[LEVEL, 2]
    for k, plane in enumerate(changes[LEVEL + 1 :]):
        facing, out = members.cants[:2, k, 0].tolist()
        found.cants[2:, k, :count] += eave_and_slope(plane, facing, out, members.centre[:, 0])
    return found


def with_one_apex(members: Member) -> Member:
    """Hips whose two pairs of sides meet at nearly the same height with all four meeting in one point, eaves where they are."""
    if not all(members.has) or members.has_top:
        return members
    one, other = members.apex(0), members.apex(1)
    near = (np.abs(one - other) <= APEX_M) & ~members.leans.any(axis=0)
    runs = (np.stack([one, one, other, other]) - members.eaves) / members.slopes  # from each eave to the point in plan
    return replace(members, slopes=np.where(near, (0.5 * (one + other) - members.eaves) / runs, members.slopes))
