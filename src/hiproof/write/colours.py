"""One colour a roof type, the same in pictures, reports and converted models (chosen to be told
apart by most eyes).
"""

from __future__ import annotations

from ..primitives.catalogue import CATALOGUE

UNKNOWN_COLOUR = "#b5b5b5"
NO_TYPES = {"free": "#a3785f", "unknown": UNKNOWN_COLOUR}
WALL_COLOUR = "#e8e2d6"
GROUND_COLOUR = "#8c8c84"
GRADE_COLOURS = {"good": "#2a9d5c", "fair": "#e6b800", "poor": "#d1495b"}


def type_colours() -> dict[str, str]:
    """The colour (#rrggbb) of every roof type, of "free" and of "unknown".

    >>> type_colours()["gable"]
    '#d1495b'
    """
    return {name: shape.colour for name, shape in CATALOGUE.items()} | NO_TYPES


def type_colour(name: str | None) -> str:
    """The colour (#rrggbb) of a roof type; that of unknown ones of any other name."""
    return type_colours().get(name or "unknown", UNKNOWN_COLOUR)


def linear_rgb(colour: str) -> tuple[float, float, float]:
    """Linear red, green, blue in 0..1 of a `#rrggbb` sRGB colour, as glTF wants them.

    >>> linear_rgb("#ff0000")
    (1.0, 0.0, 0.0)
    """
    red, green, blue = (
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in srgb(colour)
    )
    return red, green, blue


def srgb(colour: str) -> tuple[float, float, float]:
    """Red, green, blue in 0..1 of a `#rrggbb` colour as displayed."""
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue
