"""List the shapes that volumes may have to become parts of the requested types.

This is a file of its own because compiled code belongs to the sources that its file imports: a new
roof shape compiles no candidates again.
"""

from __future__ import annotations

import numpy as np

from ...primitives.catalogue import CATALOGUE
from ...primitives.family import COMPONENTS, GENERAL_SHAPES, KIN


def list_components(name: str) -> tuple[str, ...]:
    """List the types that a type without a volume of its own is combined from.

    It is any shape if nothing else is declared.
    """
    return (
        ()
        if CATALOGUE[name].is_of_family
        else COMPONENTS.get(name, tuple(name for name, _ in GENERAL_SHAPES.values()))
    )


def list_allowed_shapes(types: tuple[str, ...]) -> np.ndarray:
    """Return which shapes (2, 3, 3, 2) volumes may have to become parts of `types`.

    All are allowed if there are no types.
    """
    allowed = np.zeros((2, 3, 3, 2), bool)
    if not types:
        allowed[:] = True
        allowed[0, 0, 0] = False  # no plane at all
        return allowed
    names = {part for name in types for part in (name, *list_components(name))} | {"flat"}
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
