"""The stand-in for a roof type that a network does not know.

It is the first type that it knows of the same CityGML code.
"""

from __future__ import annotations

from collections.abc import Iterable

from ..primitives import CATALOGUE


def find_nearest_type(name: str, known_types: Iterable[str]) -> str:
    """Return `name`, or the first of the `known_types` with its code.

    `name` also where there is none.

    >>> find_nearest_type("side_hip", ("gable", "hip", "pyramid")), find_nearest_type("shed",
    ...     ("gable", "hip"))
    ('hip', 'shed')
    """
    known_types = tuple(known_types)
    if name in known_types or name not in CATALOGUE:
        return name
    code = CATALOGUE[name].citygml_code
    return next(
        (
            other
            for other in known_types
            if other in CATALOGUE and CATALOGUE[other].citygml_code == code
        ),
        name,
    )
