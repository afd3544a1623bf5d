"""All roof shapes by name, each a row of data/shapes.toml that every test covers."""

from ..errors import SettingsError
from . import cone, shed
from . import revolved as onion
from . import revolved as vault
from .contract import Primitive
from .table import SHAPE_ROWS, make_shape

# shapes whose planes are counted, by their row
COUNTED_SHAPES = {
    "shed": shed.SHED,
    "cone": cone.CONE,
    "broach": cone.BROACH,
    "dome": vault.DOME,
    "barrel": vault.BARREL,
    "half_cone": cone.HALF_CONE,
    "hexagonal_spire": cone.HEXAGONAL_SPIRE,
    "onion": onion.ONION,
}
CATALOGUE: dict[str, Primitive] = {
    name: COUNTED_SHAPES.get(name) or make_shape(name)
    for name, row in SHAPE_ROWS.items()
    if "variant_of" not in row
}
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


def describe_type(kind: str) -> str:
    """Return what people call a roof type, with its name where that differs.

    What is no type of the catalogue stays as it is.

    >>> describe_type("side_hip"), describe_type("half_hip"), describe_type("free")
    ('hip at one side (side_hip)', 'half hip', 'free')
    """
    if kind not in CATALOGUE:
        return kind
    words = SHAPE_ROWS[kind].get("words")
    return f"{words} ({kind})" if words else kind.replace("_", " ")
