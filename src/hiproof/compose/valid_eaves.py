"""The most overhangs with which a model still has a valid solid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely

from ..errors import CompositionError
from ..geometry.outline_edges import list_outline_edges
from ..model import GROUND, Eaves, Model, Overhang
from ..model.overhang import ROOF_EDGE
from .eaves import LEAST_STRETCH_M, PIECE_ENDS_M, add_eaves

NO_ROOM = "the roof is too narrow for walls farther in"


def add_valid_eaves(model: Model, eaves: Eaves) -> tuple[Model, str]:
    """Return the model with as many of its `eaves` as make a valid solid.

    Long ones come first. Why others were left out comes second.
    """
    try:
        return add_eaves(model, eaves), NO_ROOM
    except CompositionError as error:
        reason = str(error)
    lengths = list_outline_edges(model.roof.outline).lengths
    longest_first = sorted(eaves.overhangs, key=lambda item: -lengths[item.edge])
    kept = keep_valid(model, eaves, [], longest_first)
    return add_eaves(model, select_overhangs(eaves, kept)), reason


def keep_valid(
    model: Model, eaves: Eaves, kept: list[Overhang], more: list[Overhang]
) -> list[Overhang]:
    """Return overhangs `kept` with as many `more` as make a valid solid.

    With all of them together there is none.
    """
    count, half = len(kept) + len(more), len(more) // 2
    for part in (more[:half], more[half:]) if half else ():
        is_all = len(kept) + len(part) == count
        if not is_all and is_valid(model, select_overhangs(eaves, [*kept, *part])):
            kept = [*kept, *part]
        else:
            kept = keep_valid(model, eaves, kept, part)
    return kept


def is_valid(model: Model, eaves: Eaves) -> bool:
    """Return whether a model with `eaves` has a valid solid."""
    try:
        add_eaves(model, eaves)
    except CompositionError:
        return False
    return True


def select_overhangs(eaves: Eaves, overhangs: Sequence[Overhang]) -> Eaves:
    """Return eaves with some of their overhangs, in the order of edges."""
    return replace(eaves, overhangs=tuple(sorted(overhangs, key=lambda item: item.edge)))


def measure_left_out(model: Model, wanted: Eaves) -> np.ndarray:
    """Measure along how much (n,) of each edge a wanted overhang is missing."""
    edges = list_outline_edges(model.roof.outline)
    result = np.zeros(len(edges.starts))
    numbers = [item.edge for item in wanted.overhangs]
    result[numbers] = edges.lengths[numbers]
    if model.eaves is None or model.eaves.solid is None:
        return result
    made = [item.edge for item in model.eaves.overhangs]
    result[made] = 0.0
    if wanted.footprint_kind == ROOF_EDGE:
        solid = model.eaves.solid.move(-model.roof.frame.origin)
        ground = shapely.union_all([solid.project_face(f) for f in solid.select_faces(GROUND)])
        near = shapely.buffer(shapely.boundary(ground), PIECE_ENDS_M)
        lines = shapely.linestrings(np.stack([edges.starts, edges.ends], axis=1)[made])
        shared = shapely.length(shapely.intersection(lines, near))
        result[made] = np.where(shared > LEAST_STRETCH_M, shared, 0.0)
    return result
