"""What training is fed: one labelled cloud, and the roles in which a source is asked for them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

TRAINING, VALIDATION, TEST = 1, 2, 3  # roles; their numbers seed what is drawn for each


@dataclass(frozen=True)
class Sample:
    """One labelled cloud: `xyz` (n, 3) metres, `labels` (n,) index of the roof type or -1 for
    not-roof, `type` index.
    """

    xyz: np.ndarray
    labels: np.ndarray
    type: int


class Source(Protocol):
    """A supply of labelled clouds by role (TRAINING, VALIDATION, TEST) and number: the same
    whenever asked for.
    """

    @property
    def types(self) -> tuple[str, ...]: ...

    @property
    def description(self) -> str: ...

    def sample(self, role: int, index: int) -> Sample: ...
