"""The CRS that a LAS file's records define: WKT, or GeoTIFF keys without any that is clear."""

from __future__ import annotations

import functools
import struct
from collections.abc import Sequence
from typing import Any

from pyproj import CRS
from pyproj.exceptions import CRSError

from ..crs import UnknownCRS, combine, explain_crs_error, names_heights_alone, vertical_crs
from ..names import READING

# Records that hold the keys: the directory, and where it points to for decimals and for texts.
DIRECTORY, DOUBLES, TEXTS = 34735, 34736, 34737

MODEL, CITATION = 1024, 1026  # keys of the kind of CRS and of its name

GEODETIC_CRS = 2048  # key of the code of a CRS in degrees, or of the base of a projected one

# Keys of the code of a projected CRS, of its name, of its unit and of the length of a unit without
# a code.
PROJECTED_CRS, PROJECTED_CITATION, PLAN_UNIT, PLAN_UNIT_SIZE = 3072, 3073, 3076, 3077

VERTICAL_CRS, VERTICAL_UNIT = 4096, 4099  # keys of the codes of a height system and of its unit

# Codes that stand for nothing, and for something of the file's own.
UNDEFINED, USER_DEFINED = 0, 32767

EPSG_CODES = range(1024, USER_DEFINED)  # codes that are EPSG's

PROJECTED, GEOGRAPHIC, GEOCENTRIC = 1, 2, 3  # values of the key MODEL

ELLIPSOIDAL = range(5001, 5034)  # geoTIFF 1.0's codes of heights above an ellipsoid


