"""Labelled buildings without end, each scanned for a network."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hiproof.errors import InputError
from hiproof.primitives import CATALOGUE
from hiproof.simulate import ROOF_TYPES, Defects, Scan, random_building, scan
from hiproof.simulate.roofs import find_label
from hiproof.simulate.scene import SOURCE_ROOF
from hiproof.simulate.training import random_settings

MAX_DRAWS = 40  # draws until a cloud has the points asked for, then a sentence says that it has not


def training_sample(
    rng: np.random.Generator,
    types: Sequence[str] = ROOF_TYPES,
    n_points: tuple[int, int] = (80, 1500),
    density: tuple[float, float] = (1.0, 20.0),
    defects: Defects | None = None,
) -> tuple[np.ndarray, np.ndarray, int]:
    """Scan one building for training.

    Returns points (n, 3) about their mean, labels (n,) and the building's type. Labels and type
    index `types`; a point that is not roof has the label len(types). The density is drawn on a
    logarithmic scale within `density` and the scanner's noise, beam and margin at random; clouds
    outside `n_points` (count, lowest and highest) are drawn again, larger ones thinned. `defects`
    None means all of them.

    >>> points, labels, type = training_sample(np.random.default_rng(1), ("pyramid", "gable",
    ...     "hip"))
    >>> points.shape[1], len(labels) == len(points), type in (0, 1, 2)
    (3, True, True)
    """
    unknown = [type for type in types if type not in CATALOGUE]
    if unknown or not len(types):
        raise InputError(f"expected roof types among {', '.join(CATALOGUE)}, got {list(types)!r}")
    lower, upper = n_points
    kind = int(rng.integers(len(types)))
    for _ in range(MAX_DRAWS):
        building = random_building(rng, types[kind])
        settings = random_settings(rng, building.outline.area, density, n_points, defects)
        cloud = scan(building, rng, settings)
        if len(cloud) >= lower and (cloud.source == SOURCE_ROOF).sum() >= 0.3 * lower:
            return as_sample(rng, cloud, types, kind, upper)
    raise InputError(
        f"expected point counts {n_points} that a density of {density} points/m2 can reach, got "
        f"none in {MAX_DRAWS} buildings; widen one of them"
    )


def as_sample(
    rng: np.random.Generator, cloud: Scan, types: Sequence[str], kind: int, upper: int
) -> tuple[np.ndarray, np.ndarray, int]:
    if len(cloud) > upper:
        cloud = cloud.select(np.sort(rng.choice(len(cloud), upper, replace=False)))
    index = np.full(len(CATALOGUE) + 1, len(types))  # the last for NOT_ROOF
    for position, type in enumerate(types):
        index[find_label(type)] = position
    return cloud.points - cloud.points.mean(axis=0), index[cloud.label], kind
