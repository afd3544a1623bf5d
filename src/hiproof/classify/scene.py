"""The roofs of a whole cloud that has no class for them, found by shape."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..errors import InputError
from ..log import count_things
from ..model import PointCloud
from .buildings import BUILDING, Square, SquareSearch

NO_ROOFS = {3: "low vegetation", 7: "noise", 9: "water", 17: "bridges", 18: "noise"}  # by class


class RoofSearch:
    """The search for the roofs of a cloud, square by square (`SquareSearch`).

    `on_error` is called with the indices of the points of a square in which the search fails.
    """

    def __init__(
        self,
        cloud: PointCloud,
        ground_classes: tuple[int, ...],
        on_error: Callable[[np.ndarray, Exception], None],
    ):
        self.cloud, self.on_error, self.n_failed = cloud, on_error, 0
        self.indices = np.flatnonzero(~np.isin(cloud.classes, tuple(NO_ROOFS)))
        self.may_be_roof = ~np.isin(cloud.classes[self.indices], ground_classes)
        self.search = SquareSearch(cloud.xyz[self.indices], self.skip_square)

    def skip_square(self, inside: np.ndarray, error: Exception) -> None:
        self.n_failed += 1
        self.on_error(self.indices[inside], error)

    def find(
        self,
        squares: set[Square] | None = None,
        progress: Callable[[int, int], None] = lambda *_: None,
    ) -> np.ndarray:
        """Return ascending indices of the points of roofs in `squares`, or in all.

        Raises InputError where there are none in the whole cloud.
        """
        self.search.classify(self.search.squares if squares is None else squares, progress)
        roofs = self.indices[(self.search.classes == BUILDING) & self.may_be_roof]
        if self.n_failed or squares is not None:
            return roofs
        return require_roofs(
            roofs, self.cloud, "none of which lies on a smooth surface above the ground"
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
        "--footprints, or name the class that holds roofs with --building-class"
    )
