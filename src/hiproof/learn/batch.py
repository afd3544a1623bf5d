"""Arranged clouds stacked into the flat tensors of the network."""

from __future__ import annotations

import numpy as np
import torch

from ..segment.arrange import Arrangement, Layout, arrange
from ..segment.inference import stack_arrangements


def network_inputs(arrangements: list[Arrangement], layout: Layout) -> tuple[torch.Tensor, ...]:
    """Return the network's nine inputs for a batch of buildings.

    They are in the order of `segment.inference.INPUT_NAMES`.
    """
    return tuple(
        torch.from_numpy(array) for array in stack_arrangements(arrangements, layout).values()
    )


def example_batch(layout: Layout) -> tuple[torch.Tensor, ...]:
    """Return inputs of one generic cloud, to trace the network with."""
    xyz = np.random.default_rng(0).uniform(0.0, 10.0, (2 * layout.points, 3))
    return network_inputs([arrange(xyz, layout)], layout)
