"""Coordinate reference systems: equality in plan, units, combination."""

from __future__ import annotations

import functools
import re
import warnings
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from pyproj import CRS, Proj, Transformer
from pyproj.exceptions import CRSError, ProjError

from ...errors import InputError, warn
from ...frames import METRES, Units
from ..names import READING
from .axes import check_height_axis, check_plan_axes

WGS84 = CRS.from_epsg(4326)  # what places on the Earth are compared in

# Units by the setting's name, for coordinates without a CRS.
NAMED_UNITS = {
    "auto": METRES,
    "metre": METRES,
    "foot": Units(0.3048, 0.3048, "foot", "foot"),
    "us-survey-foot": Units(1200 / 3937, 1200 / 3937, "US survey foot", "US survey foot"),
}


# Names by EPSG codes that PROJ does not read: of GML 3.1, of plan and heights, without a version.
EPSG_NAME = re.compile(
    r"https?://\S*(?:epsg\.xml#\d+|/def/crs-compound\?(?:[^&\s]*/EPSG/[^/&\s]*/\d+(?:&|$))+)"
    r"|EPSG::\d+",
    re.IGNORECASE,
)
EPSG_CODE = re.compile(r"(?:epsg\.xml#|/EPSG/[^/&]*/|EPSG::)(\d+)", re.IGNORECASE)


@dataclass(frozen=True)
class UnknownCRS:
    """A CRS that a file defines, but that cannot be understood, and why."""

    reason: str


def parse_crs(value: Any) -> CRS | None:
    """Return the pyproj CRS of an EPSG number, "EPSG:7415", WKT or a CRS.

    Names of the German surveying authorities and those of GML 3.1 are understood, too. None and ""
    stay None. Raises InputError otherwise.

    >>> parse_crs("EPSG:28992").to_epsg()
    28992
    >>> parse_crs("urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH").name
    'ETRS89 / UTM zone 32N + DHHN2016 height'
    """
    if value is None or (isinstance(value, str) and not value.strip()):
        return None
    try:
        return CRS.from_user_input(translate_name(value) if isinstance(value, str) else value)
    except CRSError as error:
        text = str(value)[:60]
        raise InputError(
            f'expected a coordinate reference system such as "EPSG:7415", got {text!r} '
            f"({explain_crs_error(error)}); "
            "give its EPSG code or its WKT"
        ) from error


def translate_name(name: str) -> str:
    """Return the EPSG codes of a name that PROJ does not read, else the name.

    >>> translate_name("http://www.opengis.net/gml/srs/epsg.xml#31467")
    'EPSG:31467'
    """
    if EPSG_NAME.fullmatch(name.strip()):
        return "EPSG:" + "+".join(EPSG_CODE.findall(name))
    parts = name.strip().removeprefix("urn:adv:crs:").split("*")
    codes = [READING["adv_crs"].get(part) for part in parts]
    return name if None in codes else "EPSG:" + "+".join(map(str, codes))


def read_named_crs(name: Any, path: Any) -> CRS | None:
    """Return the CRS that a file names; None, with a warning, where PROJ does not know it."""
    try:
        return parse_crs(name)
    except InputError:
        warn(
            path,
            f"names a CRS that PROJ does not know, {str(name)[:60]!r}; it is taken as a "
            "file that names none. Name another in the file, or with --crs",
        )
        return None


def refuse_other_crs(first: str | None, name: str | None, place: str) -> None:
    """Raise InputError where a `place` in a file names another CRS than its beginning."""
    if name is None or name == first:
        return
    with suppress(InputError):
        if first is not None and parse_crs(first) == parse_crs(name):
            return
    raise InputError(
        f"expected one CRS in a file, got {name:.80} in {place} after {first or 'none':.80}; write "
        "a file for each"
    )


def explain_crs_error(error: CRSError) -> str:
    """Return PROJ's explanation without the definition, which pyproj repeats.

    >>> inner = "Internal Proj Error: proj_create: unrecognized format"
    >>> explain_crs_error(CRSError(f"Invalid projection: FOO[1]: ({inner})"))
    'unrecognized format'
    """
    reason = str(error).rpartition("Internal Proj Error: ")[2].removeprefix("proj_create: ")
    return reason.partition("\n")[0][:120].rstrip(").")


