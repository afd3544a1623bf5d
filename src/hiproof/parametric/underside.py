"""How a building of a file of parameters ends below."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..errors import InputError
from ..model import Building, Roof, Underside
from ..read.damage import excerpt


def read_underside(record: Mapping[str, Any], building: Building, roof: Roof) -> Underside:
    """Read the lower end of a building's solid, in the frame of its `roof`.

    Raises InputError for what makes none.
    """
    walls = record.get("walls", "level")
    if walls not in ("level", "terrain"):
        raise InputError(f"expected walls of level or terrain, got {excerpt(walls)}; choose one")
    lines = building.terrain_intersection if walls == "terrain" else ()
    return Underside(terrain=tuple(line - roof.frame.origin for line in lines))
