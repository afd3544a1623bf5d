"""The features of a layer through pyogrio, odd attributes as text.

One value can make pyogrio give up a whole layer: the 30th of February, text in no encoding, a list
of booleans. GDAL itself reads all of these, so the attribute is read again through its virtual
format, declared as text.
"""

from __future__ import annotations

import re
from functools import partial
from typing import Any

import numpy as np
import pyogrio
from pyogrio.errors import DataSourceError, FeatureError, FieldError

from .layers import virtual_layer

SLASHED_DATE = re.compile(r"^(\d{1,5})/(\d\d)/(\d\d)")
"""How GDAL writes a date as text."""

READ_ERRORS = (ValueError, OverflowError, FieldError)
"""What pyogrio raises for a value that it cannot represent; text that is no UTF-8 is a ValueError,
too.
"""


def read_layer(
    path: str, layer: str | int | None, **chosen: Any
) -> tuple[dict[str, Any], np.ndarray, np.ndarray, list[np.ndarray], list[str]]:
    """Read pyogrio's metadata, numbers, WKB and columns of a layer.

    The names of the attributes that were read as text come with them.

    `chosen` are pyogrio's own options that choose among the features.
    """
    read = partial(
        pyogrio.raw.read, path, layer=layer, return_fids=True, datetime_as_string=True, **chosen
    )
    try:
        return (*read(), [])
    except READ_ERRORS as error:
        info = pyogrio.read_info(path, layer=layer)
        odd = (
            []
            if "SQL" in str(error)
            else [name for name in info["fields"] if not is_readable(path, layer, name)]
        )
        if not odd:
            raise
    meta, numbers, wkb, columns = read(columns=[name for name in info["fields"] if name not in odd])
    columns_by_name = dict(
        zip(meta["fields"], zip(columns, meta["dtypes"], strict=True), strict=True)
    )
    columns_by_name |= {
        name: (column_as_text(path, info["layer_name"], name, numbers), "object") for name in odd
    }
    names = [name for name in info["fields"] if name in columns_by_name]
    meta = {**meta, "fields": names, "dtypes": [columns_by_name[name][1] for name in names]}
    return meta, numbers, wkb, [columns_by_name[name][0] for name in names], odd


def is_readable(path: str, layer: str | int | None, name: str) -> bool:
    """Return whether pyogrio can represent every value of an attribute."""
    try:
        pyogrio.raw.read(
            path, layer=layer, columns=[name], read_geometry=False, datetime_as_string=True
        )
    except READ_ERRORS:
        return False
    return True


def column_as_text(path: str, layer: str, name: str, numbers: np.ndarray) -> np.ndarray:
    """Return an attribute (n,) of the features with these numbers as text.

    Bytes that are no UTF-8 become replacement characters.
    """
    source = virtual_layer(path, layer, text=name)
    try:
        _, _, _, columns = pyogrio.raw.read(
            source, fids=numbers, read_geometry=False, encoding="latin-1"
        )
    except (*READ_ERRORS, DataSourceError, FeatureError):
        columns = []
    if not columns:
        return np.full(len(numbers), None, dtype=object)
    return np.array([tidy_value(value) for value in columns[0]], dtype=object)


def tidy_value(value: str | None) -> str | None:
    """Decode text that was read as Latin-1, and write dates in ISO's way.

    >>> tidy_value("1950/00/00"), tidy_value("Stra\\u00c3\\u009fe")
    ('1950-00-00', 'Straße')
    """
    if value is None:
        return None
    body = value.encode("latin-1", "replace")
    try:
        text = body.decode()
    except UnicodeDecodeError:
        text = body.decode("utf-8", "replace")
    return SLASHED_DATE.sub(r"\1-\2-\3", text)
