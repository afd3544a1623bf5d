"""Coordinate reference systems: are two the same in plan, in which units do they count, how do two
combine.
"""

from __future__ import annotations

import functools
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError, ProjError

from ..errors import InputError
from ..frames import METRES, Units
from .axes import check_height_axis, check_plan_axes

WGS84 = CRS.from_epsg(4326)
"""What places on the Earth are compared in."""

NAMED_UNITS = {
    "auto": METRES,
    "metre": METRES,
    "foot": Units(0.3048, 0.3048, "foot", "foot"),
    "us-survey-foot": Units(1200 / 3937, 1200 / 3937, "US survey foot", "US survey foot"),
}
"""Units by the setting's name, for coordinates without a CRS."""


@dataclass(frozen=True)
class UnknownCRS:
    """A CRS that a file defines, but that cannot be understood, and why."""

    reason: str


def parse_crs(value: Any) -> CRS | None:
    """A pyproj CRS from an EPSG number, "EPSG:7415", WKT or a CRS;

    None and "" stay None. Raises InputError otherwise.

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
            f'expected a coordinate reference system such as "EPSG:7415", got {text!r} '
            f"({reason_of(error)}); "
            "give its EPSG code or its WKT"
        ) from error


def reason_of(error: CRSError) -> str:
    """What PROJ says is wrong, without the definition, which pyproj repeats whole.

    >>> inner = "Internal Proj Error: proj_create: unrecognized format"
    >>> reason_of(CRSError(f"Invalid projection: FOO[1]: ({inner})"))
    'unrecognized format'
    """
    reason = str(error).rpartition("Internal Proj Error: ")[2].removeprefix("proj_create: ")
    return reason.partition("\n")[0][:120].rstrip(").")


def horizontal_crs(crs: CRS) -> CRS:
    """The plan component of a compound CRS; a 3D CRS becomes 2D; any other is returned as it is."""
    if crs.is_compound:
        return horizontal_crs(crs.sub_crs_list[0])
    if crs.is_bound and crs.source_crs is not None:
        return horizontal_crs(crs.source_crs)
    return crs.to_2d() if len(crs.axis_info) == 3 and not crs.is_engineering else crs


def vertical_crs(crs: CRS) -> CRS | None:
    """The height component of a compound CRS, None where there is none."""
    if crs.is_bound and crs.source_crs is not None and not crs.is_vertical:
        return vertical_crs(crs.source_crs)
    heights = [part for part in crs.sub_crs_list if part.is_vertical]
    return heights[0] if heights else None


def names_place(crs: CRS | None) -> bool:
    """Whether coordinates in `crs` lie anywhere on the Earth.

    A local CRS and one of heights alone leave that open.

    >>> [names_place(CRS(text)) for text in ("EPSG:28992", "EPSG:5709", 'LOCAL_CS["site"]')]
    [True, False, False]
    """
    return (
        crs is not None and not names_heights_alone(crs) and not horizontal_crs(crs).is_engineering
    )


def names_heights_alone(crs: CRS) -> bool:
    """Whether `crs` has no plan. pyproj calls a compound CRS vertical as well."""
    return horizontal_crs(crs).is_vertical


def same_horizontal(first: CRS | None, second: CRS | None) -> bool:
    """Whether coordinates in plan mean the same place in both, whatever the heights.

    An unknown CRS equals nothing.

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


@functools.lru_cache(maxsize=64)
def epsg_code(crs: CRS) -> int | None:
    """EPSG number of `crs` where pyproj is sure of it, else None; kept, for looking it up takes a
    millisecond or several.
    """
    authority = crs.to_authority("EPSG", min_confidence=70)
    return int(authority[1]) if authority else None


def combine(horizontal: CRS | None, vertical: CRS | None) -> CRS | None:
    """Compound CRS of a plan and a height system;

    `horizontal` alone where it has heights already or none are given.
    """
    if horizontal is None or vertical is None or vertical_crs(horizontal) is not None:
        return horizontal
    from pyproj.crs import CompoundCRS

    plan = horizontal_crs(horizontal)
    compound = CompoundCRS(name=f"{plan.name} + {vertical.name}", components=[plan, vertical])
    code = epsg_code(compound)
    return CRS.from_epsg(code) if code is not None else compound


