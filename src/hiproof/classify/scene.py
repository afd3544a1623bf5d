"""The roofs of a whole cloud that has no class for them, found by shape."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..log import counted
from ..model import PointCloud
from .buildings import BUILDING, classify

NO_ROOFS = {3: "low vegetation", 7: "noise", 9: "water", 17: "bridges", 18: "noise"}  # by class


def roofs_by_shape(cloud: PointCloud, ground_classes: tuple[int, ...]) -> np.ndarray:
    """Ascending indices of the roofs' points. Raises InputError where there are none."""
    classes = np.zeros(len(cloud), np.uint8) if cloud.classification is None else cloud.classification
    asked = np.flatnonzero(~np.isin(classes, tuple(NO_ROOFS)))
    found = classify(cloud.xyz[asked])
    roofs = asked[(found == BUILDING) & ~np.isin(classes[asked], ground_classes)]
    if len(roofs):
        return roofs
    where = ", ".join(cloud.sources) or "the cloud"
    raise InputError(
        f"expected buildings in {where}, got {counted(len(cloud), 'point')} none of which lies on a smooth surface "
        "above the ground; give --footprints, or name the class that holds roofs with --building-class"
    )