class GeoKeys(dict[int, Any]):
    """The values of a key directory by their number."""

    @classmethod
    def of(cls, directory: bytes, doubles: bytes = b"", texts: bytes = b"") -> GeoKeys:
        """Decode the three records. Raises CRSError for a directory that is damaged.

        >>> GeoKeys.of(struct.pack("<8H", 1, 1, 0, 1, 3072, 0, 1, 28992))
        {3072: 28992}
        """
        rows = list(struct.iter_unpack("<4H", directory[: len(directory) // 8 * 8]))
        version, _, _, count = rows[0] if rows else (0, 0, 0, 0)
        if version != 1 or len(rows) <= count or (count == 0 and any(directory[8:])):
            raise CRSError(f"a key directory of {len(directory)} bytes that tells of {count} keys")
        return cls((key, value_at(entry, doubles, texts)) for key, *entry in rows[1 : count + 1])

    def code(self, key: int) -> int:
        """Return the value of a key that holds a code, UNDEFINED if it is missing."""
        value = self.get(key)
        return value if isinstance(value, int) else UNDEFINED

    def plan(self) -> CRS | None:
        """Return the plan's CRS, local if only its unit is known; CRSError without."""
        code, model = self.code(PROJECTED_CRS), self.code(MODEL)
        if code in EPSG_CODES:
            return with_unit(CRS.from_epsg(code), self.plan_unit())
        if code == USER_DEFINED or model == PROJECTED:
            return self.local_plan()
        geodetic = self.code(GEODETIC_CRS)
        if geodetic in EPSG_CODES:
            return CRS.from_epsg(geodetic)
        if geodetic == USER_DEFINED or model in (GEOGRAPHIC, GEOCENTRIC):
            return CRS.from_epsg(4978 if model == GEOCENTRIC else 4326)
        return self.local_plan() if self.code(PLAN_UNIT) else None

    def local_plan(self) -> CRS:
        """Return a local CRS, axes east and north, in the unit of the file's own projection."""
        citation = self.get(PROJECTED_CITATION) or self.get(CITATION) or "a projection of its own"
        name, unit = str(citation).replace('"', "'"), self.plan_unit()
        if unit is None:
            raise CRSError(f"{name}, a projection of its own without a unit")
        return CRS.from_wkt(
            f'LOCAL_CS["{name}",LOCAL_DATUM["unknown",0],UNIT["{unit[0]}",{unit[1]!r}],'
            'AXIS["X",EAST],AXIS["Y",NORTH]]'
        )

    def plan_unit(self) -> tuple[str, float] | None:
        """Name and length (m) of the unit in plan, None where no key names it."""
        code = self.code(PLAN_UNIT)
        if code == USER_DEFINED:
            size = self.get(PLAN_UNIT_SIZE)
            return ("unit of its own", size) if isinstance(size, float) else None
        return None if code == UNDEFINED else decode_unit(code)

    def heights(self) -> CRS | None:
        """Return the heights' CRS, or None; where code and unit disagree the unit counts."""
        code, unit = self.code(VERTICAL_CRS), self.code(VERTICAL_UNIT)
        vertical_crs = decode_vertical_crs(code) if code in EPSG_CODES else None
        if unit in (UNDEFINED, USER_DEFINED):
            return vertical_crs
        name, factor = decode_unit(unit)
        if vertical_crs is not None and counts_in(vertical_crs, factor):
            return vertical_crs
        return heights_in("height" if vertical_crs is None else vertical_crs.name, name, factor)


def value_at(entry: Sequence[int], doubles: bytes, texts: bytes) -> Any:
    """Return a directory entry's value, None where it points beyond its record."""
    place, length, position = entry
    if place == 0:
        return position
    if place == DOUBLES and 8 * (position + 1) <= len(doubles):
        return struct.unpack_from("<d", doubles, 8 * position)[0]
    if place == TEXTS and position < len(texts):
        return texts[position : position + length].decode("latin-1").split("\0")[0].strip("| ")
    return None


def decode_vertical_crs(code: int) -> CRS:
    """Return a vertical CRS by EPSG's code or by one of GeoTIFF 1.0's own."""
    if code in ELLIPSOIDAL:
        return heights_in("ellipsoidal height", "metre", 1.0)
    named_crs = CRS.from_epsg(READING["geotiff_heights"].get(str(code), code))
    if not named_crs.is_vertical:
        raise CRSError(f"EPSG:{code} ({named_crs.name}) in place of a height system")
    return named_crs


@functools.cache
def linear_units() -> dict[int, tuple[str, float]]:
    """Name and length (m) of every unit of length by EPSG's code."""
    from pyproj.database import get_units_map

    units = get_units_map(auth_name="EPSG", category="linear", allow_deprecated=True).values()
    exact = {9003: 1200 / 3937}  # which the data base has to 15 digits
    return {
        int(unit.code): (unit.name, exact.get(int(unit.code), unit.conv_factor)) for unit in units
    }


def decode_unit(code: int) -> tuple[str, float]:
    """Return the name and length (m) of a unit; raises CRSError for no unit of length."""
    if code not in linear_units():
        raise CRSError(f"a unit of the code {code}, which is no unit of length")
    return linear_units()[code]


def counts_in(crs: CRS, factor: float) -> bool:
    """Return whether the first axis of a CRS counts in a unit of `factor` metres."""
    return abs(crs.axis_info[0].unit_conversion_factor / factor - 1) < 1e-9


def with_unit(crs: CRS, unit: tuple[str, float] | None) -> CRS:
    """Return a projected CRS in `unit` (name, metres) in place of its code's."""
    if unit is None or counts_in(crs, unit[1]):
        return crs
    name, factor = unit
    definition = crs.to_json_dict()
    for axis in definition["coordinate_system"]["axis"]:
        axis["unit"] = {"type": "LinearUnit", "name": name, "conversion_factor": factor}
    definition.pop("id", None)
    return CRS.from_json_dict({**definition, "name": f"{crs.name} ({name})"})


def heights_in(name: str, unit: str, factor: float) -> CRS:
    """Make a vertical CRS in a unit of `factor` metres."""
    return CRS.from_wkt(
        f'VERT_CS["{name} '
        f'({unit})",VERT_DATUM["{name}",2005],UNIT["{unit}",{factor!r}],AXIS["Up",UP]]'
    )


WKT = 2112  # number of the record that holds a WKT


def las_crs(records: dict[int, bytes]) -> CRS | UnknownCRS | None:
    """Return the CRS of records (by number) of LASF_Projection, heights of keys, or None."""
    found, faults = [], []
    for read in (read_text, read_keys):
        try:
            found.append(read(records))
        except CRSError as error:
            found.append(None)
            faults.append(explain_crs_error(error))
    by_text, by_keys = found
    if by_text is None and by_keys is None:
        return UnknownCRS(faults[0]) if faults else None
    if by_text is None or by_keys is None:
        return by_keys if by_text is None else by_text
    return combine(by_text, by_keys if names_heights_alone(by_keys) else vertical_crs(by_keys))


def read_text(records: dict[int, bytes]) -> CRS | None:
    """Return the CRS of WKT in UTF-8, the standard, or in Latin-1 of writers that did not know."""
    content = records.get(WKT, b"")
    try:
        text = content.decode()
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    text = text.split("\0")[0].strip()
    return CRS.from_wkt(text) if text else None


def read_keys(records: dict[int, bytes]) -> CRS | None:
    """Return the CRS of plan and heights that the keys define, or of heights alone, or None.

    Raises CRSError for keys that cannot be understood.
    """
    if DIRECTORY not in records:
        return None
    keys = GeoKeys.of(*(records.get(number, b"") for number in (DIRECTORY, DOUBLES, TEXTS)))
    plan, heights = keys.plan(), keys.heights()
    return heights if plan is None else combine(plan, heights)
