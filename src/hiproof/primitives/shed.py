"""Shed (saw-tooth, CityGML 1100): 2 to 6 equal monopitches in a row.

Each rises towards +v to a vertical step.
"""

from collections.abc import Mapping

import numpy as np

from .algebra import U, V, formula, q0, q1
from .contract import SLOPE_MAX, Primitive, Vote, rectangle
from .drawing import drawn_slope

# of a saw-tooth that is one primitive; longer rows are put together from volumes
TEETH = range(2, 7)


def corners(p: Mapping[str, float]) -> list[tuple[float, float, float]]:
    """Return four corners a tooth, v1..v4 as a monopitch has them.

    Teeth run from -v to +v.
    """
    teeth = round(p["teeth"])
    tooth = {"width": p["width"] / teeth, "length": p["length"]}
    centres = [(2 * k + 1 - teeth) * tooth["width"] / 2 for k in range(teeth)]
    return [
        (u, v + centre, z) for centre in centres for u, v, z in rectangle(tooth, upper=p["height"])
    ]


def draw(rng: np.random.Generator, width: float) -> dict[str, float]:
    teeth, tooth = int(rng.integers(3, 7)), float(rng.uniform(3.5, 7.0))
    length = max(width, 7.0) * float(rng.uniform(1.0, 2.0))
    return {
        "width": teeth * tooth,
        "length": length,
        "height": tooth * drawn_slope(rng, 14, 34),
        "teeth": float(teeth),
    }


def saw_tooth(teeth: int, additions: tuple[Primitive, ...] = ()) -> Primitive:
    """Return the saw-tooth roof with `teeth` teeth.

    q0 is the height at each tooth's foot.
    """
    return Primitive(
        name="shed",
        citygml_code="1100",
        adv_code="3800",
        osm_shape="sawtooth",
        legend="monopitch",
        measures={
            "width": 2 * V,
            "length": 2 * U,
            "height": (2 / teeth) * q1 * V,
            "teeth": formula(teeth),
        },
        eave=q0,
        planes=tuple((0, q1, q0 + q1 * V * (1 - 2 * k / teeth)) for k in range(teeth)),
        shape=lambda p: (
            p["width"] / 2,
            p["length"] / 2,
            0.0,
            teeth * p["height"] / p["width"],
            0.0,
            0.0,
        ),
        corners=corners,
        faces=tuple((4 * k + 1, 4 * k, 4 * k + 3, 4 * k + 2) for k in range(teeth)),
        typical=lambda width, length, height: {
            "width": width,
            "length": length,
            "height": height,
            "teeth": teeth,
        },
        draw=draw,
        bounds=((0.08, SLOPE_MAX),),
        vote=Vote(turns=4, slopes=(0.2, 0.35, 0.5, 0.65, 0.8, 1.0)),
        half_turn_symmetric=False,
        strips=teeth,
        more=additions,
    )


PRIMITIVE = saw_tooth(TEETH[0], tuple(saw_tooth(teeth) for teeth in TEETH[1:]))
