"""From volumes to named parts: each a member of the family of roof shapes."""

from __future__ import annotations

import math
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
    modes = np.concatenate([turned(planes.modes, turn), np.tile((0.0, 0.0, REGISTERED_M), (1, SIDES + 1, 1))])
    known, unknown = (ends_moved(sides, low, high, known) for known in (True, False))
    ends = np.array([(low, high), (low, high), (low, high), *known, *unknown])
    every = np.tile(rows, (len(ends), 1, 1))
    every[1:3] += turned(registrations, turn)
    member, *others = regular(every, ends, kappa)
    told, turns = len(registrations) + len(known), member.quarter_turns
    changes = [own.turned(turns) for own in changed(member, modes) + others[:told]]
    member = replace(member.canonical(), centre=member.centre @ axes + plan.frame.origin[:2])
    part = member.part(regions, name_among(member.name, allowed), changes)
    untold = member.sigma([own.turned(turns) for own in others[told:]], part.type == member.name)
    return replace(part, sigma={name: value for name, value in part.sigma.items() if name not in untold})


def registered(planes: Planes, rows: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """By how much (2, 5, 3) planes change were their points' swath to lie further along u or along v by a standard deviation: as those
    that show (`rows`) can over `corners` (n, 2), tied to sides of the outline as they are."""
    there, at = np.isfinite(rows[:, 2]), np.column_stack([corners, np.ones(len(corners))])
    design = (at @ planes.design[there]).reshape(there.sum() * len(at), planes.design.shape[2])
    shifted = -REGISTERED_PLAN_M * rows[there, :2].repeat(len(corners), axis=0)
    unknowns = np.linalg.lstsq(design, shifted, rcond=None)[0]
    return np.moveaxis(planes.design @ unknowns, 2, 0)


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
    """Planes (..., 5, 3) over axes turned by `angle`; what then faces along an axis but for rounding does so exactly."""
    if angle == 0.0:
        return rows
    c, s = math.cos(angle), math.sin(angle)
    rows = rows @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    along = rows[..., EACH, 1 - AXIS]
    rows[..., EACH, 1 - AXIS] = np.where(np.abs(along) < 1e-8, 0.0, along)
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


def ends_moved(sides: list[Side], low: np.ndarray, high: np.ndarray, known: bool) -> list[np.ndarray]:
    """The lowest and highest u, v (2, 2) of the rectangle from `low` to `high` (2,) after each of its sides moved by its standard deviation, if that is `known`; or else
    a little, of those that stand where no points tell."""
    middle, found = 0.5 * (low + high), []
    for k, side in enumerate(sides):
        ends = np.array([low, high])
        given = side.anchored or abs(ends[k % 2, AXIS[k]] - side.at - side.lean * middle[1 - AXIS[k]]) > GIVEN_M
        if side.sigma == math.inf and not known:
            ends[k % 2, AXIS[k]] += PROBE_M
            found.append(ends)
        elif known and not given and 0.0 < side.sigma < math.inf:
            ends[k % 2, AXIS[k]] += side.sigma
            found.append(ends)
    return found


def regular(rows: np.ndarray, ends: np.ndarray, kappa: float) -> list[Member]:
    """Members over m rectangles, lowest and highest u, v `ends` (m, 2, 2), with planes `rows` (m, 5, 3), which all have the same sides,
    in axes of which the first is at `kappa`: with eaves and an apex in common where they nearly are."""
    centre, half = 0.5 * (ends[:, 0] + ends[:, 1]), 0.5 * (ends[:, 1] - ends[:, 0])
    sides, has = rows[:, :SIDES], np.isfinite(rows[:, :SIDES, 2])
    slopes = np.where(has, SIGN * sides[:, EACH, AXIS], 0.0)
    leans = np.divide(sides[:, EACH, 1 - AXIS], slopes, out=np.zeros_like(slopes), where=has)
    middles = (sides[:, :, :2] * centre[:, None]).sum(axis=2)
    eaves = np.where(has, middles + sides[:, :, 2] - slopes * half[:, AXIS], np.inf)
    centre, half, eaves = level(centre, half, eaves, slopes, leans)
    tops = np.where(np.isfinite(rows[:, LEVEL, 2]), rows[:, LEVEL, 2], np.inf).tolist()
    members = zip(centre, half, eaves, slopes, tops, leans, strict=True)
    return [with_one_apex(Member(kappa, *member)) for member in members]


def changed(member: Member, changes: np.ndarray) -> list[Member]:
    """The member with its planes changed by each of `changes` (m, 5, 3), its sides where they are."""
    slopes = member.slopes + np.where(member.has, SIGN * changes[:, EACH, AXIS], 0.0)
    middles = np.tile(member.centre, (SIDES, 1))  # of the sides
    middles[EACH, AXIS] -= SIGN * member.half[AXIS]
    eaves = member.eaves + (changes[:, :SIDES, :2] * middles).sum(axis=2) + changes[:, :SIDES, 2]
    tops = member.top + changes[:, LEVEL, 2]
    kappa, centre, half, leans = member.kappa, member.centre, member.half, member.leans
    return [Member(kappa, centre, half, *own, leans) for own in zip(eaves, slopes, tops.tolist(), strict=True)]


def level(
    centre: np.ndarray, half: np.ndarray, eaves: np.ndarray, slopes: np.ndarray, leans: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Centres and halves (m, 2) and eaves (m, 4) of members with sides moved out to the lowest eave's height where that is near."""
    has, lowest = np.isfinite(eaves), eaves.min(axis=1, keepdims=True)
    if not has.any():
        return centre, half, eaves
    further = np.divide(eaves - lowest, slopes, out=np.full_like(eaves, np.inf), where=has)
    outwards = np.where(further < LEVEL_EAVE_M, further, 0.0)
    low, high = outwards[:, [0, 2]], outwards[:, [1, 3]]
    shift = 0.5 * (high - low)
    lower = eaves + slopes * (leans * shift[:, 1 - AXIS] - outwards)
    near = has & (np.abs(lower - lowest) < 1e-6)
    return centre + shift, half + 0.5 * (high + low), np.where(near, lowest, lower)


def with_one_apex(member: Member) -> Member:
    """A hip whose two pairs of sides meet at nearly the same height with all four meeting in one point, eaves where they are."""
    if not member.has.all() or math.isfinite(member.top) or member.leans.any():
        return member
    one, other = member.apex(0), member.apex(1)
    if abs(one - other) > APEX_M:
        return member
    runs = (np.array([one, one, other, other]) - member.eaves) / member.slopes  # from each eave to the point in plan
    return replace(member, slopes=(0.5 * (one + other) - member.eaves) / runs)
