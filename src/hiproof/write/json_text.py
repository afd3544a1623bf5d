"""JSON as the writers print it."""

from __future__ import annotations

import json
from typing import Any


def dump(value: Any) -> bytes:
    """Compact JSON in UTF-8; NaN, which JSON does not know, is refused with a ValueError.

    >>> dump({"id": "a", "kappa": 0.5})
    b'{"id":"a","kappa":0.5}'
    """
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode("utf-8", "replace")
