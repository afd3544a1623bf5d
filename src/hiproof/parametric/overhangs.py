"""The overhangs of a building of a file of parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..compose.settle import DIGITS, round_number
from ..errors import InputError
from ..geometry.outline_edges import list_outline_edges
from ..model import Eaves, Overhang, Roof
from ..model.overhang import ROOF_EDGE, WALLS
from ..read.damage import excerpt
from ..write.attribute_list import TABLES
from .record import figure, list_at, number, refuse_other_keys, require_mapping

MOST_OVERHANG_M = 10.0  # longer ones are typing errors


def read_eaves(record: Mapping[str, Any], roof: Roof) -> Eaves | None:
    """Read the overhangs of a building's object, None where it has no list of them.

    Raises InputError for one that its `roof` cannot have.
    """
    if record.get("overhangs") is None:
        return None
    kind = record.get("footprint_kind", WALLS)
    if kind not in (WALLS, ROOF_EDGE):
        raise InputError(
            f"expected a footprint_kind of {WALLS} or {ROOF_EDGE}, got {excerpt(kind)}; choose one"
        )
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
    refuse_other_keys(require_mapping(record, label), TABLES["overhang"].names, label)
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
