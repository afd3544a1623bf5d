"""How a building of a file of parameters ends below."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..compose.settle import PLAN_DIGITS, round_number
from ..errors import InputError
from ..model import Building, Passage, Roof, Underside
from ..read.damage import excerpt
from ..write.attribute_list import TABLES
from .record import list_at, measure, on_grid, polygon, refuse_other_keys, require_mapping


def read_underside(record: Mapping[str, Any], building: Building, roof: Roof) -> Underside:
    """Read the lower end of a building's solid, in the frame of its `roof`.

    Raises InputError for what makes none.
    """
    walls = record.get("walls", "level")
    if walls not in ("level", "terrain"):
        raise InputError(f"expected walls of level or terrain, got {excerpt(walls)}; choose one")
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
    refuse_other_keys(require_mapping(record, label), TABLES["passage"].names, label)
    outline = on_grid(polygon(record.get("outline"), f"the outline of {label}"))
    ceiling = measure(record.get("ceiling"), f"the ceiling of {label}")
    return Passage(outline, round_number(ceiling, PLAN_DIGITS) - z_origin)
