"""Single values for every format: rounded numbers, plain types, clean text."""

from __future__ import annotations

import datetime
import json
import math
from typing import Any

import numpy as np

# as many characters as any coordinate takes: room in a head for what is known at the end
WIDEST = -123456789.1234


def round_value(value: float, digits: int = 6) -> float:
    """Round `value`; minus zero becomes zero, NaN and infinities stay."""
    return round(float(value), digits) + 0.0


def metres(value: float) -> float:
    """Round to a tenth of a millimetre, as coordinates are written."""
    return round_value(value, 4)


def plain(value: Any) -> Any:
    """Return `value` as str, int, float, bool or None.

    Every format can hold these.

    >>> [plain(v) for v in (np.int32(3), float("nan"), np.bool_(True), datetime.date(2020, 1, 2),
    ...     b"x", [1, "a"])]
    [3, None, True, '2020-01-02', 'x', '[1, "a"]']
    """
    if value is None or isinstance(value, (bool, int)):
        return value
    if isinstance(value, str):
        return plain_text(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.generic) and not isinstance(value, (np.datetime64, np.timedelta64)):
        return plain(value.item())
    if isinstance(value, np.datetime64) or type(value).__name__ == "NaTType":
        return None if str(value) == "NaT" else str(value)
    if isinstance(value, (datetime.date, datetime.time)):
        return value.isoformat()
    if isinstance(value, bytes):
        return plain_text(value.decode("utf-8", "replace"))
    if isinstance(value, (list, tuple, dict)):
        return plain_text(json.dumps(value, ensure_ascii=False, default=str))
    return plain_text(value)


def plain_text(value: Any) -> str:
    """Return `value` as text that every format can hold.

    Halves of surrogate pairs, from files read in a wrong encoding, fit none, and a NUL ends a
    database's text.
    """
    text = str(value)
    return (
        text
        if text.isprintable()
        else text.encode("utf-8", "replace").decode().replace("\0", "\ufffd")
    )
