"""A finished building as 3D viewers draw it: its faces, named and coloured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from ...model import GROUND, ROOF, WALL, Face, Solid
from ..colours import GROUND_COLOUR, WALL_COLOUR, type_colour, type_colours


class Look(NamedTuple):
    """What a face is called, and its colour (#rrggbb)."""

    name: str
    colour: str


class ViewedModel(NamedTuple):
    """A building with its solid in world metres;

    `part_types` are the roof types of its parts by number (`Face.part`), `roof_type` is that of the
    largest.
    """

    id: str
    roof_type: str
    solid: Solid
    attributes: dict[str, Any]
    part_types: Mapping[int, str]

    def faces_by_look(self) -> dict[Look, list[Face]]:
        """Roofs, walls and grounds, those of one look together."""
        found: dict[Look, list[Face]] = {}
        for kind in (ROOF, WALL, GROUND):
            for face in self.solid.of_kind(kind):
                found.setdefault(look_of(face, self.part_types), []).append(face)
        return found


def told_beside(own: dict[str, Any], attributes: dict[str, Any]) -> dict[str, Any]:
    """`own` values by name, then the `attributes`, of which one that has such a name and says
    something else is called NAME_input.

    >>> told_beside({"id": "a", "type": "gable"}, {"id": "a", "type": "church", "year": 1905})
    {'id': 'a', 'type': 'gable', 'type_input': 'church', 'year': 1905}
    """
    others = {
        name: value
        for name, value in attributes.items()
        if name not in own or str(value) != str(own[name])
    }
    return own | {f"{name}_input" if name in own else name: value for name, value in others.items()}


def look_of(face: Face, part_types: Mapping[int, str]) -> Look:
    """The look of a face: a roof's is that of its part's type.

    >>> look_of(Face(((0, 1, 2),), ROOF, part=1), {0: "gable", 1: "hip"})
    Look(name='roof hip', colour='#05429b')
    """
    if face.kind != ROOF:
        return Look(face.kind, WALL_COLOUR if face.kind == WALL else GROUND_COLOUR)
    known = part_types.get(face.part)
    return Look(f"roof {known if known in type_colours() else 'unknown'}", type_colour(known))
