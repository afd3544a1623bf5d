"""From plan cells to a closed shell: roof faces over the cells, closed down to a level ground."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import CompositionError
from ..model import ROOF, Solid
from .arrangement import GRID_M, OUTSIDE, PlanCells, heights
from .cells import PlanProblem
from .levels import Levels, find_saddles, split_at_crossings, stack_levels
from .lids import Lid, close_lids, draw_base, join_straight_edges, list_rings

SETBACK_M = 0.01  # m that a crosswise corner is cut back by; ten times what makes two points one


class Saddles(Exception):
    """Plan vertices around which the solid is no manifold.

    Levels rise and fall twice around each, or a cell meets itself there. `patches` (soup, label)
    are the cures.
    """

    def __init__(self, patches: list[tuple[np.ndarray, int]]):
        super().__init__("the roof's levels form a checkerboard around a vertex")
        self.patches = patches


def raise_shell(
    cells: PlanCells,
    problem: PlanProblem,
    z_ground: float,
    clearance_m: float,
    merges_walls: bool,
    reach: float,
    widening: float,
) -> Solid:
    """Raise the solid over the plan cells.

    Raises Saddles where the problem needs a patch first, CompositionError where none helps. The
    ground is lowered where needed to stay `clearance_m` under the lowest roof vertex. With
    `merges_walls`, consecutive walls along a straight stretch of the outline become one. Vertices
    keep the `reach` (grid units). Patches are wider by the factor `widening`.
    """
    planes = problem.planes
    cells, ties = split_at_crossings(cells, planes, reach)
    if len(cells.edges) == 0:
        raise CompositionError(
            "expected an outline with an area, got one thinner than a millimetre; repair or remove "
            "the footprint"
        )
    label = cells.side.ravel()
    x, y = np.moveaxis(cells.xy[np.repeat(cells.edges, 2, axis=0)], -1, 0)
    z_low = heights(planes[label, None], x, y)[label != OUTSIDE].min() - clearance_m / GRID_M
    z_base = np.floor(min(z_ground / GRID_M, z_low))
    levels = stack_levels(cells, planes, z_base, ties)
    saddles = find_saddles(cells, levels)
    if len(saddles):
        radius = max(SETBACK_M / GRID_M, 4 * reach) * widening
        raise Saddles([cure(sectors_at(v, cells, levels), radius) for v in saddles])
    roofs = draw_roofs(label, levels, problem.part)
    ground = draw_base(roofs, int(z_base))
    return close_lids([*roofs, join_straight_edges(ground) if merges_walls else ground])


def draw_roofs(label: np.ndarray, levels: Levels, part: np.ndarray) -> list[Lid]:
    """Draw a roof face a cell, its `label` (2e,) by half-edge, over the levels of its corners."""
    face = levels.face.tolist()
    corners = levels.vertices[levels.level].astype(np.int64).tolist()
    z_of = {(cell, x, y): z for cell, (x, y, z) in zip(face, corners, strict=True)}
    roofs = {cell: k for cell, k in zip(face, label.tolist(), strict=True) if k != OUTSIDE}
    return [
        Lid(
            [
                [(x, y, z_of[cell, x, y]) for x, y in ring]
                for ring in list_rings(levels.polygons[cell - 1])
            ],
            ROOF,
            int(part[k]),
        )
        for cell, k in roofs.items()
    ]


@dataclass(frozen=True)
class Sectors:
    """The cells around a plan vertex, counter-clockwise; sector k begins at arm k."""

    corner: np.ndarray
    angle: list[float]
    opening: list[float]
    level: list[int]
    face: list[int]
    label: list[int]

    def runs(self, same: list[int]) -> list[tuple[int, int]]:
        """Return (first sector, number) of the runs of equal values."""
        size = len(same)
        first = [k for k in range(size) if same[k] != same[k - 1]]
        return [(k, (first[(i + 1) % len(first)] - k - 1) % size + 1) for i, k in enumerate(first)]

    def width(self, run: tuple[int, int]) -> float:
        return sum(self.opening[(run[0] + j) % len(self.opening)] for j in range(run[1]))

    def tip(self, run: tuple[int, int], radius: float) -> np.ndarray:
        """Return the edges (m, 4) of the wedge, `radius` grid units long, over sectors of a run."""
        width = self.width(run)
        steps = (
            np.linspace(0, width, max(2, math.ceil(width / (np.pi / 3)) + 1)) + self.angle[run[0]]
        )
        tips = np.rint(self.corner + radius * np.column_stack((np.cos(steps), np.sin(steps))))
        polygon = np.vstack((self.corner, tips))
        return np.hstack((polygon, np.roll(polygon, -1, axis=0)))


def sectors_at(v: int, cells: PlanCells, levels: Levels) -> Sectors:
    """Return the sectors around plan vertex v."""
    surroundings = levels.order[cells.edges.ravel()[levels.order] == v]
    ends = cells.edges[surroundings >> 1, 1 - (surroundings & 1)]
    arms = (cells.xy[ends] - cells.xy[v]).astype(float)
    angle = np.arctan2(arms[:, 1], arms[:, 0])
    opening = np.mod(np.roll(angle, -1) - angle, 2 * np.pi)
    own = (levels.level, levels.face, cells.side.ravel())
    values = angle, opening, *(values[surroundings] for values in own)
    return Sectors(cells.xy[v].astype(float), *(array.tolist() for array in values))


def cure(sectors: Sectors, radius: float) -> tuple[np.ndarray, int]:
    """Return a patch (soup, label) for a vertex that is no manifold.

    It gives the tip of the narrowest peak to the higher neighbour. Raises CompositionError if none
    mends it. Where no levels cross but a cell meets itself, the tip of what lies between its two
    arms goes to that cell.
    """
    size = len(sectors.level)
    peaks = []
    for first, count in sectors.runs(sectors.level):
        previous, following = first - 1, (first + count) % size
        if max(sectors.level[previous], sectors.level[following]) < sectors.level[first]:
            higher = previous if sectors.level[previous] >= sectors.level[following] else following
            peaks.append((sectors.width((first, count)), (first, count), sectors.label[higher]))
    if len(peaks) < 2:
        peaks = pinches(sectors)
    if not peaks:
        raise CompositionError(
            "expected levels that can be told apart around every corner, got a corner that has none"
        )
    _, run, label = min(peaks)
    return sectors.tip(run, radius), label


def pinches(sectors: Sectors) -> list[tuple[float, tuple[int, int], int]]:
    """Return (width, run, label) of what a cell that meets itself encloses, where roofed."""
    result = []
    for cell in {
        face for face, label in zip(sectors.face, sectors.label, strict=True) if label != OUTSIDE
    }:
        runs = sectors.runs([int(face == cell) for face in sectors.face])
        selected_runs = [run for run in runs if sectors.face[run[0]] != cell]
        if len(selected_runs) < 2:
            continue
        label = sectors.label[sectors.face.index(cell)]
        for first, count in selected_runs:
            roofed = all(
                sectors.label[(first + j) % len(sectors.label)] != OUTSIDE for j in range(count)
            )
            if roofed:
                result.append((sectors.width((first, count)), (first, count), label))
    return result
