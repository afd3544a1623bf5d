"""The roof type of a building as CityGML's code list names it."""

from __future__ import annotations

from ..model import Building
from ..primitives.family import citygml_code

COMBINATION = "1130"


def roof_type_code(building: Building) -> str | None:
    """SIG3D code of the roof: its parts' own if all have one, else "combination of roof forms"; None without a model."""
    if building.solid is None or not building.parts:
        return None
    codes = {citygml_code(part.type) or COMBINATION for part in building.parts}
    return codes.pop() if len(codes) == 1 else COMBINATION
