"""Where on Earth the buildings of a run stand."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..read.crs import find_units, horizontal_crs, parse_crs
from ..write.head import FileHead


def locate(head: FileHead, x: float, y: float) -> tuple[float, float, float]:
    """Return longitude, latitude and true north at a place, in degrees.

    The place is in world metres, the direction clockwise from the axis that points north. Raises
    InputError where the run has no CRS.
    """
    from pyproj import Transformer

    crs = parse_crs(head.crs)
    if crs is None:
        raise InputError(
            "expected a run with a CRS for --sun, got one without; run `hiproof reconstruct` with "
            "--crs"
        )
    to_globe = Transformer.from_crs(horizontal_crs(crs), "EPSG:4326", always_xy=True)
    there = find_units(crs, unit_name=head.unit).from_metres(np.array([[x, y]]))[0]
    longitude, latitude = to_globe.transform(*there)
    step = to_globe.transform(longitude, latitude + 1e-3, direction="INVERSE")
    north = np.degrees(np.arctan2(step[0] - there[0], step[1] - there[1]))
    return float(longitude), float(latitude), float(north)
