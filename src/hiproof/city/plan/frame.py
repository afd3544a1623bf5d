"""The CRS and units in which an area is worked out.

Clouds and footprints name them, and assumptions are made if they do not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError, warn
from ...frames import Units
from ...read.crs import (
    combine,
    describe_crs,
    find_units,
    has_heights,
    names_heights_alone,
    names_place,
    parse_crs,
    vertical_crs,
)
from ...read.crs.positions import doubtful_place, refuse_degrees, stretch
from ...read.outlines.footprints import footprint_crs
from ...read.points.pointcloud import PointFileHeader, common_crs, list_boxes, warn_coarse

# of a unit; files round the US survey foot, which is 2e-6 longer than the foot, to six digits or so
SAME_UNIT = 1e-5
# of a length; national grids and UTM zones stay below 0.005, at 0.01 a house of 10 m is 10 cm off
MOST_STRETCH = 0.01


@dataclass(frozen=True)
class AreaFrame:
    """The CRSs of clouds and footprints, and the area's units.

    CRSs are pyproj's, None where none is named.
    """

    cloud: Any
    footprints: Any
    units: Units

    @property
    def crs(self) -> Any:
        """The CRS of everything written: the clouds', else the footprints', else None."""
        return self.cloud or self.footprints


def settle_frame(request: Any, headers: list[PointFileHeader]) -> AreaFrame:
    """Choose the frame of a `run.Request` whose point files have `headers`.

    The CRS that the settings give the clouds goes before that of their headers, and clouds that
    name none are taken to be in the footprints'; whatever is assumed is said by an InputWarning.
    Raises InputError for clouds of several CRSs and for degrees.
    """
    read = request.settings.read
    cloud = common_crs(
        {header.path: header.crs for header in headers}, parse_crs(read.crs), read.unit
    )
    footprints = footprint_crs(request.footprints, request.layer) if request.footprints else None
    if not names_place(cloud):
        # clouds that name no CRS may not be in degrees, nor footprints that stand in for theirs
        if footprints is None:
            advice = "reproject them to the UTM zone or the national grid of the place"
            places = plan_bounds(headers)
            refuse_degrees(places, "the point clouds", f"{advice} (`pdal translate`)")
        elif footprints.is_geographic:
            raise InputError(
                f"expected footprints that tell the CRS of clouds that name none, got "
                f"{request.footprints} in {describe_crs(footprints)}, which "
                "is in degrees; name the clouds' CRS with --crs, or reproject the footprints"
            )
        cloud = place_crs(cloud, footprints, headers[0].path, read.unit)
    frame = AreaFrame(cloud, footprints, find_units(cloud or footprints, unit_name=read.unit))
    if cloud is None and (footprints is not None or read.unit == "auto"):
        if footprints is None:
            text = f"its unit is taken as {frame.units}"
        else:
            text = f"taken to be in the footprints' {describe_crs(footprints)}"
        warn(headers[0].path, f"names no CRS; {text}; say otherwise with --crs or --unit")
    if read.unit == "auto" and not (frame.units.are_metres or has_heights(frame.crs)):
        warn(
            headers[0].path,
            f"heights are taken in {frame.units.height_name}, for {describe_crs(frame.crs)} names "
            "none; if they are in metres, name both with --crs, such as EPSG:2263+5703",
        )
    warn_coarse(headers, frame.units)
    if frame.crs is not None:
        warn_outside_area_of_use(headers, frame)
    return frame


def place_crs(cloud: Any, footprints: Any, path: str, unit: str) -> Any:
    """Return the footprints' CRS with heights of a cloud that names no place, else its local CRS.

    None where they name no plan at all. Raises InputError where the units of clouds and footprints
    differ.
    """
    if cloud is None:
        return None
    if not names_place(footprints):
        find_units(cloud, unit_name=unit)
        if names_heights_alone(cloud):
            return None
        place = "which is no place on the Earth, and so are the models; say with --crs where it is"
        warn(path, f"names a local CRS, {describe_crs(cloud)}, {place}")
        return cloud
    units = find_units(footprints, "the footprints")
    if (
        not names_heights_alone(cloud)
        and abs(find_units(cloud, unit_name=unit).plan / units.plan - 1) > SAME_UNIT
    ):
        raise InputError(
            f"expected clouds and footprints in one CRS, got {describe_crs(cloud)} in "
            f"{find_units(cloud)} and "
            f"{describe_crs(footprints)} in {units}; say with --crs in which the clouds are"
        )
    heights = cloud if names_heights_alone(cloud) else vertical_crs(cloud)
    text = f"taken to be in the footprints' {describe_crs(footprints)}; say otherwise with --crs"
    warn(path, f"names {describe_crs(cloud)}, which is no place on the Earth; {text}")
    return combine(footprints, heights)


def warn_outside_area_of_use(headers: list[PointFileHeader], frame: AreaFrame) -> None:
    """Warn once where the CRS is made for another place than the clouds, or stretches it."""
    bounds = plan_bounds(headers)
    if not len(bounds):
        return
    middles = (bounds[:, :2] + bounds[:, 2:]) / 2
    doubt = doubtful_place(frame.crs, middles)
    if doubt:
        warn(headers[0].path, f"lies at {doubt}; check the CRS and its unit")
    elif abs((times := stretch(frame.crs, middles)) - 1.0) > MOST_STRETCH:
        warn(
            headers[0].path,
            f"in {describe_crs(frame.crs)} a metre on the ground is {times:.2f} m long there, and "
            "so are roofs, but not their heights; reproject clouds and footprints to the UTM zone "
            "or the national grid",
        )


def plan_bounds(headers: list[PointFileHeader]) -> np.ndarray:
    """Return the boxes (n, 4) in plan of the point files that hold points, in their own unit."""
    bounds = list_boxes(headers)
    return bounds[np.isfinite(bounds).all(axis=1)]
