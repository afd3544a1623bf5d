"""The files that a run has written: size and digest, in the ledger.

They show whether a file still stands.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from ..folder.ledger import Claim

CHUNK_BYTES = 1 << 20  # bytes read at once: a file of any size is digested in little memory
SQLITE = b"SQLite format 3\0"
# bytes of an SQLite file's head that change when a viewer opens it: how it is locked, and counters
# of that
RESTLESS = ((18, 20), (24, 28), (92, 100))


def claims(files: Iterable[Path], out: Path) -> list[Claim]:
    """Return the record of each of `files` of a run in `out`."""
    return [
        Claim(file.relative_to(out).as_posix(), file.stat().st_size, digest(file)) for file in files
    ]


def broken_claims(claims: Iterable[Claim], out: Path) -> list[str]:
    """Return the names of files that are missing or changed.

    Sizes are compared before digests.
    """
    return [claim.name for claim in claims if not stands(out / claim.name, claim)]


def stands(file: Path, claim: Claim) -> bool:
    try:
        return file.stat().st_size == claim.bytes and digest(file) == claim.digest
    except OSError:
        return False


def digest(file: Path) -> str:
    """Return the SHA-256 of a file's content."""
    sha = hashlib.sha256()
    with open(file, "rb") as content:
        head = bytearray(content.read(CHUNK_BYTES))
        if head.startswith(SQLITE):
            for start, end in RESTLESS:
                head[start:end] = bytes(end - start)
        sha.update(head)
        while chunk := content.read(CHUNK_BYTES):
            sha.update(chunk)
    return sha.hexdigest()
