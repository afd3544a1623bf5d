"""Building footprints of an Overture Maps release.

Its STAC catalogue lists GeoParquet files with their boxes. Of each file only the row groups that
meet an extent are fetched.

Layout: a catalogue of releases, of which `latest` names one, holds a catalogue a release, that a
catalogue a theme, that a collection a type, and that an item a file
(https://docs.overturemaps.org/guides/).
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any
from urllib.parse import urljoin, urlsplit

import numpy as np
import shapely

from ...errors import InputError
from ..remote import choose_options
from .geoparquet import (
    geometries_in,
    geometry_column,
    import_fsspec,
    import_pyarrow,
    open_parquet,
    read_rows,
)

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
    """Read the document at an address or path; raises InputError where there is none."""
    fsspec = import_fsspec()
    for left in reversed(range(TRIES)):
        try:
            files, path = fsspec.core.url_to_fs(address, **choose_options(address))
            content = json.loads(files.cat_file(path))
            if not isinstance(content, dict):
                raise ValueError("no document")
            return Document(address, content)
        except Exception as error:  # each of fsspec's file systems raises errors of its own
            if not left or isinstance(error, FileNotFoundError | ImportError | ValueError):
                raise InputError(
                    f"expected a STAC catalogue at {address}, got: "
                    f"{str(error) or type(error).__name__}; check the address and the network"
                ) from error
            time.sleep(PAUSE_S)
    raise AssertionError("the last try returns or raises")


def items_meeting(collection: Document, extent: shapely.Geometry) -> list[Document]:
    """Return a collection's items, by id, whose boxes meet `extent` (longitude, latitude)."""
    with ThreadPoolExecutor(AT_ONCE) as pool:
        items = list(pool.map(read_document, collection.links("item")))
    met = [item for item in items if meets(item.content.get("bbox"), extent)]
    return sorted(met, key=lambda item: (str(item.content.get("id")), item.address))


def meets(box: Sequence[float] | None, extent: shapely.Geometry) -> bool:
    """Return whether an item's box (2D or 3D) meets `extent`; without one it does."""
    if not box:
        return True
    upper = box[len(box) // 2 :]
    return bool(shapely.intersects(shapely.box(*box[:2], *upper[:2]), extent))


def find_asset(item: Document, suffix: str) -> str:
    """Return the address of an item's file of that `suffix`, by HTTP first; else InputError."""
    assets = item.content.get("assets") or {}
    ways = [urljoin(item.address, asset.get("href") or "") for asset in assets.values()]
    ways = [way for way in ways if urlsplit(way).path.endswith(suffix)]
    if not ways:
        raise InputError(
            f"expected a file {suffix} among the assets of {item.address}, got "
            f"{', '.join(assets) or 'none'}; check the catalogue"
        )
    return min(ways, key=lambda way: not way.startswith(("http://", "https://")))


KEYWORD = "overture"  # what stands for the release in place of a file of footprints

THEME = "buildings"
# The theme of buildings and its types; the parts of a building lie inside its own outline.
TYPES = ("building", "building_part")

# What of a building goes with its outline; `building_id` is that of a part's building.
ATTRIBUTES = ("height", "min_height", "num_floors", "roof_shape", "building_id")

ATTRIBUTION = "© OpenStreetMap contributors, Overture Maps Foundation"


@dataclass(frozen=True)
class OvertureFootprints:
    """Outlines and attributes as Arrow's table, and their origin.

    The table has `id`, attributes and `geometry` as WKB in longitude and latitude, in the order of
    the ids. `note` is the origin, ready for JSON.
    """

    table: Any
    note: dict[str, Any]


def is_overture(source: Any) -> bool:
    """Return whether a footprint source stands for Overture's release."""
    return source == KEYWORD


def read_overture(
    catalogue: str, extent: shapely.Geometry, kind: str = TYPES[0]
) -> OvertureFootprints:
    """Read the footprints of a type that meet `extent`.

    `extent` is in longitude and latitude. Buildings under ground are left out. `catalogue` is the
    address of the catalogue of releases, the latest of which is read, or that of one release.
    Raises InputError where it cannot be read or has no footprints there.
    """
    import_pyarrow()
    release, collection = find_collection(catalogue, kind)
    items = items_meeting(collection, extent)
    tables = [read_file(find_asset(item, ".parquet"), extent) for item in items]
    if not sum(map(len, tables)):
        raise InputError(
            f"expected footprints of Overture's type {kind} in the extent of the clouds "
            f"({', '.join(f'{side:.5f}' for side in extent.bounds)} in degrees), got none; check "
            "the CRS of the clouds, or leave --footprints out"
        )
    table = joined(tables)
    note = {
        "name": "Overture Maps",
        "release": release,
        "type": kind,
        "licence": collection.content.get("license") or "ODbL-1.0",
        "attribution": ATTRIBUTION,
        "catalogue": catalogue,
        "footprints": len(table),
        "sources": summarise_sources(table),
    }
    return OvertureFootprints(table.drop_columns(["sources"]), note)


def find_collection(catalogue: str, kind: str) -> tuple[str, Document]:
    """Return the latest release a catalogue names, or itself, and its collection of a type."""
    document = read_document(catalogue)
    releases = document.children()
    if THEME not in releases:
        latest = document.content.get("latest") or max(releases, default="")
        document = find_child(document, str(latest))
    release = document.content.get("release:version") or document.content.get("id")
    return str(release), find_child(find_child(document, THEME), kind)


def find_child(document: Document, name: str) -> Document:
    """Return a document's child in the folder `name`; raises InputError without one."""
    children = document.children()
    if name not in children:
        raise InputError(
            f"expected {name!r} in Overture's catalogue {document.address}, got "
            f"{', '.join(children) or 'no links'}; check the setting read.overture_catalogue"
        )
    return read_document(children[name])


def read_file(address: str, extent: shapely.Geometry) -> Any:
    """Return the rows of a release's file that meet `extent` above ground."""
    import pyarrow
    from pyarrow import compute

    with open_parquet(address) as file:
        column = geometry_column(file, address)
        own = file.schema_arrow.names
        names = [n for n in ("id", *ATTRIBUTES, "is_underground", "sources") if n in own]
        table, _ = read_rows(file, column, names, extent)
    geometries = geometries_in(table, column)
    met = shapely.intersects(geometries, extent)
    if "is_underground" in names:
        met &= ~compute.fill_null(table.column("is_underground"), False).to_numpy()
        table = table.drop_columns(["is_underground"])
    wkb = shapely.to_wkb(shapely.force_2d(geometries[met]))
    table = table.take(np.flatnonzero(met)).drop_columns([column.name])
    return table.append_column("geometry", pyarrow.array(wkb.tolist(), pyarrow.binary()))


def joined(tables: list[Any]) -> Any:
    """Join all rows in the order of their ids, whichever file holds them."""
    import pyarrow

    table = pyarrow.concat_tables(tables, promote_options="default")
    if "sources" not in table.column_names:
        table = table.append_column("sources", pyarrow.nulls(len(table)))
    return table.sort_by("id")


def summarise_sources(table: Any) -> list[dict[str, Any]]:
    """Count a table's rows by data set, with licences where the release names them."""
    counts: Counter[tuple[str, str | None]] = Counter()
    for sources in table.column("sources").to_pylist():
        found = {(str(one.get("dataset")), one.get("license")) for one in sources or ()}
        counts.update(found)
    return [
        {"dataset": dataset, "licence": licence, "footprints": counts[dataset, licence]}
        for dataset, licence in sorted(counts, key=lambda found: (found[0], found[1] or ""))
    ]
