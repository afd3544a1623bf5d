"""All answers about one building: its attributes, and those of its surfaces."""

from __future__ import annotations

import dataclasses
import json
from typing import Any, NamedTuple

import shapely

from ..model import Building, Solid
from ..model.roof_figures import find_ground_height, roof_figures
from ..write.attribute_list import OWN
from ..write.values import plain_text, round_value
from .areas import OF_3DBAG, measure_areas
from .cadastre import Cadastre
from .cut import Region, cut_walls
from .house_type import is_residential, name_house_type, name_tabula_class
from .party import Contact
from .ridge import find_ridge_direction
from .storeys import count_storeys, measure_floors, storey_heights
from .town import Town


class Answers(NamedTuple):
    """A building, its walls cut along party walls, with what is added.

    `attributes` are the building's, `surfaces` those of faces by number.
    """

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
    areas = measure_areas(building.solid, measure_party(regions))
    attributes = {
        **{OWN + name: round_value(area, 4) for name, area in areas.items()},
        **{name: round_value(areas[own], 4) for own, name in OF_3DBAG.items()},
        **describe_house(town, number, areas, building.attributes.get(use_attribute)),
        f"{OWN}party_walls": describe_party(town, contacts),
        f"{OWN}neighbours_unknown": town.lacks_neighbours(number),
    }
    surfaces = {face: {f"{OWN}party_with": name} for face, name in party.items()}
    if cadastre is not None:
        sun, faces = cadastre.describe(number, solid, party)
        attributes, surfaces = attributes | sun, surfaces | faces
    return Answers(with_solid(building, solid), attributes, surfaces)


def describe_house(town: Town, number: int, areas: dict[str, float], use: Any) -> dict[str, Any]:
    """Return type, storeys, volume and floor areas of building `number`.

    `areas` are those of its surfaces.
    """
    building = town.read(number)
    figures = roof_figures(building.solid)
    z_ground = find_ground_height(building, figures)
    heights = storey_heights(is_residential(use))
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
        "gross_floor_area_min_m2": round_value(floors[0], 2),
        "gross_floor_area_max_m2": round_value(floors[1], 2),
        "heated_volume_m3": round_value(figures.volume_m3, 2),
        "envelope_area_m2": round_value(envelope, 4),
        "compactness": round_value(envelope / figures.volume_m3, 4),
        "ridge_direction_deg": None if ridge is None else round_value(ridge, 3),
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


def measure_party(regions: dict[int, list[Region]]) -> float:
    """Return the area (m2) of all party walls.

    Places that two neighbours touch count once.
    """
    return float(
        sum(
            shapely.union_all([region for _, region in of_face]).area
            for of_face in regions.values()
        )
    )


def describe_party(town: Town, contacts: dict[int, tuple[Contact, ...]]) -> str:
    """Return the area (m2) of the party wall with each neighbour by id, as JSON."""
    areas = {
        plain_text(town.read(other).id): round_value(sum(c.area_m2 for c in contacts[other]), 4)
        for other in contacts
    }
    return json.dumps(areas, ensure_ascii=False)


def with_solid(building: Building, solid: Solid) -> Building:
    """Return a building with another solid of the same shape."""
    return dataclasses.replace(building, built=dataclasses.replace(building.model, solid=solid))
