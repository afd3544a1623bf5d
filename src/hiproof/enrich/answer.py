"""All answers about one building: its attributes, those of its surfaces, its house type."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely

from ..compose.settle import round_number
from ..model import ROOF, Building, Solid
from ..model.roof_figures import (
    LEVEL_RIDGE_M,
    LEVEL_TRIANGLE_M,
    cut_roof,
    find_ground_height,
    measure_area_below,
    roof_figures,
)
from ..write.attribute_list import OWN
from ..write.values import plain_text
from .cadastre import Cadastre
from .cut import Region, cut_walls
from .party import Contact, Town
from .walls import OF_3DBAG, measure_areas

# A building of less ground (m2) or height (m) is a shed or a garage: no house, and no neighbour
# that makes a row.
SMALLEST_HOUSE_M2, LOWEST_HOUSE_M = 25.0, 4.0
# Area (m2) of a party wall that makes two houses one row: a storey high and half a room deep. Less
# is a garage or an annexe that touches.
SMALLEST_SHARED_WALL_M2 = 5.0
# Gross floor area (m2) from which a building is one of apartments: five dwellings of 100 m2, more
# than a family house has. TABULA's apartment blocks have more than 12 dwellings.
SMALLEST_APARTMENTS_M2, SMALLEST_BLOCK_M2 = 500.0, 1200.0
APARTMENTS = "apartment_block"
# TABULA's class of each type; an apartment block of SMALLEST_BLOCK_M2 or more is an AB.
TABULA = {
    "detached": "SFH",
    "semi_detached": "SFH",
    "end_terrace": "TH",
    "mid_terrace": "TH",
    APARTMENTS: "MFH",
}

# Beginnings of words that name a residential use, in English, Dutch, German and French.
RESIDENTIAL = ("resid", "dwell", "house", "apartment", "flat", "woon", "wohn", "habit", "logement")
# Codes of one, in the lists of AdV (31001) and SIG3D.
RESIDENTIAL_CODE = re.compile(r"31001_1[0-2]\d\d|10\d\d")


def is_residential(use: Any) -> bool:
    """Return whether a use is residential; one that is unknown counts as such.

    >>> is_residential("Wohngebäude"), is_residential("office"), is_residential(None)
    (True, False, True)
    >>> is_residential("31001_1010"), is_residential("31001_2020"), is_residential(1000)
    (True, False, True)
    """
    text = str(use or "").lower()
    words = text.replace("_", " ").split()
    is_word = any(word.startswith(RESIDENTIAL) for word in words)
    return not words or is_word or bool(RESIDENTIAL_CODE.fullmatch(text.strip()))


def name_house_type(town: Town, number: int, floor_area_m2: float, use: Any) -> str | None:
    """Return the type of building `number` by its gross floor area, None for no house."""
    if not is_house(town.read(number)) or not is_residential(use):
        return None
    neighbours = list_house_neighbours(town, number)
    if floor_area_m2 >= SMALLEST_APARTMENTS_M2:
        return APARTMENTS
    if not neighbours:
        return "detached"
    if len(neighbours) > 1:
        return "mid_terrace"
    return (
        "semi_detached" if len(list_house_neighbours(town, neighbours[0])) == 1 else "end_terrace"
    )


def name_tabula_class(house_type: str | None, floor_area_m2: float) -> str | None:
    """Return TABULA's class of a house type: SFH, TH, MFH or AB."""
    if house_type == APARTMENTS and floor_area_m2 >= SMALLEST_BLOCK_M2:
        return "AB"
    return None if house_type is None else TABULA[house_type]


def list_house_neighbours(town: Town, number: int) -> list[int]:
    """Return the houses that share a wall with building `number`."""
    contacts = town.list_contacts(number)
    return [
        other
        for other in contacts
        if sum(contact.area_m2 for contact in contacts[other]) >= SMALLEST_SHARED_WALL_M2
        and is_house(town.read(other))
    ]


def is_house(building: Building) -> bool:
    """Return whether a building is large enough for a house."""
    if building.built is None:
        return False
    z = building.solid.vertices[:, 2]
    area = building.roof.outline.area
    return bool(area >= SMALLEST_HOUSE_M2 and z.max() - z.min() >= LOWEST_HOUSE_M)


