"""The training data: one labelled cloud, and the roles of a source."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

TRAINING, VALIDATION, TEST = 1, 2, 3  # roles; their numbers seed what is drawn for each


@dataclass(frozen=True)
class Sample:
    """One labelled cloud.

    `xyz` (n, 3) are metres, `labels` (n,) the index of the roof type or -1 for not-roof, and `type`
    an index.
    """

    xyz: np.ndarray
    labels: np.ndarray
    type: int


class Source(Protocol):
    """A supply of labelled clouds, the same whenever asked for.

    A cloud has a role (TRAINING, VALIDATION, TEST) and a number.
    """

    @property
    def types(self) -> tuple[str, ...]: ...

    @property
    def description(self) -> str: ...

    def sample(self, role: int, index: int) -> Sample: ...
