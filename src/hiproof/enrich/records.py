"""The buildings of a parameters.jsonl, read one by one in any order.

An index has the place of every building in the file and in plan, some 50 bytes a building. Models
are composed when they are needed, and the last MOST_KEPT stay in memory: a street, not the city.
"""

from __future__ import annotations

import functools
from array import array
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely

from ..errors import HiproofError, InputError
from ..masking import mask
from ..model import Building
from ..parametric.building import build
from ..parametric.file import locate_parameters, opened_parameters, read_at
from ..status import Status
from ..write.head import FileHead
from ..write.naming import UniqueNames, gml_name
from ..write.run_files import measure_or_drop_solid
from ..write.values import plain_text

# Depth (m) of the border of a run: a house next door that the run lacks would stand within it.
BORDER_M = 10.0
MOST_KEPT = 2000  # composed buildings kept in memory, at some 20 kB each
NOWHERE = (np.nan,) * 4  # box of a building whose outline cannot be read


class Index(NamedTuple):
    """Where the buildings of a file are, in its order.

    `offsets` (n,) are their places in the file in bytes, `boxes` (n, 4) those of their outlines in
    plan, `modelled` (n,) whether they have a model. `gml_names` has the names of those in `renamed`
    whose gml:id another building has taken. `attributes` are the names of all attributes, `uses`
    the uses that buildings have.
    """

    offsets: np.ndarray
    boxes: np.ndarray
    modelled: np.ndarray
    renamed: np.ndarray
    gml_names: np.ndarray
    attributes: np.ndarray
    uses: np.ndarray


def index_records(path: Path, use_attribute: str = "") -> Index:
    """Read the index of a parameters.jsonl; InputError for broken lines and repeated ids.

    `use_attribute` is the one that has the use of a building, "" where none has.
    """
    offsets, boxes, modelled = array("q"), array("d"), array("b")
    ids: set[str] = set()
    attributes: dict[str, None] = {}
    uses: dict[str, None] = {}
    names, renamed = UniqueNames(), {}
    with locate_parameters(path) as (_, located):
        for place, record in located:
            id = plain_text(record["id"])
            if id in ids:
                raise InputError(
                    f"expected buildings of different ids in {path}, got {id!r} twice; give one "
                    "another"
                )
            ids.add(id)
            if isinstance(record.get("attributes"), dict):
                attributes.update(dict.fromkeys(record["attributes"]))
                uses[str(record["attributes"].get(use_attribute) or "")] = None
            name = names.take(gml_name(record["id"]))
            if name != gml_name(record["id"]):
                renamed[len(offsets)] = name
            offsets.append(place)
            boxes.extend(find_box(record))
            modelled.append(bool(record.get("parts")))
    return Index(
        np.array(offsets, np.int64),
        np.array(boxes, float).reshape(-1, 4),
        np.array(modelled, bool),
        np.array(list(renamed), np.int64),
        np.array(list(renamed.values()), str),
        np.array(list(attributes), str),
        np.array(list(uses), str),
    )


def find_box(record: dict[str, Any]) -> tuple[float, ...]:
    """Return the box of a building's outline in plan, NOWHERE without one."""
    try:
        ring = np.array(record["outline"][0], float)
        origin = np.array((record.get("origin") or (0, 0, 0))[:2], float)
        low, high = ring.min(axis=0) + origin, ring.max(axis=0) + origin
        return (*low.tolist(), *high.tolist()) if np.isfinite([low, high]).all() else NOWHERE
    except (TypeError, ValueError, KeyError, IndexError):
        return NOWHERE


class Records:
    """The buildings of a parameters.jsonl by number, in the file's order."""

    def __init__(self, path: Path, index: Index) -> None:
        self.path, self.index = path, index
        with opened_parameters(path) as (head, _):
            self.head: FileHead = head
        self.tree = shapely.STRtree(
            [shapely.Point() if np.isnan(b[0]) else shapely.box(*b) for b in index.boxes]
        )
        corners = shapely.multipoints(index.boxes[np.isfinite(index.boxes[:, 0])].reshape(-1, 2))
        self.inside = shapely.buffer(shapely.convex_hull(corners), -BORDER_M)
        self.read = functools.lru_cache(MOST_KEPT)(self.compose)

    def __len__(self) -> int:
        return len(self.index.offsets)

    def compose(self, number: int) -> Building:
        """Read and compose building `number`, without a model and with a detail if it fails."""
        record = read_at(self.path, int(self.index.offsets[number]))
        try:
            return measure_or_drop_solid(build(record, self.head.compose))[0]
        except HiproofError as error:
            return Building(record["id"], Status.NOT_BUILT, mask(str(error)))

    def is_at_border(self, number: int) -> bool:
        """Return whether a building lies within BORDER_M of the hull of all outlines' boxes."""
        box = self.index.boxes[number]
        return bool(np.isnan(box[0])) or not self.inside.contains(shapely.box(*box))

    def find_near(self, number: int, reach_m: float) -> list[int]:
        """Return the buildings, in order, whose boxes are within `reach_m` of that of `number`."""
        low_x, low_y, high_x, high_y = self.index.boxes[number]
        if np.isnan(low_x):
            return []
        box = shapely.box(low_x - reach_m, low_y - reach_m, high_x + reach_m, high_y + reach_m)
        return [int(k) for k in np.sort(self.tree.query(box)) if k != number]

    def name_in_gml(self, number: int) -> str:
        """Return the name that ends the gml:ids of building `number`."""
        found = np.flatnonzero(self.index.renamed == number)
        name = gml_name(self.read(number).id)
        return str(self.index.gml_names[found[0]]) if len(found) else name