# Least and greatest height (m) of a storey, floor to floor: of dwellings from the least ceiling
# that building codes allow to that of old town houses; of other uses up to that of shops and halls.
RESIDENTIAL_STOREY_M, OTHER_STOREY_M = (2.5, 3.3), (3.0, 5.0)
HIGHEST_PLINTH_M = 0.6  # height (m) of a ground floor over the ground that houses seldom exceed
HEADROOM_M = 1.5  # height (m) below the roof from which a floor counts as area


def count_storeys(eave_m: float, heights: tuple[float, float]) -> tuple[int, int]:
    """Return the least and the greatest number of full storeys below the eaves.

    `eave_m` is the height of the eaves over the ground, `heights` those of a storey. An attic is
    none of them. Where no number of storeys fills a height, both are the most that fit below it.

    >>> count_storeys(5.6, RESIDENTIAL_STOREY_M), count_storeys(4.5, RESIDENTIAL_STOREY_M)
    ((2, 2), (1, 1))
    """
    low, high = heights
    greatest = max(1, math.floor(eave_m / low + 1e-9))
    least = max(1, math.ceil((eave_m - HIGHEST_PLINTH_M) / high - 1e-9))
    return min(least, greatest), greatest


def measure_floors(
    solid: Solid, z_ground: float, eave_m: float, heights: tuple[float, float]
) -> tuple[float, float]:
    """Return the gross floor areas (m2), attics included, of the fewest and the most storeys.

    A floor is as large as the plan in which the roof is at least HEADROOM_M above it.
    """
    low, high = heights
    least, greatest = count_storeys(eave_m, heights)
    height = min(max((eave_m - HIGHEST_PLINTH_M) / least, low), high)
    levels = RoofLevels(solid)
    z_eave = z_ground + eave_m
    return (
        sum_floors(
            levels, z_ground + HIGHEST_PLINTH_M + height * np.arange(least + 1), z_eave, high
        ),
        sum_floors(levels, z_ground + low * np.arange(greatest + 1), z_eave, low),
    )


def sum_floors(levels: RoofLevels, z_floors: np.ndarray, z_eave: float, storey_m: float) -> float:
    """Return the area (m2) of full storeys and attics between the heights `z_floors`."""
    attics = np.arange(max(z_eave, z_floors[-1]), levels.z_top, storey_m)
    floors = np.concatenate([z_floors[:-1], attics]) + HEADROOM_M
    floors[0] = min(floors[0], z_eave, levels.z_top)  # low sheds, too, have a floor
    return float(sum(map(levels.measure_above, floors)))


class RoofLevels:
    """The plan areas of a roof above any height."""

    def __init__(self, solid: Solid) -> None:
        shell = solid.shell
        corners, self.plan = cut_roof(solid, shell)
        self.z = np.sort(solid.vertices[shell.index[corners], 2], axis=1)
        self.z_top = float(self.z.max())

    def measure_above(self, z: float) -> float:
        """Return the plan area (m2) where the roof is at least as high as `z`."""
        below = measure_area_below(z - LEVEL_TRIANGLE_M, self.z, self.plan)
        return float(self.plan.sum()) - below


def find_ridge_direction(solid: Solid) -> float | None:
    """Return the direction (degrees, 0 to 180) of the longest level ridge, None without one."""
    vectors = solid.shell.face_areas
    sides: dict[tuple[int, int], int] = {}
    for number, face in enumerate(solid.faces):
        if face.kind == ROOF:
            for ring in face.rings:
                pairs = pairwise((*ring, ring[0]))
                sides |= {(start, end): number for start, end in pairs}
    best, direction = 0.0, None
    for (start, end), left in sides.items():
        other = sides.get((end, start))
        along = solid.vertices[end] - solid.vertices[start]
        length = round(float(np.hypot(along[0], along[1])), 3)
        if other is None or start > end or abs(along[2]) >= LEVEL_RIDGE_M or length <= best:
            continue
        if tell_fall(vectors[left], along) and tell_fall(vectors[other], -along):
            best, direction = length, float(np.degrees(np.arctan2(along[0], along[1])) % 180.0)
    return direction


