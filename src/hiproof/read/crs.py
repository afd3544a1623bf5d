"""Coordinate reference systems: are two the same in plan, in which units do they count, how do two combine."""

from __future__ import annotations

import functools
import warnings
from typing import Any

from pyproj import CRS
from pyproj.exceptions import CRSError

from ..errors import InputError
from ..frames import METRES, Units

NAMED_UNITS = {
    "auto": METRES,
    "metre": METRES,
    "foot": Units(0.3048, 0.3048, "foot", "foot"),
    "us-survey-foot": Units(1200 / 3937, 1200 / 3937, "US survey foot", "US survey foot"),
}
"""Units by the setting's name, for coordinates without a CRS."""


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
            f'expected a coordinate reference system such as "EPSG:7415", got {text!r} ({error}); '
            "give its EPSG code or its WKT"
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


@functools.lru_cache(maxsize=64)
def epsg_code(crs: CRS) -> int | None:
    """EPSG number of `crs` where pyproj is sure of it, else None; kept, for looking it up takes a millisecond or several."""
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


def units_of(crs: CRS | None, source: str = "the point clouds", named: str = "auto") -> Units:
    """Units that coordinates in `crs` count in; heights of a CRS without any are taken to be in the plan's unit.

    `named` is a key of NAMED_UNITS for coordinates without a CRS. Raises InputError for a CRS in degrees, and for a name
    that contradicts the CRS; `source` is what the message calls the coordinates.

    >>> str(units_of(CRS("EPSG:2263"))), str(units_of(CRS("EPSG:2263+5703"))), str(units_of(None, named="foot"))
    ('US survey foot', 'US survey foot, heights in metre', 'foot')
    """
    if crs is None:
        return NAMED_UNITS[named]
    plan, height = horizontal_crs(crs), vertical_crs(crs)
    if plan.is_geographic or plan.is_geocentric:
        raise InputError(
            f"expected {source} in a projected CRS, got {crs.name} in "
            f"{'degrees' if plan.is_geographic else 'geocentric coordinates'}; "
            "reproject it first, to the UTM zone or the national grid of the place (`pdal translate`, `ogr2ogr`)"
        )
    if plan.is_vertical:
        raise InputError(
            f"expected {source} in a CRS of the plan, got {crs.name}, which is one of heights alone; name both, such as EPSG:28992+5709"
        )
    across = plan.axis_info[0]
    up = height.axis_info[0] if height is not None else crs.axis_info[2] if len(crs.axis_info) == 3 else across
    units = Units(across.unit_conversion_factor, up.unit_conversion_factor, across.unit_name, up.unit_name)
    if named != "auto" and abs(NAMED_UNITS[named].plan / units.plan - 1) > 1e-9:
        raise InputError(
            f"expected {source} in {named}, as --unit says, got {crs.name} in {units}; leave --unit out, "
            "or say with --crs which CRS is right"
        )
    return units


def units_named(name: str | None, otherwise: Units = METRES) -> Units:
    """Units of the CRS that a file names by URN or address, `otherwise` where it names none that is known."""
    try:
        crs = parse_crs(name)
    except InputError:
        return otherwise
    return otherwise if crs is None else units_of(crs, "the models")


def same_heights(first: CRS, second: CRS) -> bool:
    """Whether heights mean the same in both; a CRS that names none goes with any whose heights are in its unit.

    >>> same_heights(CRS("EPSG:7415"), CRS("EPSG:28992")), same_heights(CRS("EPSG:2263+6360"), CRS("EPSG:2263+5703"))
    (True, False)
    """
    if abs(units_of(first).height / units_of(second).height - 1) > 1e-9:
        return False
    codes = [None if height is None else epsg_code(height) for height in (vertical_crs(first), vertical_crs(second))]
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


def best_of(crs: Any, target: Any, **options: Any) -> Any:
    """pyproj's best transformation from `crs` to `target` that can be carried out here, None where there is none."""
    from pyproj.transformer import TransformerGroup

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of better ones whose grids are missing
        group = TransformerGroup(crs, target, always_xy=True, **options)
    return group.transformers[0] if group.transformers else None
