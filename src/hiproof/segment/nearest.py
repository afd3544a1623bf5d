"""What a roof type is to a network that knows fewer: the first type that it knows of the same
CityGML code.
"""

from __future__ import annotations

from collections.abc import Iterable

from ..primitives import CATALOGUE


def nearest_of(name: str, known: Iterable[str]) -> str:
    """`name`, or the first of the `known` types with its code; `name` also where there is none.

    >>> nearest_of("side_hip", ("gable", "hip", "pyramid")), nearest_of("shed", ("gable", "hip"))
    ('hip', 'shed')
    """
    known = tuple(known)
    if name in known or name not in CATALOGUE:
        return name
    code = CATALOGUE[name].citygml_code
    return next(
        (other for other in known if other in CATALOGUE and CATALOGUE[other].citygml_code == code),
        name,
    )