def horizontal_crs(crs: CRS) -> CRS:
    """Return the plan component of a CRS, in 2D; a plain CRS is returned as it is."""
    if crs.is_compound:
        return horizontal_crs(crs.sub_crs_list[0])
    if crs.is_bound and crs.source_crs is not None:
        return horizontal_crs(crs.source_crs)
    return crs.to_2d() if len(crs.axis_info) == 3 and not crs.is_engineering else crs


def vertical_crs(crs: CRS) -> CRS | None:
    """Return the height component of a compound CRS, None where there is none."""
    if crs.is_bound and crs.source_crs is not None and not crs.is_vertical:
        return vertical_crs(crs.source_crs)
    heights = [part for part in crs.sub_crs_list if part.is_vertical]
    return heights[0] if heights else None


def has_heights(crs: CRS) -> bool:
    """Return whether a CRS says what its heights are."""
    return vertical_crs(crs) is not None or len(crs.axis_info) == 3


def names_place(crs: CRS | None) -> bool:
    """Return whether coordinates in `crs` have a place on the Earth.

    A local CRS and one of heights alone leave that open.

    >>> [names_place(CRS(text)) for text in ("EPSG:28992", "EPSG:5709", 'LOCAL_CS["site"]')]
    [True, False, False]
    """
    return (
        crs is not None and not names_heights_alone(crs) and not horizontal_crs(crs).is_engineering
    )


def names_heights_alone(crs: CRS) -> bool:
    """Return whether `crs` has heights but no plan: pyproj calls compounds vertical, too."""
    return horizontal_crs(crs).is_vertical


def same_horizontal(first: CRS | None, second: CRS | None) -> bool:
    """Return whether plan coordinates mean the same place in both CRSs.

    Heights are ignored. An unknown CRS equals nothing.

    >>> same_horizontal(CRS("EPSG:7415"), CRS("EPSG:28992"))
    True
    """
    if first is None or second is None:
        return False
    plan, other = horizontal_crs(first), horizontal_crs(second)
    return plan.equals(other, ignore_axis_order=True) or (
        epsg_code(plan) == epsg_code(other) is not None
    )


@functools.lru_cache(maxsize=64)
def epsg_code(crs: CRS) -> int | None:
    """Return the EPSG number where pyproj is sure, else None; cached, as it takes milliseconds."""
    authority = crs.to_authority("EPSG", min_confidence=70)
    return int(authority[1]) if authority else None


def combine(horizontal: CRS | None, vertical: CRS | None) -> CRS | None:
    """Return the compound of plan and heights, or `horizontal` that has, or lacks, heights."""
    if horizontal is None or vertical is None or vertical_crs(horizontal) is not None:
        return horizontal
    from pyproj.crs import CompoundCRS

    plan = horizontal_crs(horizontal)
    compound = CompoundCRS(name=f"{plan.name} + {vertical.name}", components=[plan, vertical])
    code = epsg_code(compound)
    return CRS.from_epsg(code) if code is not None else compound


def find_units(crs: CRS | None, source: str = "the point clouds", unit_name: str = "auto") -> Units:
    """Return the units of coordinates in `crs`.

    Heights of a CRS without any are taken to be in the plan's unit. `unit_name` is a key of
    NAMED_UNITS for coordinates without a CRS. Raises InputError for a CRS in degrees, and for a
    name that contradicts the CRS; `source` is what the message calls the coordinates.

    >>> str(find_units(CRS("EPSG:2263+5703"))), str(find_units(None, unit_name="foot"))
    ('US survey foot, heights in metre', 'foot')
    """
    if crs is None:
        return NAMED_UNITS[unit_name]
    plan = horizontal_crs(crs)
    if plan.is_vertical:
        return find_height_units(plan, source, unit_name)
    if plan.is_geographic or plan.is_geocentric:
        raise InputError(
            f"expected {source} in a projected CRS, got {crs.name} in "
            f"{'degrees' if plan.is_geographic else 'geocentric coordinates'}; reproject it first, "
            "to the UTM zone or the national grid of the place (`pdal translate`, `ogr2ogr`)"
        )
    check_plan_axes(plan, source)
    across = vertical = plan.axis_info[0]
    heights = vertical_crs(crs)
    if heights is not None:
        vertical = heights.axis_info[0]
    elif len(crs.axis_info) == 3 and not crs.is_compound:
        vertical = crs.axis_info[2]
    check_height_axis(vertical, crs, source)
    units = Units(
        across.unit_conversion_factor,
        vertical.unit_conversion_factor,
        across.unit_name,
        vertical.unit_name,
    )
    if unit_name != "auto" and differ(NAMED_UNITS[unit_name].plan, units.plan):
        raise InputError(
            f"expected {source} in {unit_name}, as --unit says, got {crs.name} in {units}; leave "
            "--unit out, or say with --crs which CRS is right"
        )
    return units


