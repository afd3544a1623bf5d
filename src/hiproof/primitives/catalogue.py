"""All roof shapes by name.

A new shape is one file with its `PRIMITIVE` and its name here; every test covers it.
"""

from ..errors import SettingsError
from . import (
    asymmetric_gable,
    cone,
    corner,
    flat,
    gable,
    gambrel,
    half_cone,
    half_hip,
    halves,
    hip,
    mansard,
    monopitch,
    onion,
    pyramid,
    shed,
    truncated_gable,
    vault,
)
from .contract import Primitive

# Types are tried and listed in this order. Of several with planes on the same sides the first is
# the general one.
SHAPES = (
    flat.PRIMITIVE,
    monopitch.PRIMITIVE,
    gable.PRIMITIVE,
    hip.PRIMITIVE,
    half_hip.PRIMITIVE,
    pyramid.PRIMITIVE,
    mansard.PRIMITIVE,
    shed.PRIMITIVE,
    asymmetric_gable.PRIMITIVE,
    gambrel.PRIMITIVE,
    halves.SIDE_HIP,
    halves.SIDE_HALF_HIP,
    halves.HALF_MANSARD,
    truncated_gable.PRIMITIVE,
    halves.SIDE_MANSARD,
    corner.PRIMITIVE,
    halves.CORNER_MANSARD,
    cone.CONE,
    cone.BROACH,
    vault.DOME,
    vault.BARREL,
    half_cone.HALF_CONE,
    cone.HEXAGONAL_SPIRE,
    onion.ONION,
)
CATALOGUE: dict[str, Primitive] = {shape.name: shape for shape in SHAPES}
ROUND = ("cone", "broach", "hexagonal_spire", "dome", "onion")  # over a round or many-sided plan
# whose facets stand for a curved surface, or are more than a volume's
CURVED = (*ROUND, "barrel", "half_cone")
# whose facets all stand for one curved surface
SMOOTH = tuple(name for name, shape in CATALOGUE.items() if shape.refine is not None)


def get(name: str) -> Primitive:
    """Return the primitive called `name`.

    Raises SettingsError, which lists the known names, for any other.

    >>> get("gable").parameters
    ('width', 'length', 'height')
    """
    if name not in CATALOGUE:
        raise SettingsError(
            f"expected a roof type ({', '.join(CATALOGUE)}), got {name!r}; see `hiproof settings`"
        )
    return CATALOGUE[name]
