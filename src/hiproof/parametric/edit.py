"""`Building.with_part` and `without_part`: parts changed, added, removed."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ..data_files import Values
from ..errors import InputError
from ..model import Building, Quality
from ..status import Status
from ..write.parameters import building_record
from .arrange import replace_part
from .building import build
from .change import change_part

BY_HAND = "changed by hand"


def with_part(building: Building, index: int, **change: Any) -> Building:
    """Return the building with part `index` changed or added; see `Building.with_part`."""
    z_origin, record = float(building.roof.frame.origin[2]), building_record(building)
    parts = record["parts"]
    change = {name: convert_to_plain(value) for name, value in change.items()}
    if not 0 <= index <= len(parts):
        raise InputError(
            f"expected a part from 0 to {len(parts)} (the last adds one), got {index}; choose one"
        )
    if index == len(parts):
        parts = [*parts, new_part(change, z_origin)]
    else:
        parts = replace_part(parts, index, change_part(parts[index], change, z_origin))
    return rebuild(building, {**record, "parts": parts})


def convert_to_plain(value: Any) -> Any:
    """Convert a value to the form of a file of parameters.

    Arrays and tuples become lists, NumPy's numbers Python's.

    >>> convert_to_plain((np.int64(1), np.array([2.5, 3.0])))
    [1, [2.5, 3.0]]
    """
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return [convert_to_plain(item) for item in value] if isinstance(value, (list, tuple)) else value


def new_part(change: Values, z_origin: float) -> Values:
    """Return a new part, given at least its type, position, width and length."""
    missing = [name for name in ("type", "position", "width", "length") if change.get(name) is None]
    if missing:
        raise InputError(
            "expected type, position, width and length of a new part, got none for "
            f"{', '.join(missing)}; give them too"
        )
    sizes = {name: change[name] for name in ("width", "length")}
    flat = {"type": "flat", "parameters": sizes, "position": change["position"], "rotation": 0.0}
    return change_part(flat, change, z_origin)


def without_part(building: Building, index: int) -> Building:
    """Return the building without part `index`, whose roof the part beside it takes over."""
    count, record = len(building.roof.parts), building_record(building)
    if count < 2 or not 0 <= index < count:
        raise InputError(
            f"expected one of two or more parts to leave out, got {index} of {count}; keep one at "
            "least"
        )
    parts = record["parts"]
    return rebuild(building, {**record, "parts": [*parts[:index], *parts[index + 1 :]]})


def rebuild(building: Building, record: Values) -> Building:
    """Return the building of a changed record, composed as it was, without old figures."""
    result = build(
        {**record, "status": Status.MODELLED.code, "quality": None, "detail": BY_HAND},
        building.model.compose,
    )
    return dataclasses.replace(
        result,
        quality=Quality(points=building.quality.points, density=building.quality.density),
        footprint=building.footprint,
        attributes=building.attributes,
    )
