"""The CRS that a LAS file's records define.

It is WKT, or GeoTIFF keys where there is no WKT that can be understood.
"""

from __future__ import annotations

from pyproj import CRS
from pyproj.exceptions import CRSError

from .crs import UnknownCRS, combine, explain_crs_error, names_heights_alone, vertical_crs
from .geokeys import DIRECTORY, DOUBLES, TEXTS, decode_crs

WKT = 2112
"""Number of the record that holds a WKT."""


def las_crs(records: dict[int, bytes]) -> CRS | UnknownCRS | None:
    """Return the CRS that the records of user LASF_Projection define, or None.

    Records come by number.

    Heights may come from the keys beside a WKT.
    """
    text = decode_wkt(records.get(WKT, b""))
    result, faults = [], []
    for is_there, read in (
        (bool(text), lambda: CRS.from_wkt(text)),
        (
            DIRECTORY in records,
            lambda: decode_crs(*(records.get(id, b"") for id in (DIRECTORY, DOUBLES, TEXTS))),
        ),
    ):
        try:
            result.append(read() if is_there else None)
        except CRSError as error:
            result.append(None)
            faults.append(explain_crs_error(error))
    by_text, by_keys = result
    if by_text is None and by_keys is None:
        return UnknownCRS(faults[0]) if faults else None
    if by_text is None:
        return by_keys
    if by_keys is None:
        return by_text
    return combine(by_text, by_keys if names_heights_alone(by_keys) else vertical_crs(by_keys))


def decode_wkt(content: bytes) -> str:
    """Decode a record of WKT.

    It is UTF-8 by the standard, and Latin-1 from writers that did not know.
    """
    try:
        text = content.decode()
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return text.split("\0")[0].strip()
