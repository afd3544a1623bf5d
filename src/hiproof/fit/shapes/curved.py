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
from ...model.heights import find_highest
from ...primitives.cants import list_cants
from ...primitives.catalogue import CURVED, ROUND
from ...settings import Settings
from .barrels import list_barrels
from .bases import lay_base
from .custom import MOST_DISTANCE_M
from .drums import place_drums
from .judged import JudgedRoof, measure_gain, measure_slope, replace_parts, scale_cap, trim_parts
from .onions import list_onions
from .round_ends import MOVABLE, RoundEnd, find_round_ends, list_end_shapes
from .round_tops import LEAST_FALL_M, list_round_shapes

LEAST_MISFIT_M = 0.03  # Nobody sees that a part lies nearer (m, mean) to its points than this.
LEAST_NATS = 8.0  # A shape must be so much likelier (nats) than one part.
LEAST_NATS_ON_ARC = 3.0  # The same over a round end of the outline, which speaks for it.
# The same over a regular polygon: all planes of a spire follow from two numbers.
LEAST_NATS_OF_SPIRE = -4.0
# Over half a disc, a whole shape must be so much likelier (nats): its other half would be hidden.
WHOLE_NATS = 8.0
LEAST_VISIBLE = 0.4  # Smallest share of the points over a shape at which it is the highest part.
FEWEST_CURVE_POINTS = 12  # A curve takes five numbers, and as many points again to check them.


def fit_curved_shapes(
    parts: list[Part], points: np.ndarray, outline: shapely.Polygon, settings: Settings
) -> list[Part]:
    """Replace parts by curved shapes that follow points (n, 3) in the outline better."""
    allowed = settings.fit.types or CURVED
    names = [name for name in CURVED if name in allowed]
    roof = JudgedRoof(parts, points, outline)
    ends = find_round_ends(outline)
    if not settings.fit.types or "flat" in settings.fit.types:
        roof = place_drums(roof, ends)
    if not names:
        return roof.parts
    for end in ends:
        roof = roof_round_end(roof, end, names)
    for _ in range(len(parts)):
        better = find_better_roof(roof, names, settings)
        if better is None:
            break
        roof = better
    return roof.parts


def roof_round_end(roof: JudgedRoof, end: RoundEnd, names: list[str]) -> JudgedRoof:
    """Return the roof with the best curved shape over a round end, or as it is."""
    shapes = [s for s in list_end_shapes(roof, end, names) if s.parameters["height"] > LEAST_FALL_M]
    options = [
        (shape, replace_parts(roof, shape, trimmed)[1])
        for shape in shapes
        for trimmed in (trim_parts(roof, shape), None)
    ]
    heights = [new.highest[0] for _, new in options]
    judged = np.any([z != roof.highest[0] for z in heights], axis=0)
    best, least = roof, LEAST_NATS_ON_ARC if end.is_round else LEAST_NATS_OF_SPIRE
    for shape, new in sorted(options, key=lambda option: is_aside(option[0], end)):
        if new is roof or measure_visible_share(new) < LEAST_VISIBLE:
            continue
        aside = is_aside(shape, end)
        if aside and best is not roof and best.parts[-1].type == "half_cone":
            break  # Its top is where the house's ridge ends.
        price = WHOLE_NATS if end.is_half_disc and shape.type != "half_cone" else 0.0
        # An onion is a cone or a dome and more, and a top beside the middle needs two numbers more.
        price += LEAST_NATS if shape.type == "onion" or aside else 0.0
        gain = measure_gain(roof, new, judged, scale_cap(measure_slope(shape))) - price
        if gain > least:
            best, least = new, gain
    return best


def is_aside(shape: Part, end: RoundEnd) -> bool:
    """Return whether the top of a whole shape lies beside the middle of a round end."""
    return shape.type in MOVABLE and not np.array_equal(shape.translation[:2], end.centre)


def measure_visible_share(roof: JudgedRoof) -> float:
    """Return at which share of the points over it the last part is the highest."""
    (*_, last), (_, top) = roof.parts, roof.highest
    within = np.isfinite(find_highest([last], roof.points[:, :2])[0])
    return float(np.mean(top[within] == len(roof.parts) - 1)) if within.any() else 0.0


def find_better_roof(roof: JudgedRoof, names: list[str], settings: Settings) -> JudgedRoof | None:
    """Find the first part where a curved shape is better, with the best one."""
    distances, top = roof.measure_distances(MOST_DISTANCE_M), roof.highest[1]
    tops = tuple(name for name in names if name in ROUND and name != "onion")
    for k in sorted(range(len(roof.parts)), key=lambda k: roof.parts[k].type not in CURVED):
        part, own = roof.parts[k], top == k
        if np.count_nonzero(own) < FEWEST_CURVE_POINTS:
            continue
        if part.type in CURVED:
            shapes = list_onions(roof, part, settings) if "onion" in names else iter(())
        elif distances[own].mean() >= LEAST_MISFIT_M or list_cants(part.parameters):
            shapes = chain(
                list_round_shapes(roof, part, own, tops, settings),
                list_barrels(roof, part, settings) if "barrel" in names else (),
            )
        else:
            continue
        gains = [replace_parts(roof, shape) for shape in shapes]
        gain, better = max(gains, key=lambda one: one[0], default=(0.0, roof))
        if gain > LEAST_NATS:
            return lay_base(better)
    return None
