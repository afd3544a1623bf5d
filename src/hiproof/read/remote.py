"""Files by address (http, https, s3, gs, ...), in ranges where servers can, through fsspec."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, BinaryIO

from ..errors import InputError
from ..extras import import_extra
from ..masking import remember

BLOCK_BYTES = 1 << 20  # bytes a request; a server's answer takes longer than a megabyte's way
SILENCE_S = 60.0  # s that a server may be silent; fsspec waits for five minutes in all
FilePath = str | Path  # of this machine, or an address


def is_url(path: FilePath) -> bool:
    """Return whether `path` is an address rather than a file of this machine.

    >>> is_url("https://example.org/tile.laz"), is_url("tiles/a.laz")
    (True, False)
    """
    return "://" in str(path)


def locate(path: FilePath) -> str:
    """Return an address as it is, and of a file the place to which all links to it lead."""
    return str(path) if is_url(path) else str(Path(path).resolve())


def open_binary(path: FilePath, expected: str = "a point cloud", **reading: Any) -> BinaryIO:
    """Open a seekable binary file at a path or an address.

    `reading` are options of fsspec's files. Raises InputError, which says what was `expected`,
    where an address cannot be opened.
    """
    if not is_url(path):
        return Path(path).open("rb")
    url, fsspec = str(path), import_fsspec()
    remember(url)
    try:
        # buffered once more: fsspec's own files read lines of any length only
        options = {"block_size": BLOCK_BYTES, **reading, **choose_options(url)}
        return io.BufferedReader(fsspec.open(url, "rb", **options).open())
    except ImportError as error:
        raise InputError(
            f"expected what fsspec needs to open {url}, got: {error}; install it"
        ) from error
    except Exception as error:  # each of fsspec's file systems raises errors of its own
        # of what it cannot reach fsspec itself tells the address alone
        cause = error.__cause__ or error
        raise InputError(
            f"expected {expected} at {url}, got: {str(cause) or type(cause).__name__}; check it"
        ) from error


def choose_options(url: str) -> dict[str, Any]:
    """Return the options of fsspec's file system for an address."""
    if not url.lower().startswith(("http://", "https://")):
        return {}
    from aiohttp import ClientTimeout

    timeout = ClientTimeout(total=None, sock_connect=SILENCE_S, sock_read=SILENCE_S)
    return {"client_kwargs": {"timeout": timeout}}


def import_fsspec() -> Any:
    """Import fsspec. Raises InputError where it is missing."""
    return import_extra("fsspec", "city", "files by address")