def units_of(crs: CRS | None, source: str = "the point clouds", named: str = "auto") -> Units:
    """Units that coordinates in `crs` count in; heights of a CRS without any are taken to be in the
    plan's unit.

    `named` is a key of NAMED_UNITS for coordinates without a CRS. Raises InputError for a CRS in
    degrees, and for a name that contradicts the CRS; `source` is what the message calls the
    coordinates.

    >>> str(units_of(CRS("EPSG:2263"))), str(units_of(CRS("EPSG:2263+5703"))), str(units_of(None,
    ...     named="foot"))
    ('US survey foot', 'US survey foot, heights in metre', 'foot')
    """
    if crs is None:
        return NAMED_UNITS[named]
    plan = horizontal_crs(crs)
    if plan.is_vertical:
        return units_of_heights_alone(plan, source, named)
    if plan.is_geographic or plan.is_geocentric:
        raise InputError(
            f"expected {source} in a projected CRS, got {crs.name} in "
            f"{'degrees' if plan.is_geographic else 'geocentric coordinates'}; "
            "reproject it first, to the UTM zone or the national grid of the place (`pdal "
            "translate`, `ogr2ogr`)"
        )
    check_plan_axes(plan, source)
    across = plan.axis_info[0]
    up = height_axis(crs) or across
    check_height_axis(up, crs, source)
    units = Units(
        across.unit_conversion_factor, up.unit_conversion_factor, across.unit_name, up.unit_name
    )
    if named != "auto" and abs(NAMED_UNITS[named].plan / units.plan - 1) > 1e-9:
        raise InputError(
            f"expected {source} in {named}, as --unit says, got {crs.name} in {units}; leave "
            "--unit out, "
            "or say with --crs which CRS is right"
        )
    return units


def height_axis(crs: CRS) -> Any:
    """The axis (pyproj's) along which `crs` counts heights, None where it has no heights."""
    height = vertical_crs(crs)
    if height is not None:
        return height.axis_info[0]
    return crs.axis_info[2] if len(crs.axis_info) == 3 and not crs.is_compound else None


def units_of_heights_alone(heights: CRS, source: str, named: str) -> Units:
    """Units of coordinates whose CRS names heights alone: the plan's unit has to be that of the
    heights.
    """
    units, up = NAMED_UNITS[named], heights.axis_info[0]
    check_height_axis(up, heights, source)
    if abs(up.unit_conversion_factor / units.plan - 1) > 1e-9:
        raise InputError(
            f"expected {source} in a CRS of the plan, got {heights.name}, which names heights "
            f"alone, in {up.unit_name}; "
            "name both with --crs, such as EPSG:28992+5709"
        )
    return units


def units_named(name: str | None, otherwise: Units = METRES) -> Units:
    """Units of the CRS that a file names by URN or address, `otherwise` where it names none that is
    known.
    """
    try:
        crs = parse_crs(name)
    except InputError:
        return otherwise
    return otherwise if crs is None else units_of(crs, "the models")


def same_heights(first: CRS, second: CRS) -> bool:
    """Whether heights mean the same in both; a CRS that names none goes with any whose heights are
    in its unit.

    >>> same_heights(CRS("EPSG:7415"), CRS("EPSG:28992")), same_heights(CRS("EPSG:2263+6360"),
    ...     CRS("EPSG:2263+5703"))
    (True, False)
    """
    if abs(units_of(first).height / units_of(second).height - 1) > 1e-9:
        return False
    codes = [
        None if height is None else epsg_code(height)
        for height in (vertical_crs(first), vertical_crs(second))
    ]
    return None in codes or codes[0] == codes[1]


def described(crs: CRS | None) -> str:
    """What a message calls a CRS: its EPSG code and name.

    >>> described(CRS("EPSG:28992")), described(None)
    ('EPSG:28992 (Amersfoort / RD New)', 'no CRS')
    """
    if crs is None:
        return "no CRS"
    code = epsg_code(crs)
    return crs.name if code is None else f"EPSG:{code} ({crs.name})"


def way_between(source: CRS, target: CRS) -> Transformer:
    """The transformation of plans from `source` to `target`, x before y.

    Raises InputError where there is none.
    """
    plans = horizontal_crs(source), horizontal_crs(target)
    try:
        if any(plan.is_geocentric or plan.is_vertical for plan in plans):
            raise ProjError("coordinates of another kind")
        return Transformer.from_crs(source, target, always_xy=True)
    except ProjError as error:
        raise InputError(
            f"expected a way from {described(source)} to {described(target)}, got none that PROJ "
            "knows; "
            "check which CRS each file names, or reproject one of them"
        ) from error


def degrees_of(crs: CRS, xy: np.ndarray) -> np.ndarray:
    """Longitude and latitude (n, 2) of positions (n, 2) in the plan of `crs`, NaN where it leaves
    the place open.
    """
    if not names_place(crs):
        return np.full(xy.shape, np.nan)
    try:
        return np.column_stack(way_between(horizontal_crs(crs), WGS84).transform(*xy.T))
    except InputError:
        return np.full(xy.shape, np.nan)


def best_of(crs: Any, target: Any, **options: Any) -> Any:
    """pyproj's best transformation from `crs` to `target` that can be carried out here, None where
    there is none.
    """
    from pyproj.transformer import TransformerGroup

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of better ones whose grids are missing
        try:
            group = TransformerGroup(crs, target, always_xy=True, **options)
        except ProjError:
            return None
    return group.transformers[0] if group.transformers else None
