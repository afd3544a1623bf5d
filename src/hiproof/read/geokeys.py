"""The height system that a LAS file's GeoTIFF keys name, which laspy passes over: its code, or only its unit."""

from __future__ import annotations

from typing import Any

from pyproj import CRS

VERTICAL_CRS_KEY, VERTICAL_UNIT_KEY = 4096, 4099  # of GeoTIFF 1.1, section 7
EPSG_CODES = range(1024, 32767)  # what GeoTIFF takes for a code of EPSG; beyond are a file's own
UNITS = {9001: ("metre", 1.0), 9002: ("foot", 0.3048), 9003: ("US survey foot", 1200 / 3937)}
"""Units by EPSG's number."""


def heights_of_keys(header: Any) -> CRS | None:
    """Vertical CRS of a laspy header's GeoTIFF keys, None without any. Where code and unit disagree the unit counts."""
    keys = {
        key.id: key.value_offset
        for record in header.vlrs.get("GeoKeyDirectoryVlr")
        for key in record.geo_keys
        if key.tiff_tag_location == 0
    }
    code, unit = keys.get(VERTICAL_CRS_KEY, 0), UNITS.get(keys.get(VERTICAL_UNIT_KEY, 0))
    named = CRS.from_epsg(code) if code in EPSG_CODES else None
    if unit is None or (named is not None and abs(named.axis_info[0].unit_conversion_factor / unit[1] - 1) < 1e-9):
        return named
    name = "height" if named is None else named.name
    return CRS.from_wkt(
        f'VERT_CS["{name} ({unit[0]})",VERT_DATUM["{name}",2005],UNIT["{unit[0]}",{unit[1]!r}],AXIS["Up",UP]]'
    )
