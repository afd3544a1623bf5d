"""The roof type of a building as CityGML's and AdV's code lists name it."""

from __future__ import annotations

from ..model import Building

COMBINATION, ADV_MIXED = 1130, 5000
CITYGML_CODES = {
    "flat": 1000,
    "monopitch": 1010,
    "gable": 1030,
    "asymmetric_gable": 1030,
    "hip": 1040,
    "half_hip": 1050,
    "mansard": 1060,
    "gambrel": 1060,
    "pyramid": 1070,
    "shed": 1100,
}


def roof_type_code(building: Building) -> int | None:
    """SIG3D code of the roof type: the part's own, "combination" for parts of several types; None without a model."""
    kinds = {part.type for part in building.parts}
    if not kinds:
        return None
    return CITYGML_CODES.get(kinds.pop(), COMBINATION) if len(kinds) == 1 else COMBINATION
