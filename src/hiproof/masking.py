"""Masking of secrets: all that is written or printed goes through `mask`.

Addresses hold passwords in several ways (`scheme://user:password@host`, `?password=`, `PG:...
password='...'`, signed links) and appear in the middle of others' error texts, so they are looked
for in any text. Libraries also quote what they make of a malformed address, a piece of a password
alone for example. So `remember` takes the secrets out of an address where it comes in, and `mask`
hides them and their pieces wherever they stand, as they are, percent-encoded or quoted. In doubt
more is hidden: an address shown with too little in it harms nobody.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator
from typing import Any
from urllib.parse import quote, quote_plus, unquote, unquote_plus

HIDDEN = "..."

# user:password@, up to the last @ before the query; up to the word's last where what follows the
# colon is no port
AFTER_USER = re.compile(r"(://[^\s:@/?#\[]*):(?:[^\s?#]*@|(?!\d*(?:[/?#\s]|$))\S*@)")
TOKEN_AS_USER = re.compile(r"(https?://)[^\s:@/?#]+@", re.IGNORECASE)
ENCODED = re.compile(r"(%3A%2F%2F)[^\s&/]*%40", re.IGNORECASE)
SECRET_NAME = (
    r"(?:(?<![\w-])[\w-]*(?:password|passwd|pwd|secret|token|signature|credential|api_?key)"
    r"|(?<![a-z])(?:pass|sig|key|accesskeyid))\s*=\s*"
)
NAMED = re.compile(
    rf"({SECRET_NAME})" r"""(?:'(?:\\.|[^'\\])*'|"(?:\\.|[^"\\])*"|[^&\s]*[^&\s,;:.)'"])""",
    re.IGNORECASE,
)

# A scheme, or what a slip has left of it.
SCHEME = re.compile(r"^(?:/vsi\w+[/?])?[\w+.-]*:?//?|^[\w+.-]+:(?=[^@]*:)")
# A scheme that is none where a user's name stands.
USER_LIKE_A_SCHEME = re.compile(r"^(?:/vsi\w+[/?])?[\w+.-]*:?//?")
# The value of a parameter with a secret, and all that follows.
VALUE = re.compile(rf"{SECRET_NAME}(.*)", re.IGNORECASE | re.DOTALL)
END = re.compile(r"[&\s;]+[\w-]+\s*=")  # of a value: the next parameter
BREAKS = re.compile(r"[^\w.~-]+")  # where programs cut an address into pieces
# Characters below which a secret is hidden as a whole word only, like one that is a word.
WHOLE_WORD_BELOW = 4
# What is hidden in addresses only: single letters and small numbers stand in most sentences.
NO_SECRET = re.compile(r"\W*.?\W*|\d{1,3}")
ADDRESS_PATTERN = re.compile(
    r"//|@|%2F%2F|^/vsi"
    r"|(?:^|[\s:;?&])(?:host|hostaddr|dbname|user|service|server|uid|password|pwd)\s*=",
    re.IGNORECASE,
)


class Secrets:
    """Secrets of the addresses seen so far, in all forms in which they may be written."""

    def __init__(self) -> None:
        self.known: set[str] = set()
        self.forms: dict[str, str] = {}  # by what they are in lower case

    def add(self, secrets: Iterable[str]) -> None:
        new = set(secrets) - self.known
        self.known |= new
        self.forms |= {form.lower(): form for secret in new for form in list_forms(secret)}

    def hide(self, text: str) -> str:
        lowered = text.lower()
        fixed = (form for lower, form in self.forms.items() if lower in lowered)
        result = sorted(fixed, key=len, reverse=True)
        if not result:
            return text
        return re.sub(
            "|".join(make_pattern(form) for form in result), HIDDEN, text, flags=re.IGNORECASE
        )


SECRETS = Secrets()


def remember(*addresses: object) -> None:
    """Hide the passwords, tokens and signatures of these addresses.

    They are hidden in all that is written from now on. What is no address, such as a condition or
    the name of a file that is there, holds none.
    """
    for address in addresses:
        if (
            isinstance(address, str)
            and ADDRESS_PATTERN.search(address)
            and not names_a_file(address)
        ):
            SECRETS.add(find_secrets(address))


def names_a_file(address: str) -> bool:
    try:
        return os.path.exists(address)
    except ValueError:  # a NUL, which no file has in its name
        return False


def names_a_secret(text: str) -> bool:
    """Return whether a parameter with a secret begins in `text`, such as `password=`."""
    return re.search(SECRET_NAME, text, re.IGNORECASE) is not None


