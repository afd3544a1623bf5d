"""A building's cloud for the network: frame, features, farthest-point levels, neighbourhoods.

All of it is free of weights, shared by training and inference, and follows the points under
rotation about Z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .sampling import arrange_cloud, thin_to_grid


@dataclass(frozen=True)
class Layout:
    """The network's input: `points` of a cloud, points of `levels`, `neighbours` a group."""

    points: int = 256
    levels: tuple[int, int, int] = (128, 64, 16)
    neighbours: int = 12
    thinned: int = 2048


@dataclass(frozen=True)
class Arrangement:
    """One cloud in the network's form.

    There are N points, level sizes S1, S2, S3, and K neighbours. `chosen` (N,) indices into the
    cloud, repeated where it has fewer than N points; `features` (N, 11) float32; `groups` per level
    (S, K) indices into the level above; `radii` (3,) metres; `up_indices`, `up_weights` (S1, 3)
    into level 3 and (N, 3) into level 1: inverse-distance interpolation; `sampled` the number of
    distinct points.
    """

    select: np.ndarray
    features: np.ndarray
    groups: tuple[np.ndarray, ...]
    radii: np.ndarray
    up_indices: tuple[np.ndarray, np.ndarray]
    up_weights: tuple[np.ndarray, np.ndarray]
    sampled: int


def arrange(xyz: np.ndarray, layout: Layout) -> Arrangement:
    """Arrange a cloud `xyz` (n, 3), n > 0, finite, in metres of any frame, for the network."""
    thinned = thin_to_grid(xyz, layout.thinned)
    local = np.ascontiguousarray(xyz[thinned] - xyz[thinned].mean(axis=0), dtype=float)
    order, *described = arrange_cloud(local, layout.points, *layout.levels, layout.neighbours)
    features, groups, radii, up_indices, up_weights = described
    selection = thinned[np.resize(order, layout.points)]
    return Arrangement(selection, features, groups, radii, up_indices, up_weights, len(order))
