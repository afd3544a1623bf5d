"""Name volumes as parts: each is a member of the family of roof shapes.

What is equal is read off the numbers that planes share. A part's deviations follow from the
unknowns' covariance and from those of the sides' places.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from ...frames import PlanFrame
from ...model import Part
from ...primitives.family import name_among
from ..union.finish import OutlineWall
from ..union.names import (
    GIVEN_M,
    RAISED,
    REGISTERED_PLAN_M,
    STRAIGHT,
    find_visible_planes,
    list_moved_ends,
    measure_common_lean,
    measure_rectangle,
    regularise,
    turn_planes,
    turn_side,
    vary_member,
)
from ..union.sides import Side
from ..union.volumes import LEVEL
from .tables import N_SIDES, UNKNOWN_COUNT, Tables, read_line

FACED = 0.9  # Cosine of the angle up to which a plane faces one of four axes.


@dataclass(frozen=True)
class PlaceRows:
    """A volume's planes by place: left, right, front, back, top, over each of `walls`.

    `rows` (k, 3) are a, b, c of z = a u + b v + c, NaN where it has none. They are `design`
    (k, 3, u) times the unknowns.
    """

    rows: np.ndarray
    design: np.ndarray
    walls: tuple[OutlineWall, ...] = ()


def find_axes(roof: Tables, k: int) -> np.ndarray:
    """Return the axes (2, 2) of volume k: along the first of its planes, else of its sides."""
    sloping = np.flatnonzero(roof.slopes[k, : roof.n_planes[k]] >= 0)
    lines = roof.plane_lines[k, sloping] if len(sloping) else roof.sides[k, 2:]
    a, b, _ = read_line(roof, lines[0])
    angle = math.remainder(math.atan2(b, a), 0.5 * math.pi)
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s], [-s, c]])


def read_planes(roof: Tables, k: int, axes: np.ndarray) -> PlaceRows:
    """Return the planes of volume k in its axes."""
    n_unknowns = roof.counts[UNKNOWN_COUNT]
    walls: list[OutlineWall] = []
    rows = np.full((N_SIDES + 1, 3), np.nan)
    design = np.zeros((N_SIDES + 1, 3, n_unknowns))
    for p in range(roof.n_planes[k]):
        a, b, c = read_line(roof, roof.plane_lines[k, p])
        u, v = (x if abs(x) > STRAIGHT else 0.0 for x in (axes @ [a, b]).tolist())
        place = LEVEL if roof.slopes[k, p] < 0 else find_place(u, v)
        if place < 0 or np.isfinite(rows[place, 2]):
            walls.append(OutlineWall(math.atan2(-v, -u), c))
            rows, design = (
                np.concatenate([x, np.zeros((1, *x.shape[1:]))]) for x in (rows, design)
            )
            place = len(rows) - 1
        slope = roof.values[roof.slopes[k, p]] if roof.slopes[k, p] >= 0 else 0.0
        rows[place] = [slope * u, slope * v, roof.planes[k, p, 2]]
        design[place, 2, roof.heights[k, p]] = 1.0
        if roof.slopes[k, p] >= 0:
            design[place, :, roof.slopes[k, p]] += [u, v, c]
    return PlaceRows(rows, design, tuple(walls))


def find_place(u: float, v: float) -> int:
    """Return which of the four sides a plane rises from that faces along u, v; -1 for none."""
    along = [u, -u, v, -v]
    place = max(range(N_SIDES), key=along.__getitem__)
    return place if along[place] > FACED else -1


def read_sides(
    roof: Tables, k: int, axes: np.ndarray, anchored: Sequence[bool], sigma
) -> list[Side]:
    """Return the sides of volume k by place in its axes."""
    sides = [Side(0.0)] * N_SIDES
    for s in range(N_SIDES):
        a, b, c = read_line(roof, roof.sides[k, s])
        u, v = (axes @ [a, b]).tolist()
        along = [u, -u, v, -v]
        place = max(range(N_SIDES), key=along.__getitem__)
        x, y = (u, v) if place < 2 else (v, u)
        sides[place] = Side(-c / x, -y / x, bool(anchored[s]), float(sigma[s]))
    return sides


def cut_sides(sides: list[Side], corners: np.ndarray) -> list[Side]:
    """Return sides of which those beyond the `corners` (n, 2) of a place end there."""
    lowest, highest = corners.min(axis=0), corners.max(axis=0)
    ends = [lowest[0], highest[0], lowest[1], highest[1]]
    return [
        side
        if (1 if k % 2 else -1) * (end - side.offset - side.lean * corners[:, 1 - k // 2].mean())
        > -GIVEN_M
        else Side(float(end))
        for k, (side, end) in enumerate(zip(sides, ends, strict=True))
    ]


def name_part(
    planes: PlaceRows,
    sides: list[Side],
    axes: np.ndarray,
    regions: list[shapely.Polygon],
    covariance: np.ndarray,
    frame: PlanFrame,
    allowed: tuple[str, ...] = (),
) -> Part:
    """Name a volume over its `regions` (plan coordinates) as a part of the family.

    It has a name of `allowed` types if possible.
    """
    corners = shapely.get_coordinates(regions)
    positions = np.column_stack([corners @ axes.T, np.ones(len(corners))])
    rows = np.where(find_visible_planes(planes.rows, positions)[:, None], planes.rows, np.nan)
    registrations = measure_registration(planes, rows, positions)
    turn = measure_common_lean(rows)
    axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]]) @ axes
    rows = turn_planes(rows, turn) + [0.0, 0.0, frame.origin[2]]
    sides = [turn_side(side, k, turn) for k, side in enumerate(sides)]
    ends = measure_rectangle(sides, corners @ axes.T)
    known_ends, probed_ends = list_moved_ends(sides, ends)
    trial_ends = np.array([ends, ends, ends, *known_ends, *probed_ends]).T
    all_rows = np.repeat(rows[:, :, None], trial_ends.shape[1], axis=2)
    all_rows[:, :, 1:3] += turn_planes(registrations, turn)
    walls = tuple(wall._replace(facing=wall.facing - turn) for wall in planes.walls)
    hidden = [k for k, side in enumerate(sides) if side.sigma == math.inf and not side.anchored]
    local_axes = axes @ frame.rotation
    kappa = math.atan2(local_axes[0, 1], local_axes[0, 0])
    members = regularise(all_rows, trial_ends, kappa, walls, hidden)
    member = members.those(0)
    turns = member.quarter_turns
    modes = np.concatenate(
        [turn_planes(measure_modes(planes, covariance), turn), np.tile(RAISED, (len(rows), 1, 1))],
        axis=2,
    )
    is_given = np.isfinite(rows[:, 2]) | (np.arange(len(rows)) <= LEVEL)  # visible cants only
    changes = vary_member(members, modes[is_given]).turn(turns)
    centre = member.centre @ local_axes + frame.origin[:2]
    member = replace(member.turn(turns), centre=centre)
    outlines = [shapely.transform(region, frame.xy_local) for region in regions]
    return member.part(outlines, name_among(member.name, allowed), changes, len(probed_ends))


def measure_modes(planes: PlaceRows, covariance: np.ndarray) -> np.ndarray:
    """Return independent changes (k, 3, p) of planes, of one standard deviation each."""
    used = np.flatnonzero(planes.design.any(axis=(0, 1)))
    variances, vectors = np.linalg.eigh(covariance[np.ix_(used, used)])
    return planes.design[:, :, used] @ (vectors * np.sqrt(np.maximum(variances, 0.0)))


def measure_registration(planes: PlaceRows, rows: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Return by how much (k, 3, 2) planes change if their swath lies off.

    It is off by a standard deviation along u or along v. The visible planes (`rows`) are tied to
    sides of the outline, and move over the corners `positions` (n, 3), u, v, 1, as far as these
    ties allow.
    """
    is_present = np.isfinite(rows[:, 2])
    if not rows[is_present, :2].any():  # level planes do not change
        return np.zeros((len(rows), 3, 2))
    used = np.flatnonzero(planes.design.any(axis=(0, 1)))
    design = planes.design[:, :, used]
    moved = (positions @ design[is_present]).reshape(-1, len(used))
    shifted = -REGISTERED_PLAN_M * rows[is_present, :2].repeat(len(positions), axis=0)
    return design @ np.linalg.lstsq(moved, shifted, rcond=None)[0]
