"""Buildings along streets on hilly ground, for neighbourhoods and cities.

A lot is a building where it stands, with its chimneys, dormers and trees; a street side is a line
of lots. Everything is drawn from the generator given, so that one seed a block makes any part of a
city again without the rest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import shapely

from ..data_files import read_data_file
from ..frames import Box, LocalFrame, turn_points
from ..model import Roof
from .compounds import COMPOUND_KINDS, random_compound
from .relief import Relief
from .roofs import SimBuilding, find_largest_part, random_building
from .scene import Body, Defects, Scene, building_bodies, make_scene, superstructures, trees

TOWN = read_data_file("towns")
TOWN_DEFECTS = replace(Defects.none(), tree=0.45, chimney=0.45, dormer=0.2, antenna=0.1)


@dataclass(frozen=True)
class Lot:
    """A building `id` where it stands, its `bodies` in its frame, world `crowns` (t, 5)."""

    id: str
    building: SimBuilding
    bodies: tuple[Body, ...]
    crowns: np.ndarray

    @property
    def bounds(self) -> Box:
        """Plan bounds in the world, trees included."""
        lower, upper = np.array(self.building.footprint.bounds).reshape(2, 2)
        if len(self.crowns):
            lower = np.minimum(lower, (self.crowns[:, :2] - self.crowns[:, 3:4]).min(axis=0))
            upper = np.maximum(upper, (self.crowns[:, :2] + self.crowns[:, 3:4]).max(axis=0))
        return (*lower, *upper)


def make(rng: np.random.Generator, name: str, kappa: float) -> SimBuilding:
    """Make a building of a roof type or a compound kind, its frame at the origin."""
    if name in COMPOUND_KINDS:
        return random_compound(rng, name, kappa=kappa)
    return random_building(rng, name, kappa=kappa)


def standing_at(building: SimBuilding, xy: np.ndarray, terrain: Relief) -> SimBuilding:
    """Move a building's origin to `xy` (world), on the lowest ground under its outline."""
    corners = shapely.get_coordinates(building.outline) + xy
    z_ground = round(float(terrain.height_at(corners).min()), 3)
    frame = LocalFrame(np.array([*np.round(xy, 3), z_ground]))
    return replace(building, roof=replace(building.roof, frame=frame), z_ground=z_ground)


def build_row(row: SimBuilding) -> list[SimBuilding]:
    """Return a row of houses as single buildings with common walls, in the row's frame."""
    roofs = [Roof((part,), part.pieces[0].outline, row.roof.frame) for part in row.roof.parts]
    return [
        SimBuilding(find_largest_part(roof).type, "terraced", roof, row.z_ground) for roof in roofs
    ]


def furnish_lot(rng: np.random.Generator, id: str, building: SimBuilding) -> Lot:
    """Return the lot of `building` with what stands on it and beside it."""
    bodies = building_bodies(building) + superstructures(rng, building, TOWN_DEFECTS)
    crowns = np.empty((0, 5))
    if rng.random() < TOWN_DEFECTS.tree:
        crowns = trees(rng, building)
        crowns[:, :3] += building.roof.frame.origin
    return Lot(id, building, tuple(bodies), crowns)


def street_side(
    rng: np.random.Generator,
    names: Iterable[str],
    start: np.ndarray,
    heading: float,
    length: float,
    depth: float,
    terrain: Relief,
) -> list[SimBuilding]:
    """Return buildings side by side along `heading` (rad) from `start` (2,).

    They stand to its left, within `length` by `depth` metres. `names` are taken one after the other
    until the side is full; a building deeper than the plot is left out. Terraced rows come back as
    their houses half of the time.
    """
    along, placed = 0.0, []
    for name in names:
        building = make(rng, name, heading + rng.normal(0.0, 0.015))
        lower, upper = extent(building, heading)
        if upper[1] - lower[1] > depth:
            continue
        if along + upper[0] - lower[0] > length:
            break
        setback = min(rng.uniform(0.0, 4.0), depth - (upper[1] - lower[1]))
        offset = np.array([[along - lower[0], setback - lower[1]]])
        building = standing_at(building, start + turn_points(offset, heading)[0], terrain)
        is_terrace = building.kind == "row" and rng.random() < 0.5
        placed += build_row(building) if is_terrace else [building]
        along += upper[0] - lower[0] + rng.uniform(2.5, 7.0)
    return placed


def extent(building: SimBuilding, heading: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the outline's lowest and highest corner (2,) in axes turned by `heading`."""
    corners = turn_points(shapely.get_coordinates(building.outline), -heading)
    return corners.min(axis=0), corners.max(axis=0)


def town_scene(lots: list[Lot], terrain: Relief, centre: np.ndarray) -> Scene:
    """Return all `lots` in the frame whose origin is `centre` (3,) (world)."""
    bodies = [
        replace(body, shift=lot.building.roof.frame.origin - centre)
        for lot in lots
        for body in lot.bodies
    ]
    crowns = np.concatenate([np.empty((0, 5)), *(lot.crowns for lot in lots)])
    crowns[:, :3] -= centre
    return make_scene(bodies, crowns, terrain.move(-centre))
