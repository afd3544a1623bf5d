"""One building from its parameters: composed, checked and described."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from ..errors import InputError
from ..model import ONE_LEVEL, Building, Model, Roof, Underside
from ..settings import ComposeSettings, Settings
from .installations import read_installations
from .overhangs import read_eaves
from .record import read_building, require_mapping
from .underside import read_underside


def build(parameters: Mapping[str, Any], compose: ComposeSettings | None = None) -> Building:
    """Build the building of `parameters`, an object of a parameters.jsonl.

    `read_parameters` reads such objects. A run's own parameters give the run's own building.

    compose: how solids are composed, as the file's head says. Raises InputError for parameters that
    make no roof and CompositionError for a roof that makes no valid solid; each is one sentence.

    >>> house = {"width": 8, "length": 12, "height": 3}
    >>> ring = [[-6, -4], [6, -4], [6, 4], [-6, 4], [-6, -4]]
    >>> part = {"type": "gable", "parameters": house, "position": [0, 0, 5], "rotation": 0}
    >>> build({"id": "a", "origin": [0, 0, 0], "outline": [ring], "z_ground": 0,
    ...     "parts": [part]}).type
    'gable'
    """
    if "id" not in require_mapping(parameters, "the building"):
        raise InputError("expected the id of the building, got none; give one")
    building, roof = read_building(parameters)
    if roof is None:
        return building
    underside = read_underside(parameters, building, roof)
    result = with_model(building, roof, compose, underside)
    installations, eaves = read_installations(parameters), read_eaves(parameters, roof)
    if not installations and eaves is None:
        return result
    model = dataclasses.replace(result.model, installations=installations)
    if eaves is not None:
        from ..compose.eaves import add_eaves

        model = add_eaves(model, eaves)
    return dataclasses.replace(result, built=model)


def with_model(
    building: Building,
    roof: Roof,
    compose: ComposeSettings | None = None,
    underside: Underside = ONE_LEVEL,
) -> Building:
    """Return the building with a model of its `roof`.

    Raises CompositionError as `build` does.
    """
    from ..compose import compose as composed

    settings = dataclasses.replace(Settings(), compose=compose or ComposeSettings())
    solid = composed(roof, building.z_ground - roof.frame.origin[2], settings)
    model = Model(roof, solid.move(roof.frame.origin), compose)
    if underside.is_level:
        return dataclasses.replace(building, built=model)
    from ..compose.finish import add_underside

    return dataclasses.replace(building, built=add_underside(model, underside))
