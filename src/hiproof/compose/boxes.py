"""Boxes on roofs: installations as solids."""

from __future__ import annotations

import math

import numpy as np
import shapely

from ..model import Installation, Solid
from .blocks import block
from .settle import PLAN_DIGITS


def make_box(installation: Installation) -> Solid:
    """Return an installation as a solid, in the roof's frame.

    >>> make_box(Installation("chimney", 1.0, 0.5, 2.0)).volume
    1.0
    """
    c, s = math.cos(installation.kappa), math.sin(installation.kappa)
    half = 0.5 * np.array([installation.length, installation.width])
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half
    x, y, z = installation.position
    plan = np.round(corners @ np.array([[c, s], [-s, c]]) + [x, y], PLAN_DIGITS)
    low, high = (round(level, PLAN_DIGITS) for level in (z, z + installation.height))
    return block(shapely.Polygon(plan), low, high)
