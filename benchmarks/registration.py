"""Footprints put beside their roofs, whose shift is to be found.

usage: python -m benchmarks.registration [--sets delft amsterdam_west two_epochs essen ...]
                                         [--parity even|odd]

The footprints of each set are shifted by vectors of 0.3 to 3 m in directions drawn by chance. "all"
shifts all of them and estimates their common shift, as a run does before there are work tiles.
"row" shifts one row of touching footprints, "one" a single house: those that stand alone, and those
within a row, which a run must leave where they are.

Printed by distance: how many are found within 0.15 m of the known vector (moved, and to the right
place), and how many are moved to a place more than 0.3 m beside it. At distance 0 every move is
wrong. `--parity` takes every second row.

The thresholds were chosen on the three real sets. The towns are the check: their solids are scanned
at 5 points/m2, and each footprint lies beside its building by a survey error of 0.1 m (one sigma,
either axis).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from hiproof.city.plan.outlines import Outlines, row_outline
from hiproof.fit.align import AROUND_M, find_shift
from hiproof.fit.registration import register
from hiproof.geometry.point_grid import PointGrid
from hiproof.stages.points import distinct

from . import delft
from .tables import FigureTable, make_parser
from .towns import TOWNS, read_town

SETS = ("delft", "amsterdam_west", "two_epochs")
SURVEY_M = 0.1  # Standard deviation of each footprint of a simulated town, along x and y.
TOWN_DENSITY = 5.0  # points/m2
DISTANCES_M = (0.0, 0.3, 0.5, 1.0, 2.0, 3.0)
FOUND_M, WRONG_M = 0.15, 0.3

Polygons = list[shapely.Polygon]
Trial = tuple[Polygons, np.ndarray]  # outlines where the shift puts them, and the shift (2,)


def read_set(name: str) -> tuple[Polygons, np.ndarray]:
    """Return a set's footprints within its cloud, and its roof points (n, 3)."""
    if name in TOWNS:
        return scan_town(name)
    asked = delft.read_set(name)
    points = delft.thin_points(asked.clouds, 1.0)
    cloud = shapely.box(*points[:, :2].min(axis=0), *points[:, :2].max(axis=0)).buffer(1.0)
    polygons = [footprint.polygon for footprint in asked.footprints]
    return [polygon for polygon in polygons if cloud.contains(polygon)], points


def scan_town(name: str) -> tuple[Polygons, np.ndarray]:
    """Return surveyed footprints and points of a simulated town. Walls are included."""
    town, rng = read_town(TOWNS[name]), np.random.default_rng(7)
    polygons = [
        shift_polygons([building.footprint], rng.normal(0.0, SURVEY_M, 2))[0] for building in town
    ]
    return polygons, np.concatenate([building.scan_points(TOWN_DENSITY) for building in town])


def draw_vector(distance: float, number: int) -> np.ndarray:
    """Draw a shift (2,) of a length, its direction by number."""
    azimuth = np.random.default_rng([number, 7]).uniform(-math.pi, math.pi)
    return distance * np.array([math.cos(azimuth), math.sin(azimuth)])


def shift_polygons(polygons: Polygons, vector: np.ndarray) -> Polygons:
    return list(shapely.transform(np.array(polygons), lambda xy: xy + vector))


def find_row_shift(row: Polygons, grid: PointGrid, points: np.ndarray) -> np.ndarray:
    """Return a run's shift (2,) of a row, zero without clear evidence."""
    outline = row_outline(row)
    origin = np.floor(outline.bounds[:2])
    nearby = distinct(points[grid.find_within(outline, AROUND_M)])
    shift = find_shift(nearby[:, :2] - origin, shapely.transform(outline, lambda xy: xy - origin))
    return shift.xy if shift.is_clear else np.zeros(2)


def iterate_trials(
    kind: str, polygons: Polygons, distance: float, parity: str | None
) -> Iterator[Trial]:
    """Yield rows as a run sees them, and the vector by which a house is off."""
    outlines = Outlines(polygons)
    rows = [numbers.tolist() for numbers in outlines.members]
    for number, members in enumerate(rows):
        if parity is not None and number % 2 != (parity == "odd"):
            continue
        offset = draw_vector(distance, number)
        if kind == "row":
            yield shift_polygons([polygons[i] for i in members], offset), offset
        elif kind in ("one alone", "one of a row") and (len(members) == 1) == (kind == "one alone"):
            house = members[len(members) // 2]
            moved_row = [
                shift_polygons([p], offset)[0] if i == house else p for i, p in enumerate(polygons)
            ]
            yield Outlines(moved_row).row(house), offset


def make_cells(outcomes: list[tuple[np.ndarray, np.ndarray]]) -> list[str]:
    """Return the figures of some trials: shifts found (2,) and vectors (2,)."""
    distances = np.array([np.hypot(*(result + shifted)) for result, shifted in outcomes])
    moved = np.array([bool(result.any()) for result, _ in outcomes])
    right, wrong = moved & (distances < FOUND_M), moved & (distances > WRONG_M)
    shares = (f"{100 * share.mean():.0f}" for share in (moved, right, wrong))
    return [str(len(outcomes)), *shares]


def main() -> None:
    parser = make_parser(__doc__, parity=None)
    parser.add_argument("--sets", nargs="+", choices=[*SETS, *TOWNS], default=list(SETS))
    a = parser.parse_args()
    columns = ("set", "kind", "off, m", "trials", "moved, %", "found, %", "moved wrongly, %")
    with FigureTable(a.record, *columns) as table:
        for name in a.sets:
            polygons, points = read_set(name)
            grid = PointGrid(points)
            for number, distance in enumerate(DISTANCES_M):
                difference = draw_vector(distance, 100 + number)
                result = register([(points[:, :2], shift_polygons(polygons, difference))])
                off = f"{np.hypot(*(result.xy + difference)):.3f} m from the vector"
                moved = "moved" if result.is_clear else "left"
                sigma = f"sigma {max(result.sigma):.3f} m"
                table.add(name, "all", distance, len(polygons), moved, off, sigma)
            for kind in ("row", "one alone", "one of a row"):
                for distance in DISTANCES_M:
                    outcomes = [
                        (find_row_shift(row, grid, points) if row else np.zeros(2), difference)
                        for row, difference in iterate_trials(kind, polygons, distance, a.parity)
                    ]
                    if outcomes:
                        table.add(name, kind, distance, *make_cells(outcomes))


if __name__ == "__main__":
    main()
