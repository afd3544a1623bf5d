"""The type of a house by the houses that it touches, its size, and its use."""

from __future__ import annotations

from typing import Any

from ..model import Building
from .party import Town

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
TABULA = {
    "detached": "SFH",
    "semi_detached": "SFH",
    "end_terrace": "TH",
    "mid_terrace": "TH",
    APARTMENTS: "MFH",
}
"""TABULA's class of each type; an apartment block of SMALLEST_BLOCK_M2 or more is an AB."""

RESIDENTIAL = ("resid", "dwell", "house", "apartment", "flat", "woon", "wohn", "habit", "logement")
"""Beginnings of words that name a residential use, in English, Dutch, German and French."""


def is_residential(use: Any) -> bool:
    """Return whether a use is residential; one that is unknown counts as such.

    >>> is_residential("Wohngebäude"), is_residential("office"), is_residential(None)
    (True, False, True)
    """
    words = str(use or "").lower().replace("_", " ").split()
    return not words or any(word.startswith(RESIDENTIAL) for word in words)


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
