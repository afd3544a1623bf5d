"""A labelled cloud, the roles of a source, and random changes after PointNeXt's recipe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

TRAINING, VALIDATION, TEST = 1, 2, 3  # roles; their numbers seed what is drawn for each


@dataclass(frozen=True)
class Sample:
    """A cloud `xyz` (n, 3) (m), `labels` (n,) of roof types or -1, and its `type`."""

    xyz: np.ndarray
    labels: np.ndarray
    type: int


class Source(Protocol):
    """A supply of labelled clouds, the same for a role (TRAINING, ...) and a number."""

    @property
    def types(self) -> tuple[str, ...]: ...

    @property
    def description(self) -> str: ...

    def sample(self, role: int, index: int) -> Sample: ...


FEWEST_KEPT = 30  # points that dropping leaves of a cloud; fewer show no roof
# Columns of the features that change sign when a building is mirrored along or across its own first
# axis.
ALONG_AXES, ACROSS_AXES = (0, 3, 8), (1, 4, 9)


@dataclass(frozen=True)
class AugmentSettings:
    """Bounds of random changes: relative `scale`, largest sigma `jitter_m`, share `drop`."""

    scale: float = 0.12
    stretch: float = 0.08
    jitter_m: float = 0.04
    drop: float = 0.4


def vary_cloud(
    xyz: np.ndarray, labels: np.ndarray, rng: np.random.Generator, settings: AugmentSettings
):
    """Scale, stretch, thin and jitter a cloud (n, 3) with labels (n,)."""
    mask = rng.random(len(xyz)) >= settings.drop * rng.random() ** 2
    if mask.sum() >= FEWEST_KEPT:
        xyz, labels = xyz[mask], labels[mask]
    factor = np.full(3, 1.0 + settings.scale * rng.uniform(-1, 1))
    factor[2] *= 1.0 + settings.stretch * rng.uniform(-1, 1)
    return xyz * factor + settings.jitter_m * rng.random() * rng.standard_normal(xyz.shape), labels


def symmetric(features: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Mirror arranged features (N, 11) along and across the building, each by chance 1/2."""
    features = features.copy()
    for columns in (ALONG_AXES, ACROSS_AXES):
        if rng.random() < 0.5:
            features[:, columns] *= -1
    return features
