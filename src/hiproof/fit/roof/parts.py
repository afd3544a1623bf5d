"""Name planes and sides as parts: each is a member of the family of roof shapes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import shapely

from ...frames import PlanFrame
from ...model import Part
from ...primitives.family import SIGN, Member, name_among
from ..candidates.volumes import LEVEL, N_SIDES

LEVEL_EAVE_M = 0.5  # An eave that would be level with its side so little (m) further out is level.
# Share of the half of its rectangle by which a hidden side may move to where its eave is level.
HIDDEN_SHARE = 0.8
APEX_M = 0.15  # A hip whose pairs of sides meet at heights so near each other (m) is a pyramid.
STRAIGHT = 1e-9  # Directions (rad) that differ less are numerically the same.
GIVEN_M = 1e-3  # A rectangle's end further (m) from its side lies on the outline that cuts it off.
PROBE_M = 0.01  # Distance (m) that an end is moved to see which parameters depend on it.


@dataclass(frozen=True)
class Side:
    """A line x = offset + lean * y in the axes of its volume's direction.

    x is across the side, y along it. If it is `anchored` to the outline, or to what cuts it off,
    its eave is there. `sigma` (m) is the standard deviation of its place. It is 0 where the outline
    gives the place, and infinite where no points determine it or other volumes hide it.
    """

    offset: float
    lean: float = 0.0
    anchored: bool = False
    sigma: float = 0.0


class OutlineWall(NamedTuple):
    """A wall of the outline in a volume's axes.

    `facing` is the way that it faces outwards (rad), and `offset` how far out that way from the
    origin it lies (m).
    """

    facing: float
    offset: float


@dataclass(frozen=True)
class Planes:
    """A volume's planes by place: left, right, front, back, top, over each of `walls`.

    `rows` (k, 3) are a, b, c of z = a u + b v + c, NaN where it has none. They are `design`
    (k, 3, p) times p unknowns with this `covariance` (p, p).
    """

    rows: np.ndarray
    design: np.ndarray
    covariance: np.ndarray
    walls: tuple[OutlineWall, ...] = ()

    @property
    def modes(self) -> np.ndarray:
        """Independent changes (k, 3, p) of the rows, of one standard deviation each."""
        variances, axes = np.linalg.eigh(self.covariance)
        return self.design @ (axes * np.sqrt(np.maximum(variances, 0.0)))


def name_planes(
    planes: Planes,
    sides: list[Side],
    axes: np.ndarray,
    regions: list[shapely.Polygon],
    frame: PlanFrame,
    allowed: tuple[str, ...] = (),
) -> Part:
    """Name planes and sides over `regions` (local coordinates) as a part of the family.

    `axes` (2, 2) are those of the planes and sides in local coordinates, about the frame's origin.
    """
    corners = shapely.get_coordinates(regions) - frame.origin[:2]
    positions = np.column_stack([corners @ axes.T, np.ones(len(corners))])
    is_visible = find_visible_planes(planes.rows, positions)[:, None]
    rows = np.where(is_visible, planes.rows + [0.0, 0.0, frame.origin[2]], np.nan)
    ends = measure_rectangle(sides, corners @ axes.T)
    known_ends, probed_ends = list_moved_ends(sides, ends)
    count = 2 + planes.covariance.shape[0]
    trial_ends = np.array([ends] * count + known_ends + probed_ends).T
    all_rows = np.repeat(rows[:, :, None], trial_ends.shape[1], axis=2)
    all_rows[:, :, 2:count] += planes.modes
    hidden = [k for k, side in enumerate(sides) if side.sigma == math.inf and not side.anchored]
    members = regularise(
        all_rows, trial_ends, math.atan2(axes[0, 1], axes[0, 0]), planes.walls, hidden, count
    )
    member = members.those(0)
    turns = member.quarter_turns
    changes = members.those(list(range(1, trial_ends.shape[1]))).turn(turns)
    member = replace(member.turn(turns), centre=member.centre @ axes + frame.origin[:2])
    return member.part(regions, name_among(member.name, allowed), changes, len(probed_ends))


def find_visible_planes(rows: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return which planes (k,) are not everywhere above some single other one.

    `positions` (n, 3) are u, v, 1 of the regions' corners. If only planes over walls are visible,
    the lowest other plane stays: a shape has one.
    """
    is_visible = np.isfinite(rows[:, 2])
    if is_visible.sum() < 2:
        return is_visible
    z = rows @ positions.T
    # In [k][j], plane k is nowhere below plane j.
    is_above = (z[None] <= z[:, None] + 1e-9).all(axis=2).tolist()
    for k in np.nonzero(is_visible)[0].tolist():
        is_visible[k] = not any(
            is_above[k][j] for j in np.nonzero(is_visible)[0].tolist() if j != k
        )
    if not is_visible[: LEVEL + 1].any():
        is_visible[np.nanargmin(z[: LEVEL + 1].mean(axis=1))] = True
    return is_visible


