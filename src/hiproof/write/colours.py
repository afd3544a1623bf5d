"""One colour a roof type, the same in pictures, reports and converted models (chosen to be told apart by most eyes)."""

from __future__ import annotations

TYPE_COLOURS = {
    "flat": "#7f8c9b",
    "monopitch": "#e6b800",
    "gable": "#d1495b",
    "asymmetric_gable": "#f08a4b",
    "hip": "#2e86ab",
    "half_hip": "#5fc3e4",
    "pyramid": "#7b3fa0",
    "mansard": "#2a9d5c",
    "gambrel": "#93c54b",
    "shed": "#c98bdb",
    "side_hip": "#4fa3c7",
    "side_half_hip": "#8fd6ee",
    "corner": "#1f6f8b",
    "half_mansard": "#6fbf8f",
    "truncated_gable": "#4cb27a",
    "corner_mansard": "#1e7a46",
    "side_mansard": "#35a866",
    "free": "#a3785f",
    "unknown": "#b5b5b5",
}
WALL_COLOUR = "#e8e2d6"
GROUND_COLOUR = "#8c8c84"


def linear_rgb(colour: str) -> tuple[float, float, float]:
    """Linear red, green, blue in 0..1 of a `#rrggbb` sRGB colour, as glTF wants them.

    >>> linear_rgb("#ff0000")
    (1.0, 0.0, 0.0)
    """
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in srgb(colour))
    return red, green, blue


def srgb(colour: str) -> tuple[float, float, float]:
    """Red, green, blue in 0..1 of a `#rrggbb` colour as displayed."""
    red, green, blue = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue
