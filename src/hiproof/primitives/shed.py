"""Shed (saw-tooth, CityGML 1100): 2 to 6 equal monopitches in a row."""

from collections.abc import Mapping

from .algebra import V, q0, q1
from .contract import Primitive, rectangle
from .table import make_shape

# of a saw-tooth that is one primitive; longer rows are put together from volumes
TEETH = range(2, 7)


def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Return four corners a tooth, v1..v4 as a monopitch has them, from -v to +v."""
    teeth = round(p["teeth"])
    tooth = {"width": p["width"] / teeth, "length": p["length"]}
    centres = [(2 * k + 1 - teeth) * tooth["width"] / 2 for k in range(teeth)]
    return [
        (u, v + centre, z) for centre in centres for u, v, z in rectangle(tooth, upper=p["height"])
    ]


def make_saw_tooth(teeth: int, more: tuple[Primitive, ...] = ()) -> Primitive:
    """Return the saw-tooth roof with so many teeth."""
    return make_shape(
        "shed",
        {"teeth": teeth},
        planes=tuple((0, q1, q0 + q1 * V * (1 - 2 * k / teeth)) for k in range(teeth)),
        corners=corners,
        faces=tuple((4 * k + 1, 4 * k, 4 * k + 3, 4 * k + 2) for k in range(teeth)),
        strips=teeth,
        more=more,
    )


SHED = make_saw_tooth(TEETH[0], tuple(make_saw_tooth(teeth) for teeth in TEETH[1:]))
