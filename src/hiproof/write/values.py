"""Single values for every format: rounded numbers, plain types, clean text, JSON, XML."""

from __future__ import annotations

import datetime
import json
import math
import re
from typing import Any

import numpy as np

from ..compose.settle import PLAN_DIGITS, round_number
from ..data_files import Values

# as many characters as any coordinate takes: room in a head for what is known at the end
WIDEST = -123456789.1234


def metres(value: float) -> float:
    """Round to a tenth of a millimetre, as coordinates are written."""
    return round_number(value, PLAN_DIGITS)


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


PLAIN = re.compile(r"[ !#-%'-;=?-~]*")  # printable ASCII without what must be escaped
NOT_IN_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
ESCAPES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", "\r": "&#13;"})
GENERIC_ATTRIBUTES = {
    int: "gen:intAttribute",
    float: "gen:doubleAttribute",
    str: "gen:stringAttribute",
}
QUOTED = ESCAPES | str.maketrans({'"': "&quot;", "\n": "&#10;", "\t": "&#9;"})


def xml_text(value: Any) -> str:
    """Return `value` as the text of an element.

    Control characters that XML cannot hold become replacement characters.

    >>> xml_text("a < b"), xml_text(2.5)
    ('a &lt; b', '2.5')
    """
    return escape(value, ESCAPES)


def xml_attribute(value: Any) -> str:
    """Return `value` as an attribute's value, between double quotes."""
    return escape(value, QUOTED)


def escape(value: Any, table: dict[int, str]) -> str:
    text = str(value)
    return text if PLAIN.fullmatch(text) else NOT_IN_XML.sub("\ufffd", text).translate(table)


def generic_attribute(name: str, value: Any) -> str:
    """Return a gen:*Attribute of the value's kind; None is left out."""
    if value is None:
        return ""
    tag = GENERIC_ATTRIBUTES.get(type(value), GENERIC_ATTRIBUTES[str])
    text = str(value).lower() if isinstance(value, bool) else xml_text(value)
    return f'<{tag} name="{xml_attribute(name)}"><gen:value>{text}</gen:value></{tag}>'


def format_attribute_set(name: str, values: Values) -> str:
    """Return a gen:genericAttributeSet of `values` by name."""
    inside = "".join(generic_attribute(key, value) for key, value in values.items())
    return (
        f'<gen:genericAttributeSet name="{xml_attribute(name)}">{inside}</gen:genericAttributeSet>'
    )
