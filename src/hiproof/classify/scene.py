"""The roofs of a whole cloud that has no class for them, found by shape."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import InputError
from ..log import count_things
from ..model import PointCloud
from .buildings import BUILDING, classify

NO_ROOFS = {3: "low vegetation", 7: "noise", 9: "water", 17: "bridges", 18: "noise"}  # by class


def roofs_by_shape(
    cloud: PointCloud,
    ground_classes: tuple[int, ...],
    on_error: Callable[[np.ndarray, Exception], None],
) -> np.ndarray:
    """Return ascending indices of the roofs' points.

    Raises InputError where there are none.

    `on_error` is called with the indices of the points of a square in which the search fails.
    """
    indices = np.flatnonzero(~np.isin(cloud.classes, tuple(NO_ROOFS)))
    n_failed = 0

    def skip_square(inside: np.ndarray, error: Exception) -> None:
        nonlocal n_failed
        n_failed += 1
        on_error(indices[inside], error)

    classes = classify(cloud.xyz[indices], skip_square)
    roofs = indices[(classes == BUILDING) & ~np.isin(cloud.classes[indices], ground_classes)]
    return (
        roofs
        if n_failed
        else require_roofs(roofs, cloud, "none of which lies on a smooth surface above the ground")
    )


def select_roof_candidates(cloud: PointCloud, ground_classes: tuple[int, ...]) -> np.ndarray:
    """Return ascending indices of all points whose class may hold roofs.

    Raises InputError where there are none.
    """
    indices = np.flatnonzero(~np.isin(cloud.classes, (*NO_ROOFS, *ground_classes)))
    return require_roofs(
        indices, cloud, "all of them ground, water, noise, low vegetation or bridges"
    )


def require_roofs(roofs: np.ndarray, cloud: PointCloud, why_not: str) -> np.ndarray:
    """Return the `roofs`, or raise InputError where there are none."""
    if len(roofs):
        return roofs
    where = ", ".join(cloud.sources) or "the cloud"
    raise InputError(
        f"expected buildings in {where}, got {count_things(len(cloud), 'point')} {why_not}; give "
        "--footprints, or name the class that "
        "holds roofs with --building-class"
    )