def find_secrets(address: str) -> set[str]:
    """Return the secrets in an address, however malformed, and their pieces.

    A program may cut them into such pieces.

    >>> addresses = "postgresql//adm:S3cr3t@127.0.0.1/t", "host=h password=S3c r3t user=me"
    >>> [sorted(find_secrets(address)) for address in addresses]
    [['S3cr3t'], ['S3c', 'S3c r3t', 'r3t']]
    >>> harmless = "tiles/a.laz", "https://host:8080/tile.laz", "postgresql://me@host/db"
    >>> [find_secrets(address) for address in harmless]
    [set(), set(), set()]
    """
    decoded = unquote(address)
    whole = {secret for text in {address, decoded, unquote(decoded)} for secret in candidates(text)}
    pieces = {
        piece
        for secret in whole
        for text in (secret, unquote(secret))
        for piece in BREAKS.split(text)
    }
    return {secret for secret in whole | pieces if not NO_SECRET.fullmatch(secret)}


def candidates(address: str) -> Iterator[str]:
    """Yield possible secrets: what follows a user's name up to an @, and named parameters."""
    for remainder in {SCHEME.sub("", address, count=1), USER_LIKE_A_SCHEME.sub("", address)}:
        yield from before_an_at(remainder, address)
    for result in VALUE.finditer(address):
        yield from values_at(result[1])
    # VALUE takes all that follows, so parameters within it are looked for by their names.
    for result in re.finditer(SECRET_NAME, address, re.IGNORECASE):
        yield from values_at(address[result.end() :])
        if "?" in address:  # blanks part no parameters there
            yield re.split(r"[&;]", address[result.end() :], maxsplit=1)[0]


def before_an_at(remainder: str, address: str) -> Iterator[str]:
    """Yield what may be a password in the `remainder` of an address behind its scheme."""
    for end in {
        remainder.find("@"),
        remainder.rfind("@"),
        re.split(r"[?#]", remainder, maxsplit=1)[0].rfind("@"),
    }:
        user, colon, password = remainder[: max(end, 0)].partition(":")
        if colon:
            yield password
        if re.match(r"(?:/vsi\w+/)?https?:", address, re.IGNORECASE):
            yield user  # a token may stand alone, and hold a colon


def values_at(text: str) -> Iterator[str]:
    """Yield possible values at a parameter's start: quoted, up to the next, or to a sign."""
    if not text:
        return
    if text[0] in "'\"":
        inner = re.match(r"((?:\\.|[^\\])*?)(?:(?<!\\)" + text[0] + r"|$)", text[1:], re.DOTALL)
        value = inner[1] if inner else text[1:]
        # a quote within the value ends it too early
        all_of_it = END.split(text[1:], maxsplit=1)[0].rstrip("'\"")
        yield from (value, re.sub(r"\\(.)", r"\1", value), all_of_it)
        return
    value = END.split(text, maxsplit=1)[0]
    yield from (value, unquote_plus(value), re.split(r"[&\s]", value, maxsplit=1)[0])


def list_forms(secret: str) -> set[str]:
    """Return a secret's forms: as it is, decoded, encoded, and as programs quote it."""
    return {
        form
        for text in {secret, unquote(secret), unquote_plus(secret)}
        for form in (
            *(text, quote(text), quote_plus(text), quote(text, safe="")),
            *(repr(text)[1:-1], json.dumps(text)[1:-1]),
            *(text.replace("'", "''"), text.replace("\\", "\\\\")),
            repr(text.encode("utf-8", "replace"))[2:-1],
        )
        if re.search(r"\w", form)
    }


def make_pattern(form: str) -> str:
    """Return the pattern of a secret's form; a short one or a word must stand alone."""
    is_word = form.isalpha() and (form.islower() or form.isupper() or form.istitle())
    if len(form) >= WHOLE_WORD_BELOW and not is_word:
        return re.escape(form)
    return rf"(?:(?<!\w)|(?<=%[0-9a-f]{{2}})|(?<=\\[a-z])){re.escape(form)}(?!\w)"


def mask(text: str) -> str:
    """Replace the secrets of all addresses in `text` by three dots.

    Secrets are passwords, tokens and signatures.

    >>> mask("expected a table at postgresql://me:secret@host/db?table=fp, got none")
    'expected a table at postgresql://me:...@host/db?table=fp, got none'
    >>> mask("PG:host=db user=me password='se cret' dbname=x")
    'PG:host=db user=me password=... dbname=x'
    >>> mask("https://host/a.laz?sig=a%2Fb&v=1")
    'https://host/a.laz?sig=...&v=1'
    """
    text = AFTER_USER.sub(rf"\1:{HIDDEN}@", text)
    text = TOKEN_AS_USER.sub(rf"\1{HIDDEN}@", text)
    text = ENCODED.sub(rf"\1{HIDDEN}%40", text)
    return SECRETS.hide(NAMED.sub(rf"\1{HIDDEN}", text))


def masked_values(value: Any) -> Any:
    """Return a copy of nested dictionaries and lists, each text masked."""
    if isinstance(value, str):
        return mask(value)
    if isinstance(value, dict):
        return {name: masked_values(inner) for name, inner in value.items()}
    return [masked_values(inner) for inner in value] if isinstance(value, (list, tuple)) else value
