"""JSON as the writers print it."""

from __future__ import annotations

import json
from typing import Any

# Nothing that is printed here holds itself, and to look for that takes up to a fifth of the time.
COMPACT = json.JSONEncoder(
    separators=(",", ":"), ensure_ascii=False, allow_nan=False, check_circular=False
)


def dump(value: Any) -> bytes:
    """Return compact JSON in UTF-8.

    NaN, which JSON does not know, is refused with a ValueError.

    >>> dump({"id": "a", "kappa": 0.5})
    b'{"id":"a","kappa":0.5}'
    """
    return COMPACT.encode(value).encode("utf-8", "replace")
