"""Colours that everyone can distinguish: few in a legend, far apart for every colour vision."""

from itertools import combinations

import numpy as np
import pytest

from hiproof.primitives import CATALOGUE
from hiproof.write.colours import (
    CHANGE_COLOURS,
    COLOURS,
    GRADE_COLOURS,
    RESIDUAL_STOPS,
    ROOF_COLOURS,
    STATUS_COLOURS,
    SUN_STOPS,
    UNKNOWN_COLOUR,
    WALL_COLOUR,
    linear_rgb,
    type_colour,
)

# linear RGB as people see it: all cones, and without one kind of them (Machado et al. 2009, table)
SEEN = {
    "all cones": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
LEGENDS = {
    "roof types": [*ROOF_COLOURS.values(), WALL_COLOUR, COLOURS["mark"]],
    "quality": [*GRADE_COLOURS.values(), UNKNOWN_COLOUR],
    "status": list(STATUS_COLOURS.values()),
    "changes": [*CHANGE_COLOURS.values(), COLOURS["unchanged"]],
    "residuals": [colour for _, colour in RESIDUAL_STOPS],
    "sun": [colour for _, colour in SUN_STOPS],
}
FAR = {"residuals": 20.0, "sun": 20.0}  # in CIELAB, neighbours of a ramp may be nearer than others
FAR_ELSE = 25.0


def cielab(linear):
    """CIELAB of linear RGB under daylight (D65)."""
    share = XYZ @ np.clip(linear, 0, 1) / XYZ.sum(axis=1)
    root = np.where(share > 0.008856, np.cbrt(share), 7.787 * share + 16 / 116)
    return np.array([116 * root[1] - 16, 500 * (root[0] - root[1]), 200 * (root[1] - root[2])])


@pytest.mark.parametrize("vision", SEEN)
@pytest.mark.parametrize("legend", LEGENDS)
def test_colours_of_a_legend_are_far_apart(legend, vision):
    colours = [cielab(np.array(SEEN[vision]) @ linear_rgb(colour)) for colour in LEGENDS[legend]]
    nearest = min(np.linalg.norm(a - b) for a, b in combinations(colours, 2))
    assert nearest >= FAR.get(legend, FAR_ELSE)


def test_a_legend_has_at_most_eight_colours():
    legends = (ROOF_COLOURS, GRADE_COLOURS, STATUS_COLOURS, RESIDUAL_STOPS)
    assert max(map(len, legends)) <= 8
    assert {type_colour(kind) for kind in (*CATALOGUE, "free", None)} == set(ROOF_COLOURS.values())
