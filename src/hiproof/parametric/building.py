"""One building from its parameters: composed, checked and described."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from ..compose.settle import DIGITS, PLAN_DIGITS, round_number
from ..data_files import Values
from ..errors import InputError
from ..geometry.outline_edges import list_outline_edges
from ..model import (
    ONE_LEVEL,
    Building,
    Eaves,
    Installation,
    Model,
    Overhang,
    Passage,
    Roof,
    Underside,
)
from ..model.overhang import WALLS
from ..read.models.damage import excerpt
from ..settings import ComposeSettings, Settings
from ..stages.judge import remark_ground
from .record import make_building, on_grid, read_object, read_position, require_mapping


def make_underside(values: Values, building: Building, roof: Roof) -> Underside:
    """Make a solid's lower end in the frame of its `roof`; InputError for what makes none."""
    origin = roof.frame.origin
    lines = building.terrain_intersection if values.get("walls") == "terrain" else ()
    passages = values.get("passages", ())
    return Underside(
        terrain=tuple(line - origin for line in lines),
        passages=tuple(make_passage(passage, float(origin[2])) for passage in passages),
    )


def read_passage(record: Any, label: str, z_origin: float) -> Passage:
    """Read a passage; its ceiling is in the world, `z_origin` the height of the frame."""
    return make_passage(read_object(record, "passage", label), z_origin)


def make_passage(values: Values, z_origin: float) -> Passage:
    ceiling = round_number(values["ceiling"], PLAN_DIGITS)
    return Passage(on_grid(values["outline"]), ceiling - z_origin)


MOST_OVERHANG_M = 10.0  # longer ones are typing errors


def make_eaves(values: Values, roof: Roof) -> Eaves | None:
    """Make the overhangs, None without a list; raises InputError for one that cannot be."""
    if values.get("overhangs") is None:
        return None
    count = len(list_outline_edges(roof.outline).starts)
    overhangs = []
    for k, overhang in enumerate(values["overhangs"]):
        edge, label = overhang["edge"], f" of overhang {k}"
        if edge not in range(count):
            raise InputError(
                f"expected an edge from 0 to {count - 1}{label}, got {excerpt(edge)}; count "
                "the edges of the outline"
            )
        length = check_overhang(overhang["length"], "length", label)
        sigma = round_number(overhang.get("sigma", math.nan), DIGITS)
        overhangs.append(Overhang(int(edge), length, sigma))
    thickness = check_overhang(values.get("roof_thickness", 0.2), "roof_thickness")
    return Eaves(tuple(overhangs), thickness, values.get("footprint_kind", WALLS))


def check_overhang(value_m: float, name: str, label: str = "") -> float:
    """Check a length or a thickness of an overhang."""
    if not 0.0 < value_m <= MOST_OVERHANG_M:
        raise InputError(
            f"expected a {name} over 0 m and up to {MOST_OVERHANG_M:g} m{label}, got {value_m:g}"
        )
    return round_number(value_m, DIGITS)


def make_installation(values: Values, label: str) -> Installation:
    sizes = [values["parameters"].get(name, 0.0) for name in BOX_SIZES]
    if len(values["parameters"]) != len(BOX_SIZES) or min(sizes) <= 0:
        raise InputError(
            f"expected {', '.join(BOX_SIZES)} over 0 as the parameters of {label}, got "
            f"{excerpt(values['parameters'])}"
        )
    position, kappa = read_position(values, label)
    length, width, height = map(round_number, sizes)
    return Installation(values["type"], length, width, height, kappa, position)


BOX_SIZES = ("length", "width", "height")


def build(parameters: Values, compose: ComposeSettings | None = None) -> Building:
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
    values = read_object(parameters, "building")
    building, roof = make_building(values)
    if roof is None:
        return building
    result = with_model(building, roof, compose, make_underside(values, building, roof))
    result = remark_ground(result)
    items = enumerate(values.get("installations", ()))
    installations = tuple(make_installation(item, f"installation {k}") for k, item in items)
    eaves = make_eaves(values, roof)
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
    """Return the building with a model of its `roof`; raises CompositionError as `build`."""
    from ..compose import compose as composed

    settings = dataclasses.replace(Settings(), compose=compose or ComposeSettings())
    solid = composed(roof, building.z_ground - roof.frame.origin[2], settings)
    model = Model(roof, solid.move(roof.frame.origin), compose)
    if underside.is_level:
        return dataclasses.replace(building, built=model)
    from ..compose.underside import add_underside

    return dataclasses.replace(building, built=add_underside(model, underside))
