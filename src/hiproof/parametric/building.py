"""One building from its parameters: composed, checked and described."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from ..compose.settle import DIGITS, PLAN_DIGITS, round_number
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
from ..model.installation import CHIMNEY, ROOF_OBJECT
from ..model.overhang import ROOF_EDGE, WALLS
from ..read.models.damage import excerpt
from ..settings import ComposeSettings, Settings
from .record import (
    figure,
    list_at,
    measure,
    number,
    numbers_by_name,
    on_grid,
    polygon,
    read_building,
    read_position,
    refuse_other_keys,
    require_code,
    require_mapping,
)


def read_underside(record: Mapping[str, Any], building: Building, roof: Roof) -> Underside:
    """Read a solid's lower end in the frame of its `roof`; InputError for what makes none."""
    walls = record.get("walls", "level")
    require_code(walls, ("level", "terrain"), "walls of level or terrain", "; choose one")
    lines = building.terrain_intersection if walls == "terrain" else ()
    return Underside(
        terrain=tuple(line - roof.frame.origin for line in lines),
        passages=tuple(
            read_passage(item, f"passage {k}", float(roof.frame.origin[2]))
            for k, item in enumerate(list_at(record, "passages"))
        ),
    )


def read_passage(record: Any, label: str, z_origin: float) -> Passage:
    """Read a passage; its ceiling is in the world, `z_origin` the height of the frame."""
    refuse_other_keys(record, "passage", label)
    outline = on_grid(polygon(record.get("outline"), f"the outline of {label}"))
    ceiling = measure(record.get("ceiling"), f"the ceiling of {label}")
    return Passage(outline, round_number(ceiling, PLAN_DIGITS) - z_origin)


MOST_OVERHANG_M = 10.0  # longer ones are typing errors


def read_eaves(record: Mapping[str, Any], roof: Roof) -> Eaves | None:
    """Read the overhangs, None without a list; raises InputError for one that cannot be."""
    if record.get("overhangs") is None:
        return None
    kind = record.get("footprint_kind", WALLS)
    kinds = f"a footprint_kind of {WALLS} or {ROOF_EDGE}"
    require_code(kind, (WALLS, ROOF_EDGE), kinds, "; choose one")
    thickness = number(record.get("roof_thickness", 0.2), "roof_thickness")
    if not 0.0 < thickness <= MOST_OVERHANG_M:
        raise InputError(
            f"expected a roof_thickness over 0 m and up to {MOST_OVERHANG_M:g} m, got {thickness:g}"
        )
    count = len(list_outline_edges(roof.outline).starts)
    overhangs = tuple(
        read_overhang(item, f"overhang {k}", count)
        for k, item in enumerate(list_at(record, "overhangs"))
    )
    return Eaves(overhangs, round_number(thickness, DIGITS), kind)


def read_overhang(record: Any, label: str, count: int) -> Overhang:
    """Read an overhang at one of `count` edges."""
    refuse_other_keys(record, "overhang", label)
    edge = record.get("edge")
    if not isinstance(edge, int) or not 0 <= edge < count:
        raise InputError(
            f"expected an edge from 0 to {count - 1} of {label}, got {excerpt(edge)}; count the "
            "edges of the outline"
        )
    length = number(record.get("length"), f"length of {label}")
    if not 0.0 < length <= MOST_OVERHANG_M:
        raise InputError(
            f"expected a length over 0 m and up to {MOST_OVERHANG_M:g} m of {label}, got {length:g}"
        )
    sigma = figure(record, "sigma")
    return Overhang(edge, round_number(length, DIGITS), round_number(sigma, DIGITS))


BOX_SIZES = ("length", "width", "height")


def read_installation(record: Any, label: str) -> Installation:
    refuse_other_keys(record, "installation", label)
    kind = record.get("type")
    kinds = f"{CHIMNEY} or {ROOF_OBJECT} as the type of {label}"
    require_code(kind, (CHIMNEY, ROOF_OBJECT), kinds)
    sizes = numbers_by_name(record.get("parameters") or {}, f"the parameters of {label}")
    if sorted(sizes) != sorted(BOX_SIZES) or min(sizes.values()) <= 0:
        raise InputError(
            f"expected {', '.join(BOX_SIZES)} over 0 as the parameters of {label}, got "
            f"{excerpt(record.get('parameters'))}"
        )
    position, kappa = read_position(record, label)
    length, width, height = (round_number(sizes[name]) for name in BOX_SIZES)
    return Installation(str(kind), length, width, height, kappa, position)


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
    items = list_at(parameters, "installations")
    installations = tuple(read_installation(x, f"installation {k}") for k, x in enumerate(items))
    eaves = read_eaves(parameters, roof)
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
