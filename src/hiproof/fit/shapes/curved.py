"""Replace parts by curved and composite shapes where that is cheaper.

The search knows volumes of a few planes alone. Of a round roof it makes a few pyramids and gables,
of a vault a truncated gable, and of a gambrel a gable on one. Curved shapes are fitted over arcs of
the outline, around the tops of parts, over level parts and over slopes to two sides, composite ones
over several parts. One price decides (accept.py).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np
import shapely

from ...model import Part
from ...primitives.catalogue import CURVED, ROUND
from ...settings import Settings
from .accept import CIRCLE_NUMBERS, PartsRoof, accept, accept_all, make_parts_roof
from .arcs import find_arcs
from .barrels import list_barrels
from .composite import list_composite_names, list_composite_shapes
from .drums import list_arc_drums, list_drums
from .rounds import list_arc_shapes, list_top_shapes

FEWEST_CURVE_POINTS = 12  # A curve takes five numbers, and as many points again to check them.


def fit_shapes(
    parts: list[Part], points: np.ndarray, outline: shapely.Polygon, settings: Settings
) -> list[Part]:
    """Replace parts by other shapes where the roof of points (n, 3) in the outline costs less."""
    allowed = settings.fit.types or ("flat", *CURVED)
    names = [name for name in ("flat", *CURVED) if name in allowed]
    composite = list_composite_names(settings.fit.types)
    roof = make_parts_roof(parts, points, outline, settings)
    for arc in find_arcs(outline):
        drums = list_arc_drums(roof, arc) if "flat" in names else ()
        roof, _ = accept(roof, chain(drums, list_arc_shapes(roof, arc, names)))

    def list_shapes(one: PartsRoof, asked: list[Part]) -> Iterator[tuple[Part, int]]:
        yield from list_composite_shapes(one, asked, composite, settings)
        yield from list_part_shapes(one, asked, names, settings)

    return accept_all(roof, list_shapes).parts


def list_part_shapes(
    roof: PartsRoof, asked: list[Part], names: list[str], settings: Settings
) -> Iterator[tuple[Part, int]]:
    """Yield shapes that may take the place of each part in `asked` and those around it."""
    everywhere = np.arange(len(roof.points))
    is_worth_disc = roof.is_worth(everywhere, 0.0, CIRCLE_NUMBERS)
    rounds = [name for name in names if name in ROUND and is_worth_disc]
    for part in asked:
        own = roof.find_seen([part])
        if len(own) < FEWEST_CURVE_POINTS:
            continue
        if "flat" in names and is_worth_disc:
            yield from list_drums(roof, part, own)
        if "barrel" in names:
            yield from list_barrels(roof, part, settings)
        if rounds:
            yield from list_top_shapes(roof, part, own, rounds)
