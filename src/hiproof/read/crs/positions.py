"""Positions in a CRS: reprojected, doubted, described."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from pyproj import CRS, Proj, Transformer
from pyproj.exceptions import ProjError

from ...errors import InputError
from . import (
    convert_to_degrees,
    describe_crs,
    horizontal_crs,
    make_transformer,
    names_place,
    same_horizontal,
)

DEGREES_WIDE = 0.2  # no building is narrower in metres, hardly a tile wider in degrees
# degrees that a CRS is commonly used beyond its area: a zone is kept at the border of the next
AREA_MARGIN = 2.0


def reproject_positions(xy: np.ndarray, source: CRS | None, target: CRS | None) -> np.ndarray:
    """Reproject positions (n, 2), unless the two are one or either is unknown."""
    transformer = None if source is None or target is None else find_transformer(source, target)
    return xy if transformer is None else np.column_stack(transformer.transform(*xy.T))


@functools.lru_cache(maxsize=8)
def find_transformer(source: CRS, target: CRS) -> Transformer | None:
    """Return the cached transformer, slow to choose, None for one CRS or no known way."""
    if same_horizontal(source, target) or not (names_place(source) and names_place(target)):
        return None
    try:
        return make_transformer(source, target)
    except InputError:
        return None


def refuse_degrees(boxes: np.ndarray, subject: str, advice: str) -> None:
    """Raise InputError where `boxes` (n, 4), NaN if empty, without a CRS look like degrees."""
    boxes = boxes[np.isfinite(boxes).all(axis=1)]
    lower, upper = boxes[:, :2], boxes[:, 2:]
    degrees = (np.abs(boxes) <= (180, 90, 180, 90)).all()
    if len(boxes) and degrees and np.median((upper - lower).max(axis=1)) < DEGREES_WIDE:
        raise InputError(
            f"expected {subject} in metres, got coordinates in {extent(lower, upper)}, which look "
            f"like degrees; {advice}"
        )


def doubtful_place(crs: CRS, xy: np.ndarray) -> str | None:
    """Say where positions (n, 2) lie outside the area of `crs`, None if they do not."""
    area = horizontal_crs(crs).area_of_use
    if area is None or area.west > area.east:
        return None
    lon, lat = np.median(convert_to_degrees(crs, xy), axis=0)
    if area.west - AREA_MARGIN <= lon <= area.east + AREA_MARGIN and (
        area.south - AREA_MARGIN <= lat <= area.north + AREA_MARGIN
    ):
        return None
    text = f"{lon:.1f} E {lat:.1f} N" if np.isfinite((lon, lat)).all() else "nowhere on Earth"
    place = f"{area.west:.0f} to {area.east:.0f} E, {area.south:.0f} to {area.north:.0f} N"
    return f"{text}, far from where {describe_crs(crs)} is used ({place})"


def stretch(crs: CRS, xy: np.ndarray) -> float:
    """Return how many metres of `crs` a metre is at (n, 2), the worse way, 1 if unknown."""
    plan = horizontal_crs(crs)
    lon, lat = np.median(convert_to_degrees(crs, xy), axis=0)
    if not (plan.is_projected and np.isfinite((lon, lat)).all()):
        return 1.0
    try:
        factors = Proj(plan).get_factors(lon, lat)
    except ProjError:
        return 1.0
    return max(factors.meridional_scale, factors.parallel_scale, key=lambda scale: abs(scale - 1.0))


def extent(lower: np.ndarray, upper: np.ndarray) -> str:
    """Describe where boxes from `lower` to `upper` (n, 2) lie."""
    (xmin, ymin), (xmax, ymax) = np.nanmin(lower, axis=0), np.nanmax(upper, axis=0)
    digits = 5 if max(map(abs, (xmin, ymin, xmax, ymax))) <= 180 else 1
    return f"x {xmin:.{digits}f} to {xmax:.{digits}f}, y {ymin:.{digits}f} to {ymax:.{digits}f}"


def format_box(box: Sequence[float]) -> str:
    """Format a box as `--bbox` takes it.

    >>> format_box((84600, 447300.25, 85000, 447700))
    '84600,447300.25,85000,447700'
    """
    return ",".join(f"{side:.10g}" for side in box)
