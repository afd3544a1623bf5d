"""The roofs of a whole cloud that has no class for them, found by shape."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..log import counted
from ..model import PointCloud
from .buildings import BUILDING, GROUND, classify

NO_ROOFS = {3: "low vegetation", 7: "noise", 9: "water", 17: "bridges", 18: "noise"}  # by class
MOSTLY_GROUND, HARDLY_GROUND = 0.9, 0.2  # shares of the points of a cloud


def roofs_by_shape(cloud: PointCloud, ground_classes: tuple[int, ...], is_small: bool) -> tuple[np.ndarray, bool]:
    """Ascending indices of the roofs' points, and whether the cloud is one roof, cut out beforehand: then all points count.

    Only a cloud that `is_small` may be one roof. Raises InputError where there are no roofs.
    """
    classes = np.zeros(len(cloud), np.uint8) if cloud.classification is None else cloud.classification
    asked = np.flatnonzero(~np.isin(classes, tuple(NO_ROOFS)))
    found = classify(cloud.xyz[asked])
    if is_small and is_one_roof(found):
        return asked, True
    roofs = asked[(found == BUILDING) & ~np.isin(classes[asked], ground_classes)]
    if len(roofs):
        return roofs, False
    where = ", ".join(cloud.sources) or "the cloud"
    raise InputError(
        f"expected buildings in {where}, got {counted(len(cloud), 'point')} none of which lies on a smooth surface "
        "above the ground; give --footprints, or name the class that holds roofs with --building-class"
    )


def is_one_roof(found: np.ndarray) -> bool:
    """Whether there is nothing around a roof: hardly anything `found` (n,) to be ground but eaves, or all of it."""
    ground = float((found == GROUND).mean()) if len(found) else 0.0
    return ground > MOSTLY_GROUND or (BUILDING in found and ground < HARDLY_GROUND)
