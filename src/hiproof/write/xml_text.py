"""Text and attribute values as an XML document holds them."""

from __future__ import annotations

import re
from typing import Any

PLAIN = re.compile(r"[ !#-%'-;=?-~]*")  # printable ASCII without what must be escaped
NOT_IN_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
ESCAPES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", "\r": "&#13;"})
QUOTED = ESCAPES | str.maketrans({'"': "&quot;", "\n": "&#10;", "\t": "&#9;"})


def xml_text(value: Any) -> str:
    """`value` as the text of an element; control characters that XML cannot hold become replacement characters.

    >>> xml_text("a < b"), xml_text(2.5)
    ('a &lt; b', '2.5')
    """
    text = str(value)
    return text if PLAIN.fullmatch(text) else NOT_IN_XML.sub("\ufffd", text).translate(ESCAPES)


def xml_attribute(value: Any) -> str:
    """`value` as an attribute's value, to stand between double quotes."""
    text = str(value)
    return text if PLAIN.fullmatch(text) else NOT_IN_XML.sub("\ufffd", text).translate(QUOTED)
