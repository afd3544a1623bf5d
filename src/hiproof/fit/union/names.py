"""From volumes to named parts: each a member of the family of roof shapes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import shapely

from ...model import Part
from ...primitives.family import AXIS, SIGN, Member, name_among
from .finish import Planes
from .plan import Plan
from .scene import Scene
from .sides import Side
from .volumes import DIRECTION, LEVEL, SIDES

EACH = np.arange(SIDES)
LEVEL_EAVE_M = 0.5  # an eave that would be level if its side lay so little further out is level
APEX_M = 0.15  # a hip whose pairs of sides meet at heights so near each other is a pyramid
STRAIGHT = 1e-9  # rad; numerically the same direction
GIVEN_M = 1e-3  # a rectangle's end further from its side is given by the outline that cuts it off
# standard deviations of a swath's place and height, which no point of a building tells: roofs lie beside their outline by the former
REGISTERED_PLAN_M, REGISTERED_M = 0.03, 0.01
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
    corners = np.concatenate([shapely.get_coordinates(region) for region in regions]) - plan.frame.origin[:2]
    uv = corners @ axes.T
    rows = np.where(showing(planes.rows, uv)[:, None], planes.rows, np.nan)
    registrations = registered(planes, rows, uv)
    turn = common_lean(rows)
    axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]]) @ axes
    rows = turned(rows, turn) + [0.0, 0.0, plan.frame.origin[2]]
    sides = [moved(side, k, turn) for k, side in enumerate(sides)]
    low, high = rectangle_of(sides, corners @ axes.T)
    kappa = math.atan2(axes[0, 1], axes[0, 0])
    member = regular(rows, low, high, kappa)
    modes = [*(turned(mode, turn) for mode in planes.modes), np.tile((0.0, 0.0, REGISTERED_M), (SIDES + 1, 1))]
    loose = [regular(rows, *ends, kappa) for ends in ends_moved(sides, low, high, known=True)]
    loose += [regular(rows + turned(change, turn), low, high, kappa) for change in registrations]
    unknown = [regular(rows, *ends, kappa) for ends in ends_moved(sides, low, high, known=False)]
    changes, unknown = (
        alike_turned(own, member.quarter_turns) for own in (changed(member, np.array(modes)) + loose, unknown)
    )
    member = replace(member.canonical(), centre=member.centre @ axes + plan.frame.origin[:2])
    part = member.part(regions, name_among(member.name, allowed), changes)
    untold = member.sigma(unknown, part.type == member.name)
    return replace(part, sigma={name: value for name, value in part.sigma.items() if name not in untold})


def registered(planes: Planes, rows: np.ndarray, corners: np.ndarray) -> list[np.ndarray]:
    """By how much planes (5, 3) change were their points' swath to lie further along u or along v by a standard deviation: as those
    that show (`rows`) can over `corners` (n, 2), tied to sides of the outline as they are."""
    there, at = np.isfinite(rows[:, 2]), np.column_stack([corners, np.ones(len(corners))])
    design = (at @ planes.design[there]).reshape(there.sum() * len(at), planes.design.shape[2])
    shifted = -REGISTERED_PLAN_M * rows[there, :2].repeat(len(corners), axis=0)
    unknowns = np.linalg.lstsq(design, shifted, rcond=None)[0]
    return [planes.design @ own for own in unknowns.T]


def alike_turned(members: list[Member], quarter_turns: int) -> list[Member]:
    """The members seen from axes so many quarter turns on."""
    for _ in range(quarter_turns):
        members = [member.turned() for member in members]
    return members


def showing(rows: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Which planes (5,) are not everywhere above some single other one over the regions' `corners` (n, 2)."""
    there = np.isfinite(rows[:, 2])
    z = rows @ np.column_stack([corners, np.ones(len(corners))]).T
    above = (z[None] <= z[:, None] + 1e-9).all(axis=2).tolist()  # [k][j]: plane k nowhere below plane j
    for k in np.nonzero(there)[0].tolist():
        there[k] = not any(above[k][j] for j in np.nonzero(there)[0].tolist() if j != k)
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
    """Planes over axes turned by `angle`; what then faces along an axis but for rounding does so exactly."""
    if angle == 0.0:
        return rows
    c, s = math.cos(angle), math.sin(angle)
    rows = rows @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    for k in range(SIDES):
        if abs(rows[k, 1 - AXIS[k]]) < 1e-8:
            rows[k, 1 - AXIS[k]] = 0.0
    return rows


def moved(side: Side, edge: int, angle: float) -> Side:
    """The side seen from axes turned by `angle`."""
    if angle == 0.0:
        return side
    slope = math.atan(side.lean) + (angle if edge < 2 else -angle)
    scale = math.cos(math.atan(side.lean)) / math.cos(slope)
    return replace(side, at=side.at * scale, lean=math.tan(slope))


