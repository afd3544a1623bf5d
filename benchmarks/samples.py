"""Labelled buildings of roof types, each scanned for a network."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hiproof.learn.sample import Sample
from hiproof.primitives import CATALOGUE
from hiproof.segment import NOT_ROOF
from hiproof.simulate import ROOF_TYPES, random_building, scan
from hiproof.simulate.roofs import find_label
from hiproof.simulate.scene import SOURCE_ROOF
from hiproof.simulate.training import random_settings


def draw_sample(
    rng: np.random.Generator,
    n_points: tuple[int, int] = (80, 1500),
    density: tuple[float, float] = (1.0, 20.0),
    types: Sequence[str] = ROOF_TYPES,
) -> Sample:
    """Scan a building of one of `types` with all defects, until so many points show its roof."""
    kind = int(rng.integers(len(types)))
    while True:
        building = random_building(rng, types[kind])
        settings = random_settings(rng, building.outline.area, density, n_points, None)
        cloud = scan(building, rng, settings)
        if len(cloud) >= n_points[0] and (cloud.source == SOURCE_ROOF).sum() >= 0.3 * n_points[0]:
            break
    if len(cloud) > n_points[1]:
        cloud = cloud.select(np.sort(rng.choice(len(cloud), n_points[1], replace=False)))
    index = np.full(len(CATALOGUE) + 1, NOT_ROOF)  # the last for what is no roof
    index[[find_label(name) for name in types]] = np.arange(len(types))
    return Sample(cloud.points - cloud.points.mean(axis=0), index[cloud.label], kind)
