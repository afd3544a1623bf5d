"""One building from its parameters: `build` composes, checks and says what came of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from ..errors import InputError
from ..model import Building
from ..settings import ComposeSettings, Settings
from .record import building_of, mapping


def build(parameters: Mapping[str, Any], compose: ComposeSettings | None = None) -> Building:
    """The building of `parameters`, an object of a parameters.jsonl (`read_parameters` reads them); the run's own give the run's own.

    compose: how solids are composed, as the file's head says. Raises InputError for parameters that make no roof and
    CompositionError for a roof that makes no valid solid; each is one sentence.

    >>> house = {"width": 8, "length": 12, "height": 3}
    >>> ring = [[-6, -4], [6, -4], [6, 4], [-6, 4], [-6, -4]]
    >>> part = {"type": "gable", "parameters": house, "position": [0, 0, 5], "rotation": 0}
    >>> build({"id": "a", "origin": [0, 0, 0], "outline": [ring], "z_ground": 0, "parts": [part]}).type
    'gable'
    """
    if "id" not in mapping(parameters, "the building"):
        raise InputError("expected the id of the building, got none; give one")
    return solid_of(building_of(parameters), compose)


def solid_of(building: Building, compose: ComposeSettings | None = None) -> Building:
    """The building with the solid of its roof; as it is where it has none. Raises CompositionError as `build` does."""
    from ..compose import compose as composed

    roof = building.roof
    if roof is None:
        return building
    settings = dataclasses.replace(Settings(), compose=compose or ComposeSettings())
    solid = composed(roof, building.z_ground - roof.frame.origin[2], settings)
    return dataclasses.replace(building, solid=solid.moved(roof.frame.origin))
