"""Coordinate reference systems: are two the same in plan, what is one called in a CityGML file, how do two combine."""

from __future__ import annotations

from typing import Any

from pyproj import CRS
from pyproj.exceptions import CRSError

from ..errors import InputError


def parse_crs(value: Any) -> CRS | None:
    """A pyproj CRS from an EPSG number, "EPSG:7415", WKT or a CRS; None and "" stay None. Raises InputError otherwise.

    >>> parse_crs("EPSG:28992").to_epsg()
    28992
    """
    if value is None or (isinstance(value, str) and not value.strip()):
        return None
    try:
        return CRS.from_user_input(value)
    except CRSError as error:
        text = str(value)[:60]
        raise InputError(
            f'expected a coordinate reference system such as "EPSG:7415", got {text!r}; {error}'
        ) from error


def horizontal_crs(crs: CRS) -> CRS:
    """The plan component of a compound CRS; a 3D CRS becomes 2D; any other is returned as it is."""
    if crs.is_compound:
        return horizontal_crs(crs.sub_crs_list[0])
    if crs.is_bound and crs.source_crs is not None:
        return horizontal_crs(crs.source_crs)
    return crs.to_2d() if len(crs.axis_info) == 3 else crs


def vertical_crs(crs: CRS) -> CRS | None:
    """The height component of a compound CRS, None where there is none."""
    heights = [part for part in crs.sub_crs_list if part.is_vertical]
    return heights[0] if heights else None


def same_horizontal(first: CRS | None, second: CRS | None) -> bool:
    """Whether coordinates in plan mean the same place in both, whatever the heights. An unknown CRS equals nothing.

    >>> same_horizontal(CRS("EPSG:7415"), CRS("EPSG:28992"))
    True
    """
    if first is None or second is None:
        return False
    first, second = horizontal_crs(first), horizontal_crs(second)
    if first.equals(second, ignore_axis_order=True):
        return True
    code = epsg_code(first)
    return code is not None and code == epsg_code(second)


def epsg_code(crs: CRS) -> int | None:
    """EPSG number of `crs` where pyproj is sure of it, else None."""
    authority = crs.to_authority("EPSG", min_confidence=70)
    return int(authority[1]) if authority else None


def combine(horizontal: CRS | None, vertical: CRS | None) -> CRS | None:
    """Compound CRS of a plan and a height system; `horizontal` alone where it has heights already or none are given."""
    if horizontal is None or vertical is None or vertical_crs(horizontal) is not None:
        return horizontal
    from pyproj.crs import CompoundCRS

    plan = horizontal_crs(horizontal)
    compound = CompoundCRS(name=f"{plan.name} + {vertical.name}", components=[plan, vertical])
    code = epsg_code(compound)
    return CRS.from_epsg(code) if code is not None else compound


def require_metres(crs: CRS | None, source: str) -> None:
    """Raise InputError where `crs` counts in degrees or feet: every length in hiproof is a metre. Unknown CRSs pass."""
    if crs is None:
        return
    units = {axis.unit_name for axis in crs.axis_info if axis.unit_name} - {"metre"}
    if units:
        raise InputError(
            f"expected {source} in a CRS whose axes are metres, got {crs.name} in {', '.join(sorted(units))}; "
            "reproject it first, to the UTM zone or the national grid of the place (`pdal translate`, `ogr2ogr`)"
        )