def tell_fall(vector: np.ndarray, along: np.ndarray) -> bool:
    """Return whether a face left of an edge falls away from it, by its vector area."""
    return bool(vector[1] * along[0] - vector[0] * along[1] > 1e-9)


class Answers(NamedTuple):
    """A building with cut walls, added `attributes`, and `surfaces`, attributes by face."""

    building: Building
    attributes: dict[str, Any]
    surfaces: dict[int, dict[str, Any]]


def answer(
    town: Town, number: int, use_attribute: str = "", cadastre: Cadastre | None = None
) -> Answers:
    """Answer all questions about building `number`.

    `use_attribute` names the attribute of the input that has its use, empty where none has. The sun
    is left out without a `cadastre`.
    """
    building = town.read(number)
    if building.built is None:
        return Answers(building, {f"{OWN}neighbours_unknown": True}, {})
    contacts = town.list_contacts(number)
    regions = group_regions(town, contacts)
    solid, party = cut_walls(building.solid, town.list_walls(number), regions)
    # places that two neighbours touch count once
    party_m2 = sum(
        shapely.union_all([region for _, region in of_face]).area for of_face in regions.values()
    )
    areas = measure_areas(building.solid, float(party_m2))
    attributes = {
        **{OWN + name: round_number(area, 4) for name, area in areas.items()},
        **{name: round_number(areas[own], 4) for own, name in OF_3DBAG.items()},
        **describe_house(town, number, areas, building.attributes.get(use_attribute)),
        f"{OWN}party_walls": describe_party(town, contacts),
        f"{OWN}neighbours_unknown": town.lacks_neighbours(number),
    }
    surfaces = {face: {f"{OWN}party_with": name} for face, name in party.items()}
    if cadastre is not None:
        sun, faces = cadastre.describe(number, solid, party)
        attributes, surfaces = attributes | sun, surfaces | faces
    return Answers(
        dataclasses.replace(building, built=dataclasses.replace(building.model, solid=solid)),
        attributes,
        surfaces,
    )


def describe_house(town: Town, number: int, areas: dict[str, float], use: Any) -> dict[str, Any]:
    """Return type, storeys, volume and floor areas of building `number` with surface `areas`."""
    building = town.read(number)
    figures = roof_figures(building.solid)
    z_ground = find_ground_height(building, figures)
    heights = RESIDENTIAL_STOREY_M if is_residential(use) else OTHER_STOREY_M
    eave_m = figures.h_eave - z_ground
    storeys = count_storeys(eave_m, heights)
    floors = measure_floors(building.solid, z_ground, eave_m, heights)
    house_type = name_house_type(town, number, sum(floors) / 2, use)
    envelope = sum(areas.values()) - areas["party_wall_area_m2"]
    ridge = find_ridge_direction(building.solid)
    values = {
        "house_type": house_type,
        "tabula_class": name_tabula_class(house_type, sum(floors) / 2),
        "storeys_min": storeys[0],
        "storeys_max": storeys[1],
        "gross_floor_area_min_m2": round_number(floors[0], 2),
        "gross_floor_area_max_m2": round_number(floors[1], 2),
        "heated_volume_m3": round_number(figures.volume_m3, 2),
        "envelope_area_m2": round_number(envelope, 4),
        "compactness": round_number(envelope / figures.volume_m3, 4),
        "ridge_direction_deg": None if ridge is None else round_number(ridge, 3),
    }
    return {OWN + name: value for name, value in values.items()}


def group_regions(town: Town, contacts: dict[int, tuple[Contact, ...]]) -> dict[int, list[Region]]:
    """Return the places of party walls with their neighbour's id, by face."""
    regions: dict[int, list[Region]] = {}
    for other in contacts:
        name = plain_text(town.read(other).id)
        for contact in contacts[other]:
            regions.setdefault(contact.walls[0].face, []).append((name, contact.regions[0]))
    return regions


def describe_party(town: Town, contacts: dict[int, tuple[Contact, ...]]) -> str:
    """Return the area (m2) of the party wall with each neighbour by id, as JSON."""
    areas = {
        plain_text(town.read(other).id): round_number(sum(c.area_m2 for c in contacts[other]), 4)
        for other in contacts
    }
    return json.dumps(areas, ensure_ascii=False)