def differ(unit: float, other: float) -> bool:
    """Return whether two units of so many metres are not one."""
    return abs(unit / other - 1) > 1e-9


def find_height_units(heights: CRS, source: str, unit_name: str) -> Units:
    """Return units of a CRS that names heights alone; the plan's has to be the same."""
    units, vertical = NAMED_UNITS[unit_name], heights.axis_info[0]
    check_height_axis(vertical, heights, source)
    if differ(vertical.unit_conversion_factor, units.plan):
        raise InputError(
            f"expected {source} in a CRS of the plan, got {heights.name}, which names heights "
            f"alone, in {vertical.unit_name}; name both with --crs, such as EPSG:28992+5709"
        )
    return units


def find_named_units(name: str | None, alternative: Units = METRES) -> Units:
    """Return the units of the CRS named by URN or address, else the `alternative`."""
    try:
        crs = parse_crs(name)
    except InputError:
        return alternative
    return alternative if crs is None else find_units(crs, "the models")


def same_heights(first: CRS, second: CRS) -> bool:
    """Return whether heights mean the same in both CRSs.

    A CRS that names no heights goes with any whose heights are in its unit.

    >>> same_heights(CRS("EPSG:7415"), CRS("EPSG:28992")), same_heights(CRS("EPSG:2263+6360"),
    ...     CRS("EPSG:2263+5703"))
    (True, False)
    """
    if differ(find_units(first).height, find_units(second).height):
        return False
    heights = vertical_crs(first), vertical_crs(second)
    codes = {epsg_code(height) for height in heights if height is not None}
    return len(codes - {None}) < 2


def describe_crs(crs: CRS | None) -> str:
    """Return a CRS's EPSG code and name, for messages.

    >>> describe_crs(CRS("EPSG:28992")), describe_crs(None)
    ('EPSG:28992 (Amersfoort / RD New)', 'no CRS')
    """
    if crs is None:
        return "no CRS"
    code = epsg_code(crs)
    return crs.name if code is None else f"EPSG:{code} ({crs.name})"


def make_transformer(source: CRS, target: CRS) -> Transformer:
    """Return the transformer of plans, x before y; raises InputError where there is none."""
    plans = horizontal_crs(source), horizontal_crs(target)
    try:
        if any(plan.is_geocentric or plan.is_vertical for plan in plans):
            raise ProjError("coordinates of another kind")
        return Transformer.from_crs(source, target, always_xy=True)
    except ProjError as error:
        raise InputError(
            f"expected a way from {describe_crs(source)} to {describe_crs(target)}, got none that "
            "PROJ knows; check which CRS each file names, or reproject one of them"
        ) from error


def convert_to_degrees(crs: CRS, xy: np.ndarray) -> np.ndarray:
    """Return longitude and latitude (n, 2) of plan positions (n, 2) in `crs`.

    They are NaN where the CRS leaves the place open. Those of a projected CRS are of its own datum,
    up to a kilometre from WGS 84: to look for the operation between the two takes 50 ms.
    """
    plan = horizontal_crs(crs)
    with suppress(InputError, ProjError):
        if plan.is_projected:
            return np.column_stack(Proj(plan)(xy[:, 0], xy[:, 1], inverse=True))
        if names_place(crs):
            return np.column_stack(make_transformer(plan, WGS84).transform(*xy.T))
    return np.full(xy.shape, np.nan)


def find_best_transformer(crs: Any, target: Any, **options: Any) -> Any:
    """Return pyproj's best transformer to `target` that works here, None without one."""
    from pyproj.transformer import TransformerGroup

    with warnings.catch_warnings(), suppress(ProjError, IndexError):
        warnings.simplefilter("ignore", UserWarning)  # of better ones whose grids are missing
        return TransformerGroup(crs, target, always_xy=True, **options).transformers[0]
    return None
