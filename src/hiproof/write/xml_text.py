"""Text and attribute values as an XML document holds them."""

from __future__ import annotations

import re
from typing import Any

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
    text = str(value)
    return text if PLAIN.fullmatch(text) else NOT_IN_XML.sub("\ufffd", text).translate(ESCAPES)


def xml_attribute(value: Any) -> str:
    """Return `value` as an attribute's value, between double quotes."""
    text = str(value)
    return text if PLAIN.fullmatch(text) else NOT_IN_XML.sub("\ufffd", text).translate(QUOTED)


def generic_attribute(name: str, value: Any) -> str:
    """Return a gen:*Attribute of the value's kind; None is left out."""
    if value is None:
        return ""
    tag = GENERIC_ATTRIBUTES.get(type(value), GENERIC_ATTRIBUTES[str])
    text = str(value).lower() if isinstance(value, bool) else xml_text(value)
    return f'<{tag} name="{xml_attribute(name)}"><gen:value>{text}</gen:value></{tag}>'


def format_attribute_set(name: str, values: dict[str, Any]) -> str:
    """Return a gen:genericAttributeSet of `values` by name."""
    inside = "".join(generic_attribute(key, value) for key, value in values.items())
    return (
        f'<gen:genericAttributeSet name="{xml_attribute(name)}">{inside}</gen:genericAttributeSet>'
    )
