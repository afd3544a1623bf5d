"""Objects that stand on a roof and are no part of it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

CHIMNEY, ROOF_OBJECT = "chimney", "roof_object"


@dataclass(frozen=True)
class Installation:
    """A box on a roof: a chimney, or another object.

    `position` (3,) is the middle of its base in the roof's frame, `kappa` the rotation of its
    `length` about Z (rad). Sizes are in metres.
    """

    type: str
    length: float
    width: float
    height: float
    kappa: float = 0.0
    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
