"""Checks that a raster can be a terrain model: its position, its bands and their unit.

Every refusal is one sentence, raised before any height is read.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any

from ...errors import InputError, warn
from ..names import READING

METRES_IN: dict[str, float] = {
    name: metres for names, metres in READING["height_units"].items() for name in names.split()
}
# "m above sea level", "m+NAP"
DATUM = re.compile(r"\b(above|over|nap|nn|nhn|navd\w*|egm\w*|msl|asl|a\.s\.l)\b.*|\+.*")


def refuse_without_position(dataset: Any, path: str) -> None:
    """Raise InputError without a geotransform, or with one that maps pixels onto a line."""
    transform = dataset.transform
    if transform.is_identity:
        raise InputError(
            f"expected a georeferenced raster of heights at {path}, got an image without position; "
            "name a GeoTIFF"
        )
    size = math.hypot(*transform[:2], *transform[3:5])
    if (
        not all(map(math.isfinite, transform[:6]))
        or not abs(transform.determinant) > 1e-12 * size**2
    ):
        raise InputError(
            f"expected a raster whose pixels have an area at {path}, got the geotransform "
            f"{tuple(transform[:6])}; export it again with its position"
        )


def choose_bands(dataset: Any, path: str) -> tuple[int, int | None]:
    """Return the numbers of the band of heights, the first that is opaque, and of transparency.

    The second is None without one: GDAL ignores it beside decimals. Raises InputError for pictures.
    A raster of several bands of heights is used with a warning that names the one taken.
    """
    if not dataset.count:
        names = ", ".join(dataset.subdatasets[:3]) or "none"
        raise InputError(
            f"expected a raster band of heights at {path}, got a container of {names}; name one of "
            "them"
        )
    kinds = [interpretation.name.lower() for interpretation in dataset.colorinterp]
    bands = [number for number, kind in enumerate(kinds, 1) if kind != "alpha"]
    band = bands[0] if bands else 1
    is_complex = str(dataset.dtypes[band - 1]).startswith("complex")
    if is_complex or kinds[band - 1] in READING["picture_bands"]:
        text = "complex numbers" if is_complex else f"a picture (band {kinds[band - 1]})"
        raise InputError(
            f"expected a raster of heights at {path}, got {text}; name a terrain model"
        )
    if len(bands) > 1:
        warn(path, f"has {len(bands)} bands; the heights are taken from band {band}")
    return band, kinds.index("alpha") + 1 if "alpha" in kinds[1:] else None


def read_scaling(dataset: Any, band: int, path: str) -> tuple[float, float]:
    """Return factor and offset of stored values; InputError where they give no height."""
    scale, offset = float(dataset.scales[band - 1]), float(dataset.offsets[band - 1])
    if not (math.isfinite(scale) and scale and math.isfinite(offset)):
        raise InputError(
            f"expected a scale and an offset of the heights at {path}, got {scale:g} and "
            f"{offset:g}; correct them (`gdal_edit -scale 1 -offset 0`)"
        )
    return scale, offset


def band_unit(name: str | None, path: str) -> float | None:
    """Return the metres in the unit that a band names, None if it names none.

    Raises InputError for units that are no lengths.

    >>> band_unit("US survey foot", "dtm.tif") == 1200 / 3937, band_unit("m above sea level",
    ...     "dtm.tif")
    (True, 1.0)
    """
    for plain in spellings(name or ""):
        if plain in METRES_IN:
            return METRES_IN[plain]
        if plain in READING["no_unit"]:
            return None
    raise InputError(
        f"expected heights in metres or feet at {path}, got a band in {name!r}; convert them to "
        "metres (`gdal_calc`), or correct the unit"
    )


def spellings(name: str) -> Iterator[str]:
    """Yield a unit's name in small letters, whole and without the datum that follows."""
    for text in (name.lower(), DATUM.sub("", name.lower())):
        yield re.sub(r"[^a-z]", "", text)
