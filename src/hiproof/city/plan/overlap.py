"""Checks that footprints lie where the cloud does.

Where they do not, the usual mistakes are tried, so that the message can name the likely one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from pyproj import CRS
from pyproj.exceptions import CRSError

from ...errors import InputError
from ...frames import METRES, Units
from ...model import Footprint
from ...read.crs import describe_crs, epsg_code, horizontal_crs, parse_crs, same_horizontal
from ...read.crs.positions import extent, reproject_positions

NEIGHBOUR_SHIFTS = (1, -1, 2, -2)  # zones of one grid have consecutive codes
FOOT_M = 0.3048  # m, by definition


def check_overlap(
    footprints: Sequence[Footprint],
    bounds: np.ndarray,
    footprints_crs: CRS | None = None,
    cloud_crs: CRS | None = None,
    units: Units = METRES,
) -> None:
    """Raise InputError when no footprint meets the boxes (n, 4) of the cloud's files, `bounds`.

    All are in world metres. The CRSs are those that the two sides name, and `units` those of the
    CRS they are in. The message says what they look like.
    """
    boxes = shapely.bounds(
        [footprint.polygon for footprint in footprints if not footprint.polygon.is_empty]
    )
    if not len(boxes) or len(
        shapely.STRtree(shapely.box(*boxes.T)).query(shapely.box(*bounds.T))[0]
    ):
        return
    files = units.from_metres(bounds)
    moved = units.from_metres((boxes[:, :2] + boxes[:, 2:]) / 2)
    middles = reproject_positions(moved, cloud_crs, footprints_crs)
    advice = "check the CRS each file names, or say the cloud's with --crs"
    for guess, xy in slips(middles, footprints_crs, cloud_crs):
        finite = shapely.points(xy[np.isfinite(xy).all(axis=1)])
        if len(shapely.STRtree(finite).query(shapely.box(*files.T))[0]):
            advice = guess
            break
    raise InputError(
        f"expected footprints that overlap the cloud in {extent(files[:, :2], files[:, 2:])} "
        f"({describe_crs(cloud_crs)}), "
        f"got footprints in {extent(middles, middles)} ({describe_crs(footprints_crs)}); " + advice
    )


def slips(
    xy: np.ndarray, named_crs: CRS | None, cloud: CRS | None
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the usual mistakes that footprints may show, and their places then.

    The footprints lie at `xy` (n, 2), in their own CRS `named_crs`. Places are in the cloud's CRS.

    Where only one side names a CRS the other is taken to be in it.
    """
    swapped, source, target = xy[:, ::-1], named_crs or cloud, cloud or named_crs
    yield (
        "their x and y look swapped: swap them, in the footprints or in the cloud",
        reproject_positions(swapped, source, target),
    )
    if target is not None:
        if not same_horizontal(source, target):
            text = (
                f"their coordinates look like the cloud's {describe_crs(target)}: name that CRS in "
                "the footprints"
            )
            yield f"{text}, or the cloud's own with --crs if it is another", xy
        degrees = parse_crs("EPSG:4326")
        for subject, pairs in (("longitude and latitude", xy), ("latitude and longitude", swapped)):
            if (np.abs(pairs) <= (180, 90)).all():
                text = (
                    f"they look like {subject} in degrees: name EPSG:4326 in the footprints, with "
                    "longitude first"
                )
                yield text, reproject_positions(pairs, degrees, target)
        yield (
            "the cloud looks like longitude and latitude in degrees: reproject it",
            reproject_positions(xy, source, degrees),
        )
        # a side that names its CRS is doubted only where the other names one, too
        for neighbour in neighbours(source if cloud is not None else None):
            text = (
                f"they look like {describe_crs(neighbour)}: name the right zone in the footprints"
            )
            yield text, reproject_positions(xy, neighbour, target)
        if named_crs is not None:
            for nearby in (
                *neighbours(target),
                *utm_zones(reproject_positions(xy, source, degrees)),
            ):
                text = (
                    f"the cloud looks like {describe_crs(nearby)}: name the right zone with --crs"
                )
                yield text, reproject_positions(xy, source, nearby)
    yield (
        "they look like metres and the cloud like feet: name CRSs, or the cloud's --unit",
        xy / FOOT_M,
    )
    yield (
        "they look like feet and the cloud like metres: name CRSs, or the cloud's --unit",
        xy * FOOT_M,
    )


def neighbours(crs: CRS | None) -> Iterator[CRS]:
    """Yield the projected CRSs of the codes next to that of `crs`."""
    code = None if crs is None else epsg_code(horizontal_crs(crs))
    if code is None:
        return
    for step in NEIGHBOUR_SHIFTS:
        try:
            neighbour = CRS.from_epsg(code + step)
        except CRSError:
            continue
        if neighbour.is_projected:
            yield neighbour


def utm_zones(lon_lat: np.ndarray) -> Iterator[CRS]:
    """Yield the UTM zones (Europe, North America, world) of positions in degrees (n, 2)."""
    lon, lat = np.median(lon_lat, axis=0)
    if np.isfinite((lon, lat)).all():
        zone = int((lon + 180) // 6) % 60 + 1
        north = (
            ([25800 + zone] if 28 <= zone <= 38 else [])
            + ([26900 + zone] if zone <= 23 else [])
            + [32600 + zone]
        )
        yield from map(CRS.from_epsg, north if lat > 0 else [32700 + zone])
