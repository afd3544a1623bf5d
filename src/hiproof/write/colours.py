"""Colours of roofs, models and distances.

They are the same in pictures, pages, styles and converted models.

A legend has at most eight colours. People with any colour vision deficiency can distinguish them:
two of a legend differ by at least 25 (residuals: 20) in CIELAB, as everyone sees them.
"""

from __future__ import annotations

from typing import Any

from ..primitives.catalogue import CATALOGUE, describe_type
from ..status import Change

OTHER = "other"
# Colour of each entry of a legend of roof types; "other" holds free shapes and unknown types.
ROOF_COLOURS = {
    "flat": "#7a8069",
    "monopitch": "#dfba20",
    "gable": "#b84f0c",
    "hip": "#05429b",
    "half hip": "#4e8cff",
    "mansard": "#29d874",
    "pyramid": "#f47ccb",
    OTHER: "#7a4372",
}

WALL_COLOUR = "#e8e2d6"
GROUND_COLOUR = "#8c8c84"
MARK_COLOUR = "#1d1d1d"  # of what is selected
UNKNOWN_COLOUR = "#b5b5b5"  # of values that are not known
GRADE_COLOURS = {"good": "#05429b", "fair": "#dfba20", "poor": "#b84f0c"}
CHANGE_COLOURS = {
    "changed": "#b84f0c",
    "new": "#05429b",
    "gone": "#1d1d1d",
    "uncertain": "#dfba20",
    "not_covered": "#b5b5b5",
    "outside": "#66aaee",
}
UNCHANGED_COLOUR = "#ffffff"  # beside those, in pages that show all buildings
SURVEY_COLOURS = {"before": "#05429b", "after": "#b84f0c"}  # points of an update's two surveys
NO_MODEL = "no model"
STATUS_COLOURS = {
    "modelled": "#05429b",
    "simplified": "#dfba20",
    "flat_fallback": "#b84f0c",
    "from_attributes": "#66aaee",
    "internal_error": "#1d1d1d",
    NO_MODEL: UNKNOWN_COLOUR,
}
# Colour from each distance in metres upwards, blue near and red far.
RESIDUAL_STOPS = (
    (0.0, "#2c7bb6"),
    (0.05, "#9bd0e8"),
    (0.1, "#ffee80"),
    (0.2, "#f58a3c"),
    (0.4, "#a01428"),
)


# Colour from each irradiation in a year (kWh/m2) upwards: north roofs and shade are blue, and the
# best roofs of northern and of southern Europe are orange and red.
SUN_STOPS = (
    (0.0, "#2c7bb6"),
    (500.0, "#9bd0e8"),
    (800.0, "#ffee80"),
    (1100.0, "#f58a3c"),
    (1500.0, "#a01428"),
)


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


def page_colours() -> dict[str, Any]:
    """Return what a page needs to colour models and to draw its legend."""
    return {
        "legends": {kind: list_legend(kind) for kind in CATALOGUE},
        "words": {kind: describe_type(kind) for kind in CATALOGUE},
        "type": ROOF_COLOURS,
        "wall": WALL_COLOUR,
        "mark": MARK_COLOUR,
        "unknown": UNKNOWN_COLOUR,
        "residual": [list(stop) for stop in RESIDUAL_STOPS],
        "sun": [list(stop) for stop in SUN_STOPS],
        "change": {Change.UNCHANGED.code: UNCHANGED_COLOUR, **CHANGE_COLOURS},
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
