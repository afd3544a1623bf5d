"""Cants: further planes of a member, over walls that cut corners off.

Bays and eight-sided towers have such walls.

Each rises square from its own wall:

    facing_cantK     the way out to the wall (degrees from the length, counter-clockwise)
    distance_cantK   how far the wall's line lies that way from the rectangle's middle (m)
    eave_cantK       the height of its eave above T_L (m)
    pitch_cantK      its slope (degrees)

As an array they are (4, c), of several members alike (4, c, m): facing (rad), distance (m), height
of the eave (m), slope.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from ..data_files import Values
from .contract import Parameters

MOST_CANTS = 8  # of a member: with its four sides it has twelve
MEASURES = ("facing", "distance", "eave", "pitch")
CANTS = tuple(f"cant{number}" for number in range(1, MOST_CANTS + 1))
# Every parameter of a cant.
CANTED = frozenset(f"{what}_{cant}" for cant in CANTS for what in MEASURES)


def no_cants() -> np.ndarray:
    return np.zeros((len(MEASURES), 0))


def compute_cant_planes(cants: np.ndarray) -> list[tuple[float, float, float]]:
    """Return the planes a, b, c of cants over u, v about the rectangle's middle.

    >>> compute_cant_planes(np.array([[0.0], [4.0], [3.0], [0.5]]))
    [(-0.5, -0.0, 5.0)]
    """
    return [
        (-slope * math.cos(facing), -slope * math.sin(facing), eave + slope * distance)
        for facing, distance, eave, slope in cants.T.tolist()
    ]


def turn_cants(cants: np.ndarray, quarters: int) -> np.ndarray:
    """Return the cants in axes that are turned by `quarters` times 90 degrees."""
    turned = cants.copy()
    turned[0] -= 0.5 * np.pi * quarters
    return turned


def name_cant_values(cants: np.ndarray, base: Any) -> Values:
    """Return the cants' parameters by name, with T_L at the height `base`."""
    words: Values = {}
    for cant, (facing, distance, eave, slope) in zip(CANTS, cants.swapaxes(0, 1), strict=False):
        once_round = 180.0 - np.remainder(180.0 - np.degrees(facing), 360.0)
        values = once_round, distance, eave - base, np.degrees(np.arctan(slope))
        words |= {
            f"{subject}_{cant}": value for subject, value in zip(MEASURES, values, strict=True)
        }
    return words


def read_cants(parameters: Parameters, base: float) -> np.ndarray:
    """Read cants (4, c) by name, T_L at the height `base`; raises KeyError if one is missing."""
    rows = [
        [parameters[f"{measure}_{cant}"] for measure in MEASURES] for cant in list_cants(parameters)
    ]
    facing, distance, eave, pitch = np.array(rows, float).reshape(-1, len(MEASURES)).T
    return np.array([np.radians(facing), distance, base + eave, np.tan(np.radians(pitch))])


def keep_cants_in_place(parameters: Parameters, along: float, across: float) -> dict[str, float]:
    """Return parameters that keep the cants' walls where they are.

    The middle of the part's rectangle went `along` and `across`.

    >>> keep_cants_in_place({"facing_cant1": 90.0, "distance_cant1": 5.0}, 2.0,
    ...     1.0)["distance_cant1"]
    4.0
    """
    remainder = dict(parameters)
    for cant in list_cants(parameters):
        facing = math.radians(parameters[f"facing_{cant}"])
        remainder[f"distance_{cant}"] -= along * math.cos(facing) + across * math.sin(facing)
    return remainder


def list_cants(parameters: Iterable[str]) -> list[str]:
    """Return the names of the cants that occur in parameters, in order.

    >>> list_cants(["width", "pitch_cant2", "pitch_cant1"])
    ['cant1', 'cant2']
    """
    return sorted({name.split("_")[1] for name in parameters if name in CANTED})