def rectangle_of(sides: list[Side], corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest u, v (2,) of the sides in their middle, no further out than the regions' `corners` (n, 2) are."""
    least, most = corners.min(axis=0), corners.max(axis=0)
    middle = 0.5 * (least + most)
    at = [side.at + side.lean * middle[1 - AXIS[k]] for k, side in enumerate(sides)]
    low = np.array([at[k] if sides[k].anchored else max(at[k], least[AXIS[k]]) for k in (0, 2)])
    high = np.array([at[k] if sides[k].anchored else min(at[k], most[AXIS[k]]) for k in (1, 3)])
    narrow = high - low < 1e-3
    return np.where(narrow, least, low), np.where(narrow, most, high)


def ends_moved(
    sides: list[Side], low: np.ndarray, high: np.ndarray, known: bool
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """The rectangle from `low` to `high` (2,) after each of its sides moved by its standard deviation, if that is `known`; or else
    a little, of those that stand where no points tell."""
    middle = 0.5 * (low + high)
    for k, side in enumerate(sides):
        ends = np.array([low, high])
        given = side.anchored or abs(ends[k % 2, AXIS[k]] - side.at - side.lean * middle[1 - AXIS[k]]) > GIVEN_M
        if side.sigma == math.inf and not known:
            ends[k % 2, AXIS[k]] += PROBE_M
            yield ends[0], ends[1]
        elif known and not given and 0.0 < side.sigma < math.inf:
            ends[k % 2, AXIS[k]] += side.sigma
            yield ends[0], ends[1]


def regular(rows: np.ndarray, low: np.ndarray, high: np.ndarray, kappa: float) -> Member:
    """The member over a rectangle with planes `rows` (5, 3), with eaves and an apex in common where they nearly are."""
    return with_one_apex(level(member_of(rows, low, high, kappa)))


def member_of(rows: np.ndarray, low: np.ndarray, high: np.ndarray, kappa: float) -> Member:
    """The member over the rectangle with planes `rows` (5, 3), in the axes they are given in, whose first is at `kappa`."""
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    sides, has = rows[:SIDES], np.isfinite(rows[:SIDES, 2])
    slopes = np.where(has, SIGN * sides[EACH, AXIS], 0.0)
    leans = np.divide(sides[EACH, 1 - AXIS], slopes, out=np.zeros(SIDES), where=has)
    eaves = np.where(has, sides[:, :2] @ centre + sides[:, 2] - slopes * half[AXIS], np.inf)
    top = float(rows[LEVEL, 2]) if np.isfinite(rows[LEVEL, 2]) else math.inf
    return Member(kappa, centre, half, eaves, slopes, top, leans)


def changed(member: Member, changes: np.ndarray) -> list[Member]:
    """The member with its planes changed by each of `changes` (m, 5, 3), its sides where they are."""
    slopes = member.slopes + np.where(member.has, SIGN * changes[:, EACH, AXIS], 0.0)
    middles = np.tile(member.centre, (SIDES, 1))  # of the sides
    middles[EACH, AXIS] -= SIGN * member.half[AXIS]
    eaves = member.eaves + (changes[:, :SIDES, :2] * middles).sum(axis=2) + changes[:, :SIDES, 2]
    tops = member.top + changes[:, LEVEL, 2]
    kappa, centre, half, leans = member.kappa, member.centre, member.half, member.leans
    return [Member(kappa, centre, half, *own, leans) for own in zip(eaves, slopes, tops.tolist(), strict=True)]


def level(member: Member) -> Member:
    """The member with sides moved out to the lowest eave's height where that is near."""
    if not member.has.any():
        return member
    lowest = member.eaves.min()
    further = np.divide(member.eaves - lowest, member.slopes, out=np.full(SIDES, np.inf), where=member.has)
    outwards = np.where(further < LEVEL_EAVE_M, further, 0.0)
    low, high = outwards[[0, 2]], outwards[[1, 3]]
    shift, half = 0.5 * (high - low), member.half + 0.5 * (high + low)
    eaves = member.eaves + member.slopes * (member.leans * shift[1 - AXIS] - outwards)
    near = member.has & (np.abs(eaves - lowest) < 1e-6)
    return replace(member, centre=member.centre + shift, half=half, eaves=np.where(near, lowest, eaves))


def with_one_apex(member: Member) -> Member:
    """A hip whose two pairs of sides meet at nearly the same height with all four meeting in one point, eaves where they are."""
    one, other = member.apex(0), member.apex(1)
    if not (math.isfinite(one) and math.isfinite(other)) or math.isfinite(member.top) or abs(one - other) > APEX_M:
        return member
    if member.leans.any():
        return member
    runs = (np.array([one, one, other, other]) - member.eaves) / member.slopes  # from each eave to the point in plan
    return replace(member, slopes=(0.5 * (one + other) - member.eaves) / runs)
