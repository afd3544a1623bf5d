"""All roof shapes by name. A new shape is one file with its `PRIMITIVE` and one line here; it inherits every test."""

from ..errors import SettingsError
from . import asymmetric_gable, flat, gable, gambrel, half_hip, hip, mansard, monopitch, pyramid, shed
from .contract import Primitive

CATALOGUE: dict[str, Primitive] = {
    "flat": flat.PRIMITIVE,
    "monopitch": monopitch.PRIMITIVE,
    "gable": gable.PRIMITIVE,
    "hip": hip.PRIMITIVE,
    "half_hip": half_hip.PRIMITIVE,
    "pyramid": pyramid.PRIMITIVE,
    "mansard": mansard.PRIMITIVE,
    "shed": shed.PRIMITIVE,
    "asymmetric_gable": asymmetric_gable.PRIMITIVE,
    "gambrel": gambrel.PRIMITIVE,
}


def get(name: str) -> Primitive:
    """The primitive called `name`. Raises SettingsError, naming the known ones, for any other.

    >>> get("gable").parameters
    ('width', 'length', 'height')
    """
    if name not in CATALOGUE:
        raise SettingsError(f"expected a roof type ({', '.join(CATALOGUE)}), got {name!r}; see `hiproof settings`")
    return CATALOGUE[name]
