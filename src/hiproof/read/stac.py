"""Static STAC catalogues: linked documents of JSON (https://stacspec.org)."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any
from urllib.parse import urljoin, urlsplit

import shapely

from ..errors import InputError
from .geoparquet import import_fsspec
from .remote import choose_options

TRIES = 3  # of a document: of hundreds of requests a server closes one now and then
PAUSE_S = 0.5  # s between two of them
AT_ONCE = 16  # documents: their answers are short, so that waiting takes nearly all the time


@dataclass(frozen=True)
class Document:
    """A catalogue, collection or item, and the address from which its links are meant."""

    address: str
    content: dict[str, Any]

    def links(self, relation: str) -> list[str]:
        """Return the addresses of the documents in this `relation` to it."""
        found = [link for link in self.content.get("links") or [] if link.get("rel") == relation]
        return [urljoin(self.address, link["href"]) for link in found if link.get("href")]

    def children(self) -> dict[str, str]:
        """Return the addresses of its children by the name of their folders."""
        return {PurePosixPath(urlsplit(way).path).parent.name: way for way in self.links("child")}


def read_document(address: str) -> Document:
    """Read the document at an address or a path.

    Raises InputError where none can be read there.
    """
    fsspec = import_fsspec()
    for left in reversed(range(TRIES)):
        try:
            files, path = fsspec.core.url_to_fs(address, **choose_options(address))
            content = json.loads(files.cat_file(path))
            if not isinstance(content, dict):
                raise ValueError("no document")
            return Document(address, content)
        except (FileNotFoundError, ImportError, ValueError) as error:
            raise unreadable(address, error) from error
        except Exception as error:  # each of fsspec's file systems raises errors of its own
            if not left:
                raise unreadable(address, error) from error
            time.sleep(PAUSE_S)
    raise AssertionError("the last try returns or raises")


def unreadable(address: str, error: Exception) -> InputError:
    """Make the error for a document that cannot be read."""
    return InputError(
        f"expected a STAC catalogue at {address}, got: {str(error) or type(error).__name__}; check "
        "the address and the network"
    )


def items_meeting(collection: Document, extent: shapely.Geometry) -> list[Document]:
    """Return the items of a collection whose boxes meet `extent`, by their ids.

    `extent` is in longitude and latitude.
    """
    with ThreadPoolExecutor(AT_ONCE) as pool:
        items = list(pool.map(read_document, collection.links("item")))
    met = [item for item in items if meets(item.content.get("bbox"), extent)]
    return sorted(met, key=lambda item: (str(item.content.get("id")), item.address))


def meets(box: Sequence[float] | None, extent: shapely.Geometry) -> bool:
    """Return whether a box of an item meets `extent`.

    It has two or three dimensions. An item without a box meets any.
    """
    if not box:
        return True
    half = len(box) // 2
    return bool(shapely.intersects(shapely.box(*box[:2], *box[half : half + 2]), extent))


def find_asset(item: Document, suffix: str) -> str:
    """Return the address of an item's file whose name ends in `suffix`.

    One by HTTP comes before others.

    Raises InputError where it lists none.
    """
    assets = item.content.get("assets") or {}
    ways = [urljoin(item.address, asset.get("href") or "") for asset in assets.values()]
    ways = [way for way in ways if urlsplit(way).path.endswith(suffix)]
    if not ways:
        raise InputError(
            f"expected a file {suffix} among the assets of {item.address}, got "
            f"{', '.join(assets) or 'none'}; check the catalogue"
        )
    return min(ways, key=lambda way: not way.startswith(("http://", "https://")))
