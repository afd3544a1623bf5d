"""Which shapes volumes may have, so that they become parts of the types that are asked for.

It stands by itself because compiled code belongs to the sources that its file's imports lead to: the search compiles nothing
for a new roof shape.
"""

from __future__ import annotations

import numpy as np

from ...primitives.catalogue import CATALOGUE
from ...primitives.family import COMPONENTS, GENERAL_SHAPES, KIN


def list_components(name: str) -> tuple[str, ...]:
    """What a type that no volume has by itself may be put together from: any shape where nothing is said of it."""
    return (
        ()
        if CATALOGUE[name].is_of_family
        else COMPONENTS.get(name, tuple(name for name, _ in GENERAL_SHAPES.values()))
    )


def list_allowed_shapes(types: tuple[str, ...]) -> np.ndarray:
    """Which shapes (2, 3, 3, 2) volumes may have to become parts of these `types` (all where there are none)."""
    allowed = np.zeros((2, 3, 3, 2), bool)
    names = {part for name in types or CATALOGUE for part in (name, *list_components(name))} | {
        "flat"
    }
    kin = {name: base for base, *kin_names in KIN for name in kin_names}
    for (top, along, across), (shape, _) in GENERAL_SHAPES.items():
        ties = [
            tied
            for tied in (0, 1)
            if shape != "gable" or ("gable", "asymmetric_gable")[tied] in names
        ]
        if shape in names or any(kin.get(name) == shape for name in names):
            for tied in ties:
                allowed[int(top), along, across, tied] = allowed[int(top), across, along, tied] = (
                    True
                )
    return allowed