def measure_rectangle(sides: list[Side], corners: np.ndarray) -> list[float]:
    """Return the lowest and highest u and v of the sides in their middle.

    They lie no further out than the regions' `corners` (n, 2).
    """
    lowest_corner, highest_corner = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    ends = []
    for axis in (0, 1):
        lower_side, upper_side = sides[2 * axis], sides[2 * axis + 1]
        middle = 0.5 * (lowest_corner[1 - axis] + highest_corner[1 - axis])
        start, end = (
            lower_side.offset + lower_side.lean * middle,
            upper_side.offset + upper_side.lean * middle,
        )
        start = start if lower_side.anchored else max(start, lowest_corner[axis])
        end = end if upper_side.anchored else min(end, highest_corner[axis])
        ends += [lowest_corner[axis], highest_corner[axis]] if end - start < 1e-3 else [start, end]
    return ends


def list_moved_ends(
    sides: list[Side], ends: list[float]
) -> tuple[list[list[float]], list[list[float]]]:
    """List the `ends` of a rectangle after moves of its sides.

    These are the lowest and highest u, v. The first list has each side moved by its standard
    deviation, the second each side that no points determine, moved a little.
    """
    middle, known_ends, probed_ends = (0.5 * (ends[0] + ends[1]), 0.5 * (ends[2] + ends[3])), [], []
    for k, side in enumerate(sides):
        is_given = abs(ends[k] - side.offset - side.lean * middle[1 - k // 2]) > GIVEN_M
        if side.sigma == math.inf:
            probed_ends.append([*ends[:k], ends[k] + PROBE_M, *ends[k + 1 :]])
        elif not is_given and side.sigma > 0.0:
            known_ends.append([*ends[:k], ends[k] + side.sigma, *ends[k + 1 :]])
    return known_ends, probed_ends


def regularise(
    rows: np.ndarray,
    ends: np.ndarray,
    kappa: float,
    walls: tuple[OutlineWall, ...] = (),
    hidden: Sequence[int] = (),
    n_alike: int = 1,
) -> Member:
    """Make members over m rectangles with common eaves and apex where these are near.

    `ends` (4, m) are the lowest and highest u, v, and `rows` (5 and those over `walls`, 3, m) the
    planes, which all have the same sides. The first axis is at `kappa`. A side that lies `hidden`
    takes the eave of the others, too. The first `n_alike` members have one rectangle and move its
    sides alike, but for the second: it stays as its planes and its rectangle are.
    """
    centre, half = 0.5 * (ends[::2] + ends[1::2]), 0.5 * (ends[1::2] - ends[::2])
    planes = np.flatnonzero(np.isfinite(rows[: LEVEL + 1, 2, 0])).tolist()
    sides, count = [k for k in planes if k < N_SIDES], rows.shape[2]
    eaves, slopes, leans = (
        np.full((N_SIDES, count), np.inf),
        np.zeros((N_SIDES, count)),
        np.zeros((N_SIDES, count)),
    )
    for k in sides:
        axis = k // 2
        slopes[k] = SIGN[k] * rows[k, axis]
        leans[k] = rows[k, 1 - axis] / slopes[k]
        eaves[k] = (
            rows[k, 0] * centre[0] + rows[k, 1] * centre[1] + rows[k, 2] - slopes[k] * half[axis]
        )
    top = rows[LEVEL, 2] if LEVEL in planes else np.full(count, np.inf)
    if sides:
        centre, half, eaves = level_eaves(
            centre, half, eaves, slopes, leans, sides, hidden, n_alike
        )
    return join_apex(
        Member(
            kappa,
            centre,
            half,
            eaves,
            slopes,
            top,
            leans,
            measure_cants(rows[LEVEL + 1 :], walls, centre),
        ),
        n_alike,
    )


def measure_cants(
    rows: np.ndarray, walls: tuple[OutlineWall, ...], centre: np.ndarray
) -> np.ndarray:
    """Return the cants (4, c, m) of members about `centre` (2, m).

    Their planes over `walls` are `rows` (n, 3, m), NaN where one is not visible.
    """
    cants = []
    for wall, row in zip(walls, rows, strict=True):
        out = wall.offset - math.cos(wall.facing) * centre[0] - math.sin(wall.facing) * centre[1]
        cants.append(
            [np.full_like(out, wall.facing), out, *measure_eave(row, wall.facing, out, centre)]
        )
    visible_cants = [cant for cant in cants if np.isfinite(cant[3]).all()]
    return np.array(visible_cants).reshape(-1, 4, centre.shape[1]).swapaxes(0, 1)


def measure_eave(plane: np.ndarray, facing: float, out: Any, centre: np.ndarray) -> tuple[Any, Any]:
    """Return the height of a plane a, b, c (3, m) at a wall, and its slope there.

    The wall lies so far `out` from `centre`, and faces that way.
    """
    (a, b, z), c, s = plane, math.cos(facing), math.sin(facing)
    return a * (centre[0] + out * c) + b * (centre[1] + out * s) + z, -c * a - s * b


def level_eaves(
    centre: np.ndarray,
    half: np.ndarray,
    eaves: np.ndarray,
    slopes: np.ndarray,
    leans: np.ndarray,
    sides: list[int],
    hidden: Sequence[int],
    n_alike: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Move `sides` out to the lowest eave's height, where that is near.

    Returns centres and halves (2, m) and eaves (4, m) of the members. Sides that lie `hidden` under
    other parts have no known place, and move from far, and inwards as well.
    """
    given_sides = [k for k in sides if k not in hidden] or sides
    outwards, eaves = np.zeros_like(eaves), eaves.copy()
    lowest = eaves[given_sides].min(axis=0)
    for k in given_sides:
        further = (eaves[k] - lowest) / slopes[k]
        outwards[k] = np.where(further < LEVEL_EAVE_M, further, 0.0)
        outwards[k, 1:n_alike] = outwards[k, 0]
        outwards[k, 1:2] = 0.0
    lower_eaves = (eaves - slopes * outwards)[given_sides, 1:n_alike]
    lowest[1:n_alike] = lower_eaves.min(axis=0)
    for k in sides:
        if k not in given_sides:
            further = (eaves[k] - lowest) / slopes[k]
            outwards[k] = np.where(np.abs(further) < HIDDEN_SHARE * half[k // 2], further, 0.0)
    low_shift, high_shift = outwards[::2], outwards[1::2]
    shift = 0.5 * (high_shift - low_shift)
    for k in sides:
        lower = eaves[k] + slopes[k] * (leans[k] * shift[1 - k // 2] - outwards[k])
        eaves[k] = np.where(np.abs(lower - lowest) < 1e-6, lowest, lower)
    return centre + shift, half + 0.5 * (high_shift + low_shift), eaves


def join_apex(members: Member, n_alike: int) -> Member:
    """Let the four planes of a hip meet in one point, if two pairs nearly do.

    The eaves stay.
    """
    if not all(members.has) or members.has_top:
        return members
    apex, other_apex = members.apex(0), members.apex(1)
    is_near = (np.abs(apex - other_apex) <= APEX_M) & ~members.leans.any(axis=0)
    is_near[1:n_alike] = is_near[0]
    is_near[1:2] = False
    # A run is the distance from an eave to the point in plan.
    runs = (np.stack([apex, apex, other_apex, other_apex]) - members.eaves) / members.slopes
    return replace(
        members,
        slopes=np.where(
            is_near, (0.5 * (apex + other_apex) - members.eaves) / runs, members.slopes
        ),
    )
