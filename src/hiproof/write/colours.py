"""Colours of roofs, models and distances, by data/colours.toml."""

from __future__ import annotations

from ..data_files import Values, read_data_file
from ..primitives.catalogue import CATALOGUE, describe_type
from ..status import Change

COLOURS = read_data_file("colours")
OTHER, NO_MODEL = "other", "no model"
ROOF_COLOURS: dict[str, str] = COLOURS["roof"]
GRADE_COLOURS, CHANGE_COLOURS = COLOURS["grade"], COLOURS["change"]
SURVEY_COLOURS, STATUS_COLOURS = COLOURS["survey"], COLOURS["status"]
WALL_COLOUR, GROUND_COLOUR, UNKNOWN_COLOUR = COLOURS["wall"], COLOURS["ground"], COLOURS["unknown"]
RESIDUAL_STOPS, SUN_STOPS = COLOURS["residual_stops"], COLOURS["sun_stops"]


def list_legend(kind: str | None) -> str:
    """Return the entry of a legend that lists a roof type.

    >>> list_legend("side_mansard"), list_legend("free")
    ('mansard', 'other')
    """
    return CATALOGUE[kind].legend if kind in CATALOGUE else OTHER


def type_colour(kind: str | None) -> str:
    """Return the colour (#rrggbb) of a roof type, which is that of its legend entry.

    >>> type_colour("gable")
    '#b84f0c'
    """
    return ROOF_COLOURS[list_legend(kind)]


def type_colours() -> dict[str, str]:
    """Return the colour (#rrggbb) of every roof type, of "free" and of "unknown"."""
    return {kind: type_colour(kind) for kind in (*CATALOGUE, "free", "unknown")}


def page_colours() -> Values:
    """Return what a page needs to colour models and to draw its legend."""
    return {
        "legends": {kind: list_legend(kind) for kind in CATALOGUE},
        "words": {kind: describe_type(kind) for kind in CATALOGUE},
        "type": ROOF_COLOURS,
        "wall": WALL_COLOUR,
        "mark": COLOURS["mark"],
        "unknown": UNKNOWN_COLOUR,
        "residual": RESIDUAL_STOPS,
        "sun": SUN_STOPS,
        "change": {Change.UNCHANGED.code: COLOURS["unchanged"], **CHANGE_COLOURS},
    }


def linear_rgb(colour: str) -> tuple[float, float, float]:
    """Return linear red, green, blue in 0..1 of a `#rrggbb` sRGB colour.

    glTF wants them so.

    >>> linear_rgb("#ff0000")
    (1.0, 0.0, 0.0)
    """
    red, green, blue = (
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in srgb(colour)
    )
    return red, green, blue


def srgb(colour: str) -> tuple[float, float, float]:
    """Return red, green, blue in 0..1 of a `#rrggbb` colour as displayed."""
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue
