"""Where training clouds come from: the simulator, The Hague's real shapes scanned by it, or RoofN3D's real clouds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..errors import InputError
from ..simulate.shapes import ROOF_TYPES


@dataclass(frozen=True)
class Sample:
    """One labelled cloud: `xyz` (n, 3) metres, `labels` (n,) index of the roof type or -1 for not-roof, `type` index."""

    xyz: np.ndarray
    labels: np.ndarray
    type: int


class Source(Protocol):
    """A supply of labelled clouds. Training cloud `index` is the same whenever it is asked for."""

    types: tuple[str, ...]
    description: str

    def training(self, index: int) -> Sample: ...

    def validation(self, count: int) -> list[Sample]: ...
