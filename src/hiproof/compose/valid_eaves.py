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

# Most solids that are made of one building: five overhangs of thirty can fail. Each takes a tenth
# of a second where a building has 44 edges.
MOST_TRIALS = 50
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
    kept = keep_valid(model, eaves, longest_first)
    return add_eaves(model, select_overhangs(eaves, kept)), reason


def keep_valid(model: Model, eaves: Eaves, wanted: list[Overhang]) -> list[Overhang]:
    """Return as many of the `wanted` overhangs as make a valid solid together.

    With all of them there is none. They are tried in halves, and halves of those that fail, at most
    MOST_TRIALS times. What is not tried then is left out.
    """
    kept: list[Overhang] = []
    groups, trials = split_in_halves(wanted), 0
    while groups and trials < MOST_TRIALS:
        part = groups.pop(0)
        is_all = len(kept) + len(part) == len(wanted)
        trials += not is_all
        if not is_all and is_valid(model, select_overhangs(eaves, [*kept, *part])):
            kept += part
        else:
            groups = split_in_halves(part) + groups
    return kept


def split_in_halves(overhangs: list[Overhang]) -> list[list[Overhang]]:
    """Return the two halves of several overhangs, nothing of one."""
    half = len(overhangs) // 2
    return [overhangs[:half], overhangs[half:]] if half else []


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
