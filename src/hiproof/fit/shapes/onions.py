"""Find onions around round parts, which may be no more than their tops.

Of an onion the search makes a cone, a spire or a smaller onion over its neck, and planes or level
parts around it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from ...model import Part
from ...primitives.catalogue import ROUND
from ...settings import Settings
from .judged import JudgedRoof
from .regions import unite_outlines
from .round_tops import ALL_ROUND, FEWEST_AROUND, fit_round, measure_fall

WIDER_RADII = (1.2, 1.6, 2.2, 3.0)  # Of discs around a part, in radii of a circle of its area.


def list_onions(roof: JudgedRoof, part: Part, settings: Settings) -> Iterator[Part]:
    """Yield onions fitted to discs of points around a round part and beyond it."""
    if part.type not in ROUND:
        return
    xy, centre = roof.points[:, :2], part.translation[:2]
    wide = math.sqrt(part.area / math.pi)
    is_beside = ~shapely.contains_xy(unite_outlines([part]), *xy.T)
    for radius in (share * wide for share in WIDER_RADII):
        near = np.hypot(*(xy - centre).T) <= radius
        if (
            np.count_nonzero(near & is_beside) >= FEWEST_AROUND
            and measure_fall(roof.points, centre, radius, ALL_ROUND) > 0.0
        ):
            shape = fit_round(roof, roof.points[near], ("onion",), settings)
            if shape is not None:
                yield shape
