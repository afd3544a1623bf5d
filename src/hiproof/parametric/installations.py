"""The installations of a building of a file of parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..compose.settle import DIGITS, round_number
from ..errors import InputError
from ..model import Installation
from ..model.installation import CHIMNEY, ROOF_OBJECT
from ..read.damage import excerpt
from ..write.attribute_list import TABLES
from .record import (
    list_at,
    measure,
    number,
    numbers_by_name,
    place,
    refuse_other_keys,
    require_mapping,
    round_values,
)

BOX_SIZES = ("length", "width", "height")


def read_installations(record: Mapping[str, Any]) -> tuple[Installation, ...]:
    """Read the installations of a building's object.

    Raises InputError for one that makes no box.
    """
    items = list_at(record, "installations")
    return tuple(read_installation(item, f"installation {k}") for k, item in enumerate(items))


def read_installation(record: Any, label: str) -> Installation:
    refuse_other_keys(require_mapping(record, label), TABLES["installation"].names, label)
    kind = record.get("type")
    if kind not in (CHIMNEY, ROOF_OBJECT):
        raise InputError(
            f"expected {CHIMNEY} or {ROOF_OBJECT} as the type of {label}, got {excerpt(kind)}"
        )
    sizes = numbers_by_name(record.get("parameters") or {}, f"the parameters of {label}")
    if sorted(sizes) != sorted(BOX_SIZES) or min(sizes.values()) <= 0:
        raise InputError(
            f"expected {', '.join(BOX_SIZES)} over 0 as the parameters of {label}, got "
            f"{excerpt(record.get('parameters'))}"
        )
    position = place(record.get("position"), f"position of {label}", measure)
    return Installation(
        str(kind),
        round_number(sizes["length"]),
        round_number(sizes["width"]),
        round_number(sizes["height"]),
        math.radians(round_number(number(record.get("rotation", 0.0), f"rotation of {label}"))),
        np.asarray(round_values(position, DIGITS)),
    )
