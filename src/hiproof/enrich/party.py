"""Where the walls of two buildings touch.

Two walls touch where they face each other, at most PARTY_GAP_M apart. Both are projected onto the
plane midway between them, in which their polygons are intersected: one computation gives the area
for both buildings, so that it is the same for either.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
import shapely

from ..geometry.rings import with_area
from ..settings import EnrichSettings
from .records import MOST_KEPT, Records
from .walls import Wall, find_walls

# Usual largest distance (m) between walls that touch: outlines of neighbours, moved onto their
# roofs one by one, differ by up to the accuracy of two strips.
PARTY_GAP_M = EnrichSettings.touch_m
# Largest angle (degrees) between walls that touch. Walls at a larger angle part by PARTY_GAP_M
# within 2 m.
MOST_ANGLE_DEG = 10.0
SMALLEST_CONTACT_M2 = 0.01  # area (m2) below which a contact is rounding
COS_MOST_ANGLE = math.cos(math.radians(MOST_ANGLE_DEG))


class Contact(NamedTuple):
    """A wall that touches another's, at `regions` of either plane; `area_m2` is midway."""

    walls: tuple[Wall, Wall]
    regions: tuple[shapely.Geometry, shapely.Geometry]
    area_m2: float


def find_contacts(
    walls: tuple[Wall, ...], others: tuple[Wall, ...], touch_m: float = PARTY_GAP_M
) -> tuple[Contact, ...]:
    """Return where walls of one building touch those of another."""
    if not walls or not others:
        return ()
    facing = direction_table(walls) @ direction_table(others).T <= -COS_MOST_ANGLE
    (low, high), (other_low, other_high) = box_table(walls), box_table(others)
    reach = np.array([touch_m, touch_m, 0.0])
    near = (
        (low[:, None] - reach <= other_high[None]) & (other_low[None] <= high[:, None] + reach)
    ).all(axis=2)
    pairs = (touch(walls[i], others[k], touch_m) for i, k in np.argwhere(facing & near).tolist())
    return tuple(contact for contact in pairs if contact is not None)


def direction_table(walls: tuple[Wall, ...]) -> np.ndarray:
    return np.array([wall.along for wall in walls])


def box_table(walls: tuple[Wall, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return low and high corners (n, 3) of the boxes around walls."""
    s_low, z_low, s_high, z_high = shapely.bounds([wall.polygon for wall in walls]).T
    origin, along = np.array([wall.origin for wall in walls]), direction_table(walls)
    ends = np.stack([origin + s[:, None] * along for s in (s_low, s_high)])
    return (np.column_stack([ends.min(axis=0), z_low]), np.column_stack([ends.max(axis=0), z_high]))


def touch(wall: Wall, other: Wall, touch_m: float) -> Contact | None:
    """Return the contact of two walls that face each other, None where they are apart."""
    along = wall.along - other.along
    along /= np.hypot(*along)
    across = np.array([-along[1], along[0]])
    place = other.origin - wall.origin
    # s along the middle plane is offset + scale * s along each wall; the first has offset 0
    scale, other_scale = float(wall.along @ along), float(other.along @ along)
    offset = float(place @ along)
    polygon = project(wall.polygon, 0.0, scale)
    other_polygon = project(other.polygon, offset, other_scale)
    low, high = find_near_stretch(
        float(wall.along @ across) / scale,
        float(place @ across) - offset * float(other.along @ across) / other_scale,
        float(other.along @ across) / other_scale,
        touch_m,
    )
    common = shapely.intersection(polygon, other_polygon)
    z_low, z_high = common.bounds[1::2] if not common.is_empty else (0.0, 0.0)
    near = shapely.box(
        max(low, polygon.bounds[0] - 1.0),
        z_low - 1.0,
        min(high, polygon.bounds[2] + 1.0),
        z_high + 1.0,
    )
    region = with_area(shapely.intersection(common, near)) if low < high else shapely.Polygon()
    if region.area < SMALLEST_CONTACT_M2:
        return None
    regions = (
        project(region, 0.0, 1 / scale),
        project(region, -offset / other_scale, 1 / other_scale),
    )
    return Contact((wall, other), regions, float(region.area))


def find_near_stretch(
    slope: float, other_offset: float, other_slope: float, touch_m: float
) -> tuple[float, float]:
    """Return from where to where two lines in plan are at most `touch_m` apart.

    The lines are slope * t and other_offset + other_slope * t.

    >>> find_near_stretch(0.0, 0.2, 0.0, 0.3), find_near_stretch(0.0, 0.0, 0.1, 0.3)
    ((-inf, inf), (-3.0, 3.0))
    """
    change = other_slope - slope
    if abs(change) < 1e-12:
        return (-math.inf, math.inf) if abs(other_offset) <= touch_m else (0.0, 0.0)
    ends = sorted(round((end - other_offset) / change, 9) for end in (-touch_m, touch_m))
    return ends[0], ends[1]


def project(geometry: shapely.Geometry, offset: float, scale: float) -> shapely.Geometry:
    """Return a geometry (s, z) with offset + scale * s in place of s."""
    return shapely.transform(geometry, lambda sz: sz * (scale, 1.0) + (offset, 0.0))


class Town:
    """The buildings of a run by number, with walls and contacts."""

    def __init__(self, records: Records, touch_m: float = PARTY_GAP_M) -> None:
        self.records, self.touch_m = records, touch_m
        self.read = records.read
        self.list_walls = functools.lru_cache(MOST_KEPT)(self.find_walls)
        self.list_pair = functools.lru_cache(8 * MOST_KEPT)(self.find_pair)

    def find_walls(self, number: int) -> tuple[Wall, ...]:
        building = self.read(number)
        return () if building.built is None else find_walls(building.solid)

    def find_pair(self, number: int, other: int) -> tuple[Contact, ...]:
        return find_contacts(self.list_walls(number), self.list_walls(other), self.touch_m)

    def list_contacts(self, number: int) -> dict[int, tuple[Contact, ...]]:
        """Return a building's contacts by neighbour, each pair computed in one way only."""
        result = {}
        for other in self.records.find_near(number, self.touch_m):
            if number < other:
                contacts = self.list_pair(number, other)
            else:
                contacts = tuple(
                    Contact(contact.walls[::-1], contact.regions[::-1], contact.area_m2)
                    for contact in self.list_pair(other, number)
                )
            if contacts:
                result[other] = contacts
        return result

    def lacks_neighbours(self, number: int) -> bool:
        """Return whether a neighbour has no model, or the building is at the run's border."""
        near = self.records.find_near(number, self.touch_m)
        return self.records.is_at_border(number) or not self.records.index.modelled[near].all()
