"""All roof shapes by name. A new shape is one file with its `PRIMITIVE` and its name here; it inherits every test."""

from ..errors import SettingsError
from . import (
    asymmetric_gable,
    corner,
    corner_mansard,
    flat,
    gable,
    gambrel,
    half_hip,
    half_mansard,
    hip,
    mansard,
    monopitch,
    pyramid,
    shed,
    side_half_hip,
    side_hip,
    side_mansard,
    truncated_gable,
)
from .contract import Primitive

# In the order in which types are tried and told; where several have planes on the same sides, the first is the general one.
SHAPES = (
    *(flat, monopitch, gable, hip, half_hip, pyramid, mansard, shed, asymmetric_gable, gambrel),
    *(side_hip, side_half_hip, half_mansard, truncated_gable, side_mansard, corner, corner_mansard),
)
CATALOGUE: dict[str, Primitive] = {shape.PRIMITIVE.name: shape.PRIMITIVE for shape in SHAPES}


def get(name: str) -> Primitive:
    """The primitive called `name`. Raises SettingsError, naming the known ones, for any other.

    >>> get("gable").parameters
    ('width', 'length', 'height')
    """
    if name not in CATALOGUE:
        raise SettingsError(f"expected a roof type ({', '.join(CATALOGUE)}), got {name!r}; see `hiproof settings`")
    return CATALOGUE[name]
