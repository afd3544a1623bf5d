"""Labelled buildings without end, for training and validation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..primitives import CATALOGUE
from .roofs import ROOF_TYPES, find_label, random_building
from .scanner import Scan, ScanSettings, scan
from .scene import SOURCE_ROOF, Defects

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


def random_settings(
    rng: np.random.Generator,
    area_m2: float,
    density: tuple[float, float],
    n_points: tuple[int, int],
    defects: Defects | None,
) -> ScanSettings:
    """Draw scanner settings for about `n_points` on `area_m2`, within `density`."""
    smallest = min(max(density[0], n_points[0] / area_m2), density[1])
    largest = max(min(density[1], 1.2 * n_points[1] / area_m2), smallest)
    logarithm, range_noise, horizontal, beam, angle, margin = rng.random(6)
    return replace(
        ScanSettings(),
        density=math.exp(math.log(smallest) + logarithm * (math.log(largest) - math.log(smallest))),
        range_noise_m=0.01 + 0.05 * range_noise,
        horizontal_noise_m=0.01 + 0.14 * horizontal**2,
        beam_radius_m=0.25 * beam,
        max_scan_angle_deg=5.0 + 22.0 * angle,
        margin_m=2.0 * margin**2,
        defects=Defects() if defects is None else defects,
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
