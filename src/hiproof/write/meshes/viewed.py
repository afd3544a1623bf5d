"""A finished building as 3D viewers draw it: its faces, named and coloured."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeVar

import numpy as np

from ...data_files import Values
from ...frames import Units
from ...model import CEILING, GROUND, ROOF, WALL, Building, Face, Solid
from ..colours import GROUND_COLOUR, WALL_COLOUR, type_colour, type_colours
from ..fragments import Sheet
from ..parameters import numbers, part_record

T = TypeVar("T")
SHOWN_PART_KEYS = ("type", "parameters", "position", "rotation")


class Look(NamedTuple):
    """What a face is called, and its colour (#rrggbb)."""

    name: str
    colour: str


class ViewedModel(NamedTuple):
    """A building's solid in world metres; `part_types` are roof types by `Face.part`."""

    id: str
    roof_type: str
    solid: Solid
    attributes: Values
    part_types: Mapping[int, str]

    @property
    def corner(self) -> np.ndarray:
        """The solid's lowest coordinates (3,) in whole metres, an origin of files."""
        return np.floor(self.solid.vertices.min(axis=0))

    @property
    def values(self) -> Values:
        """Its id, its roof type and its attributes, by name."""
        return merge_values({"id": self.id, "roof_type": self.roof_type}, self.attributes)

    def faces_by_look(self) -> dict[Look, list[Face]]:
        """Group roofs, walls, grounds and ceilings by their look."""
        return self.group_faces(lambda face: choose_look(face, self.part_types))

    def faces_by_element(self) -> dict[tuple[str, int], list[Face]]:
        """Group the roof faces of each part, walls, grounds and ceilings, by kind and part."""
        return self.group_faces(lambda face: (face.kind, face.part if face.kind == ROOF else 0))

    def group_faces(self, name: Callable[[Face], T]) -> dict[T, list[Face]]:
        """Group roofs, then walls, grounds and ceilings, by what `name` gives."""
        result: dict[T, list[Face]] = {}
        for kind in (ROOF, WALL, GROUND, CEILING):
            for face in self.solid.select_faces(kind):
                result.setdefault(name(face), []).append(face)
        return result


def view_building(sheet: Sheet) -> ViewedModel:
    """Return the model of a building with its attributes.

    Its parameters are among them as JSON where its parts have any. The solid is in metres of the
    CRS of files. It has overhangs where LoD2.3 is asked for.
    """
    building, units = sheet.building, sheet.head.units.gml
    solid = building.model.finest_solid if "2.3" in sheet.head.write.lods else building.solid
    text = parameters_text(building)
    there = Units(units.plan, units.height).to_metres(units.from_metres(solid.vertices))
    return ViewedModel(
        building.id,
        building.type or "unknown",
        Solid(there, solid.faces),
        merge_values({"parameters": text}, sheet.attributes) if text else sheet.attributes,
        {number: part.type for number, part in enumerate(building.parts)},
    )


def parameters_text(building: Building) -> str:
    """Return the parts of a roof as JSON without outlines, empty without parameters."""
    records = [part_record(part) for part in building.parts]
    if not any(record["parameters"] or record["type"] == "free" for record in records):
        return ""
    parts = [{name: record[name] for name in SHOWN_PART_KEYS} for record in records]
    origin = numbers(building.roof.frame.origin)
    return json.dumps({"origin": origin, "parts": parts}, separators=(",", ":"))


def merge_values(members: Values, attributes: Values) -> Values:
    """Return `members` values by name, then the `attributes`.

    An attribute that has such a name and another value is called NAME_input.

    >>> merge_values({"id": "a", "type": "gable"}, {"id": "a", "type": "church", "year": 1905})
    {'id': 'a', 'type': 'gable', 'type_input': 'church', 'year': 1905}
    """
    neighbours = {
        name: value
        for name, value in attributes.items()
        if name not in members or str(value) != str(members[name])
    }
    return members | {
        f"{name}_input" if name in members else name: value for name, value in neighbours.items()
    }


def choose_look(face: Face, part_types: Mapping[int, str]) -> Look:
    """Return the look of a face: a roof's is that of its part's type.

    A ceiling looks like the ground.

    >>> choose_look(Face(((0, 1, 2),), ROOF, part=1), {0: "gable", 1: "hip"})
    Look(name='roof hip', colour='#05429b')
    """
    if face.kind != ROOF:
        return Look(WALL, WALL_COLOUR) if face.kind == WALL else Look(GROUND, GROUND_COLOUR)
    known_values = part_types.get(face.part)
    return Look(
        f"roof {known_values if known_values in type_colours() else 'unknown'}",
        type_colour(known_values),
    )
