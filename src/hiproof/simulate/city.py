"""A simulated city of any size, made tile by tile.

Street blocks of houses and works stand on hills, and are surveyed from the air.

Every block is drawn from a seed of its own, so a tile needs only the blocks that reach into it:
memory stays that of one tile, and a tile is the same whatever else is made.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import InputError, OutputError
from ..frames import Box, turn_points
from .relief import Relief
from .roofs import SimBuilding
from .scanner import ScanSettings
from .survey import Flight, divide_into_patches, survey, write_footprints, write_laz
from .town import TOWN, Lot, furnish_lot, street_side

CITY_ORIGIN_XY = np.array([95000.0, 455000.0])
GROUND_BORDER_M = 15.0  # m, heights of hills over valleys
# rad; streets along no axis, so that nothing leans on the axes by chance
HEADING = math.radians(11.0)
CITY_BLOCK_M = np.array([100.0, 64.0])
STREET_M = 10.0  # m between blocks, pavements included
BUILDINGS_A_BLOCK = 9.6  # on average, from which a city's number of blocks is told
WORKS_SHARE = 0.12  # of the blocks hold works instead of houses, as at a town's edge
SURROUNDINGS_M = 30.0  # m beyond a tile in which houses may throw shadows or trees into it
CACHED_BLOCKS = 400  # blocks kept in memory: a tile and those around it

HOUSES, WORKS = TOWN["houses"], TOWN["works"]


@dataclass(frozen=True)
class City:
    """The first `buildings` buildings of the endless city of `seed`.

    They are surveyed at `density` (points/m2). Blocks lie in rows of `blocks_a_row`; block (i, j)
    is the same in every city of that seed, whatever its size.
    """

    buildings: int
    seed: int = 0
    density: float = 5.0
    tile_m: float = 500.0

    def __post_init__(self) -> None:
        if not 1 <= self.buildings <= 10_000_000:
            raise InputError(
                f"expected 1 to 10000000 buildings, got {self.buildings}; 10000 is a small city"
            )
        if not 50.0 <= self.tile_m <= 5000.0:
            raise InputError(f"expected tiles of 50 to 5000 m, got {self.tile_m}; 500 is usual")
        if not 0.1 <= self.density <= 100.0:
            raise InputError(
                f"expected a density of 0.1 to 100 points/m2, got {self.density}; 1 to 20 is usual"
            )

    @property
    def blocks_a_row(self) -> int:
        """As many as make the city about square."""
        blocks = self.buildings / BUILDINGS_A_BLOCK
        return max(1, round(math.sqrt(blocks * CITY_BLOCK_M[1] / CITY_BLOCK_M[0])))

    @property
    def terrain(self) -> Relief:
        return Relief.random(np.random.default_rng([self.seed, 1]), GROUND_BORDER_M, CITY_ORIGIN_XY)

    @property
    def flight(self) -> Flight:
        return Flight(heading=HEADING + math.radians(35.0), origin=CITY_ORIGIN_XY)


def block_buildings(seed: int, i: int, j: int, terrain: Relief) -> list[SimBuilding]:
    """Return the buildings of block (i, j): two rows of houses back to back, or one of works."""
    rng = np.random.default_rng([seed, 11, i, j])
    corner = CITY_ORIGIN_XY + turn_points(CITY_BLOCK_M * [[i, j]], HEADING)[0]
    length, depth = CITY_BLOCK_M - STREET_M
    if rng.random() < WORKS_SHARE:
        return street_side(rng, drawn_names(rng, WORKS), corner, HEADING, length, depth, terrain)
    opposite = corner + turn_points(np.array([[length, depth]]), HEADING)[0]
    half = depth / 2 - 1.0
    front = street_side(rng, drawn_names(rng, HOUSES), corner, HEADING, length, half, terrain)
    back = street_side(
        rng, drawn_names(rng, HOUSES), opposite, HEADING + math.pi, length, half, terrain
    )
    return front + back


def drawn_names(rng: np.random.Generator, weights: dict[str, float]) -> Iterator[str]:
    """Yield names without end, as often as their weights say."""
    names, p = list(weights), np.array(list(weights.values()))
    while True:
        yield names[rng.choice(len(names), p=p / p.sum())]


class Stock:
    """The buildings of each block by its number alone, drawn again when asked for."""

    def __init__(self, city: City):
        self.city, self.terrain = city, city.terrain
        blocks, first, total, k = [], [], 0, 0
        while total < self.city.buildings:
            j, i = divmod(k, self.city.blocks_a_row)
            blocks.append((i, j))
            first.append(total)
            total += len(block_buildings(self.city.seed, i, j, self.terrain))
            k += 1
        self.blocks, self.first = blocks, first
        corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * CITY_BLOCK_M
        lower = np.array(self.blocks) * CITY_BLOCK_M
        plan = (
            turn_points((lower[:, None] + corners).reshape(-1, 2), HEADING).reshape(-1, 4, 2)
            + CITY_ORIGIN_XY
        )
        self.low, self.high = plan.min(axis=1), plan.max(axis=1)
        self.lots = lru_cache(maxsize=CACHED_BLOCKS)(self.draw_lots)

    def draw_lots(self, block: int) -> tuple[Lot, ...]:
        """Draw a block's lots by its number alone; `lots` keeps the last ones."""
        start, seed, (i, j) = self.first[block], self.city.seed, self.blocks[block]
        buildings = block_buildings(seed, i, j, self.terrain)[: self.city.buildings - start]
        return tuple(
            furnish_lot(np.random.default_rng([seed, 12, i, j, k]), f"b{start + k:07d}", building)
            for k, building in enumerate(buildings, 1)
        )

    def find_blocks(self, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
        """Return the blocks within SURROUNDINGS_M of the rectangle from `lower` to `upper` (2,)."""
        is_near = (self.low < upper + SURROUNDINGS_M) & (self.high > lower - SURROUNDINGS_M)
        return np.flatnonzero(is_near.all(axis=1))

    def near(self, bounds: Box) -> list[Lot]:
        """Return lots of the blocks that reach into `bounds`, with trees and shadows."""
        blocks = self.find_blocks(np.array(bounds[:2]), np.array(bounds[2:]))
        return [lot for block in blocks for lot in self.lots(int(block))]

    def patches(self, bounds: Box) -> list[tuple[np.ndarray, np.ndarray]]:
        """Return the patches of `bounds` in or beside the city; the country is not surveyed."""
        return [patch for patch in divide_into_patches(bounds) if len(self.find_blocks(*patch))]

    def tiles(self) -> Iterator[Box]:
        """Yield squares of the city's tile size, on round coordinates, that touch a block."""
        size = self.city.tile_m
        first, last = np.floor(self.low.min(axis=0) / size), np.ceil(self.high.max(axis=0) / size)
        for y in np.arange(first[1], last[1]) * size:
            for x in np.arange(first[0], last[0]) * size:
                if ((self.low < (x + size, y + size)) & (self.high > (x, y))).all(axis=1).any():
                    yield (float(x), float(y), float(x + size), float(y + size))


class Written(NamedTuple):
    """A tile of a city that is on the disk."""

    tile: str
    buildings: int
    points: int


def write_city(folder: Path, city: City) -> Iterator[Written]:
    """Write tiles/*.laz, footprints.gpkg and truth.jsonl to `folder`.

    Yields what each tile holds. Each building is in footprints and truth once, with the tile its
    frame's origin lies in. Raises OutputError where the folder cannot be written or already holds a
    city.
    """
    stock, settings = Stock(city), ScanSettings(density=city.density)
    footprints, truth = folder / "footprints.gpkg", folder / "truth.jsonl"
    if footprints.exists() or truth.exists():
        raise OutputError(
            f"expected a folder without a city in it, got {folder}; remove its files or choose "
            "another"
        )
    try:
        (folder / "tiles").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"expected to write in {folder}, got: {error}; choose a folder that can be written"
        ) from error
    for bounds in stock.tiles():
        name = f"{bounds[0]:.0f}_{bounds[1]:.0f}"
        lots = stock.near(bounds)
        clouds = survey(
            stock.patches(bounds), lots, stock.terrain, city.flight, city.seed, settings
        )
        points = write_laz(folder / "tiles" / f"{name}.laz", clouds, np.array([*bounds[:2], 0.0]))
        selected_lots = [lot for lot in lots if holds(bounds, lot)]
        if selected_lots:
            write_footprints(footprints, selected_lots, append=footprints.exists())
        with truth.open("a") as file:
            file.writelines(
                json.dumps({"id": lot.id, "tile": name, **lot.building.truth()}) + "\n"
                for lot in selected_lots
            )
        yield Written(name, len(selected_lots), points)


def holds(bounds: Box, lot: Lot) -> bool:
    """Return whether a lot's building stands in a tile; one on the border, in one alone."""
    x, y, _ = lot.building.roof.frame.origin
    return bounds[0] <= x < bounds[2] and bounds[1] <= y < bounds[3]
