"""Secrets never leave the process: whatever is written or printed goes through `masked`.

Addresses hold passwords in several ways (`scheme://user:password@host`, `?password=`, `PG:... password='...'`, signed
links) and appear in the middle of others' error texts, so they are looked for in any text. In doubt more is hidden: an
address shown with too little in it harms nobody.
"""

from __future__ import annotations

import re
from typing import Any

HIDDEN = "..."

# user:password@, up to the last @ before the query; up to the word's last where what follows the colon is no port
AFTER_USER = re.compile(r"(://[^\s:@/?#\[]*):(?:[^\s?#]*@|(?!\d*(?:[/?#\s]|$))\S*@)")
TOKEN_AS_USER = re.compile(r"(https?://)[^\s:@/?#]+@", re.IGNORECASE)
ENCODED = re.compile(r"(%3A%2F%2F)[^\s&/]*%40", re.IGNORECASE)
NAMED = re.compile(
    r"((?<![a-z])(?:[\w-]*(?:password|passwd|pwd|secret|token|signature|credential|api_?key)|pass|sig|key)\s*=\s*)"
    r"""(?:'(?:\\.|[^'\\])*'|"(?:\\.|[^"\\])*"|[^&\s]*[^&\s,;:.)'"])""",
    re.IGNORECASE,
)


def masked(text: str) -> str:
    """`text` with the passwords, tokens and signatures of all addresses in it replaced by three dots.

    >>> masked("expected a table at postgresql://me:secret@host/db?table=fp, got none")
    'expected a table at postgresql://me:...@host/db?table=fp, got none'
    >>> masked("PG:host=db user=me password='se cret' dbname=x"), masked("https://host/a.laz?sig=a%2Fb&v=1")
    ('PG:host=db user=me password=... dbname=x', 'https://host/a.laz?sig=...&v=1')
    """
    text = AFTER_USER.sub(rf"\1:{HIDDEN}@", text)
    text = TOKEN_AS_USER.sub(rf"\1{HIDDEN}@", text)
    text = ENCODED.sub(rf"\1{HIDDEN}%40", text)
    return NAMED.sub(rf"\1{HIDDEN}", text)


def masked_values(value: Any) -> Any:
    """A copy of nested dictionaries and lists, each text in them masked."""
    if isinstance(value, str):
        return masked(value)
    if isinstance(value, dict):
        return {name: masked_values(inner) for name, inner in value.items()}
    return [masked_values(inner) for inner in value] if isinstance(value, (list, tuple)) else value
