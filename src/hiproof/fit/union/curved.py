"""Replace parts by cones, spires, domes and barrels that points follow better.

The search knows planes alone. Of a round roof it makes a few pyramids and gables, and of a vault a
truncated gable. Where points lie alike in all directions around a part's top, or along a curve
across it, one curved shape is fitted to them and compared with the parts that it would replace.
"""

from __future__ import annotations

from itertools import chain

import numpy as np
import shapely

from ...model import Part
from ...primitives.cants import list_cants
from ...primitives.catalogue import CURVED, ROUND
from ...settings import Settings
from .barrels import list_barrels
from .judged import JudgedRoof, replace_parts
from .own import MOST_DISTANCE_M
from .round_tops import list_round_shapes

LEAST_MISFIT_M = 0.03  # Nobody sees that a part lies nearer (m, mean) to its points than this.
LEAST_NATS = 8.0  # A shape must be so much likelier (nats) than one part.
FEWEST_CURVE_POINTS = 12  # A curve takes five numbers, and as many points again to check them.


def fit_curved_shapes(
    parts: list[Part], points: np.ndarray, outline: shapely.Polygon, settings: Settings
) -> list[Part]:
    """Replace parts by curved shapes that follow the points (n, 3) better."""
    allowed = settings.fit.types or CURVED
    names = [name for name in CURVED if name in allowed]
    if not names:
        return parts
    inside = points[shapely.contains_xy(outline, points[:, 0], points[:, 1])]
    roof = JudgedRoof(parts, inside, outline)
    for _ in range(len(parts)):
        better = find_better_roof(roof, names, settings)
        if better is None:
            break
        roof = better
    return roof.parts


def find_better_roof(roof: JudgedRoof, names: list[str], settings: Settings) -> JudgedRoof | None:
    """Find the first part where a curved shape is better, with the best one."""
    distances, top = roof.measure_distances(MOST_DISTANCE_M), roof.highest[1]
    for k, part in enumerate(roof.parts):
        own = top == k
        if (
            part.type in CURVED
            or np.count_nonzero(own) < FEWEST_CURVE_POINTS
            or (distances[own].mean() < LEAST_MISFIT_M and not list_cants(part.parameters))
        ):
            continue
        shapes = chain(
            list_round_shapes(roof, part, own, tuple(n for n in names if n in ROUND), settings),
            list_barrels(roof, part, own, settings) if "barrel" in names else (),
        )
        gains = [replace_parts(roof, shape) for shape in shapes]
        gain, better = max(gains, key=lambda one: one[0], default=(0.0, roof))
        if gain > LEAST_NATS:
            return better
    return None
