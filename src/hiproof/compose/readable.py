"""Checks that a file of parameters can hold a roof, which its reader and writer share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from ..errors import CompositionError, InputError
from ..model import Part, Roof, Solid
from ..primitives.catalogue import CATALOGUE
from ..primitives.parameters import refuse_no_shape
from ..settings import Settings
from .solid import compose

MOST_PARTS = 1000  # Parts of a building: a cathedral has some hundred, a faulty program any number.


def compose_readable(roof: Roof, z_ground_local: float, settings: Settings) -> Solid:
    """Compose a roof that its file gives again; raises CompositionError if none, or unreadable."""
    visited: dict[tuple, int] = {}
    for index, part in enumerate(roof.parts):
        try:
            if part.type in CATALOGUE:  # A shape of your own has no rules for its parameters.
                refuse_no_shape(part.type, part.parameters, f"part {index}")
            refuse_wrong_part(part, index, roof, visited)
        except InputError as error:
            failure = CompositionError(str(error))
            failure.parts = (index,)
            raise failure from error
    return compose(roof, z_ground_local, settings)


def refuse_wrong_parts(roof: Roof) -> None:
    """Raise InputError, one sentence, for too many parts or a wrong one."""
    refuse_many(roof.parts)
    visited: dict[tuple, int] = {}
    for index, part in enumerate(roof.parts):
        refuse_wrong_part(part, index, roof, visited)


def refuse_many(parts: Sequence) -> None:
    """Raise InputError for more parts than a building has."""
    if len(parts) > MOST_PARTS:
        raise InputError(
            f"expected at most {MOST_PARTS} parts, got {len(parts)}; split the building"
        )


def refuse_wrong_part(part: Part, index: int, roof: Roof, visited: dict[tuple, int]) -> None:
    """Raise InputError for a part that no file may hold.

    Such a part has no finite planes, lies off the outline, or equals one `visited` before.
    `visited` holds the numbers of earlier parts by their content; the part is added to it.
    """
    if not all(np.isfinite(piece.planes).all() for piece in part.pieces):
        raise InputError(
            f"expected parameters that make finite planes, got others in part {index}; check their "
            "sizes"
        )
    if not any(shapely.intersects(piece.outline, roof.outline) for piece in part.pieces):
        raise InputError(
            f"expected part {index} to roof some of the building's outline, got one outside it; "
            "move it there"
        )
    place = (part.kappa, *part.translation.tolist())
    outlines = tuple(piece.outline.wkb for piece in part.pieces)
    same = visited.setdefault((part.type, tuple(part.parameters.items()), place, outlines), index)
    if same != index:
        raise InputError(
            f"expected parts that differ, got part {index} the same as part {same}; remove one"
        )
