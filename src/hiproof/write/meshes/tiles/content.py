"""A tile's file: binary glTF with one mesh of one primitive.

Its feature ids are rows of the table of its buildings: a class and a table of
EXT_structural_metadata, numbers as float64, all else as text. The extension knows no null: what is
unknown is `NO_NUMBER` or empty text, and the class says so. One class serves all tiles, so that a
style made for one works on every other.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from ....data_files import Values
from ...attribute_list import TABLES
from ...colours import linear_rgb
from ...naming import UniqueNames
from ..gltf import INDICES, GlbDocument, flat_triangles
from ..viewed import ViewedModel

EXTENSION = "EXT_structural_metadata"
CLASS = "building"
NO_NUMBER = -9999.0  # stands for what is not known, as GDAL's files use it; no attribute has it
WHOLE = 2**53  # a larger whole number would not survive as a decimal: it is told as text
DESCRIBED_TABLES = ("roofer", "hiproof", "osm", "enriched", "enriched_3dbag", "enriched_sun")
DESCRIPTIONS = {
    "id": "the building's id",
    "type": "roof type of the part that shows the largest area",
    "parameters": "the roof's parts with types, parameters, positions and rotations, as JSON (see "
    "docs/parameters.md)",
} | {
    table.prefix + a.name: f"{a.meaning} ({a.unit})" if a.unit else a.meaning
    for table in map(TABLES.__getitem__, DESCRIBED_TABLES)
    for a in table.attributes
}


class Property(NamedTuple):
    """A column: its `id` in the class, its attribute's `name`, whether it holds numbers."""

    id: str
    name: str
    is_number: bool


class Found:
    """The attributes met so far, and whether all values of each are numbers."""

    def __init__(self) -> None:
        self.are_numbers: dict[str, bool | None] = {}  # None of what had no value so far

    def add(self, values: Values) -> None:
        for name, value in values.items():
            was_number = self.are_numbers.setdefault(name, None)
            if value is not None:
                self.are_numbers[name] = was_number is not False and is_number(value)

    def properties(self) -> list[Property]:
        """Return the columns, named of letters, digits and underscores for the extension."""
        names = UniqueNames()
        return [
            Property(property_id(names, name), name, bool(kind))
            for name, kind in self.are_numbers.items()
        ]


def is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= WHOLE


def property_id(names: UniqueNames, name: str) -> str:
    """Return `name` without what an id forbids, unique among `names`."""
    plain = re.sub(r"\W", "_", name, flags=re.ASCII)
    return names.take(plain if re.match("[A-Za-z_]", plain) else f"_{plain}").replace("..", "_")


def make_schema(properties: Iterable[Property]) -> Values:
    """Return the schema: one class, a property a column."""
    kinds: dict[bool, Values] = {
        True: {"type": "SCALAR", "componentType": "FLOAT64", "noData": NO_NUMBER},
        False: {"type": "STRING", "noData": ""},
    }
    by_id = {
        p.id: {"name": p.name, "description": DESCRIPTIONS.get(p.name, "as given")}
        | kinds[p.is_number]
        for p in properties
    }
    return {"id": "hiproof", "classes": {CLASS: {"properties": by_id}}}


def add_column(document: GlbDocument, column: Property, values: list[Any]) -> Values:
    if column.is_number:
        numbers = np.array([NO_NUMBER if v is None else v for v in values], "<f8")
        return {"values": document.view(numbers.tobytes())}
    texts = [format_value(value).encode() for value in values]
    ends = np.cumsum([0, *map(len, texts)]).astype("<u4")
    return {
        # A view may not be empty, so that a column of empty texts holds one byte that none of them
        # uses.
        "values": document.view(b"".join(texts) or b"\0"),
        "stringOffsets": document.view(ends.tobytes()),
        "stringOffsetType": "UINT32",
    }


def format_value(value: Any) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


FEATURE_EXTENSION = "EXT_mesh_features"
PAINTED = {
    "name": "building",
    "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.9},
}


def tile_glb(
    meshes: Sequence[TileMesh], rows: Sequence[Values], properties: Sequence[Property]
) -> bytes:
    """Return the file of the buildings `meshes`.

    `rows` have their attributes by name. Coordinates are about the tile's middle, which the node's
    translation gives in float64, so that float32 is enough.
    """
    document = GlbDocument()
    corners = np.concatenate([mesh.corners for mesh in meshes])
    middle = np.round((corners.min(axis=0) + corners.max(axis=0)) / 2)
    document.tables |= {
        "extensionsUsed": [FEATURE_EXTENSION, EXTENSION],
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": middle.tolist()}],
        "meshes": [{"primitives": [primitive(document, meshes, corners - middle)]}],
        "materials": [PAINTED],
    }
    columns = {p.id: add_column(document, p, [row.get(p.name) for row in rows]) for p in properties}
    table = {"name": "buildings", "class": CLASS, "count": len(rows), "properties": columns}
    document.tables["extensions"] = {
        EXTENSION: {"schema": make_schema(properties), "propertyTables": [table]}
    }
    return document.to_bytes()


def primitive(document: GlbDocument, meshes: Sequence[TileMesh], corners: np.ndarray) -> Values:
    """Return all triangles as one primitive, shared corners of a face written once."""
    ids = np.repeat(np.arange(len(meshes)), [len(mesh.corners) for mesh in meshes])
    corner_table = np.zeros(
        len(corners),
        [("place", "<f4", 3), ("normal", "<f4", 3), ("colour", "u1", 4), ("id", "<f4")],
    )
    corner_table["place"], corner_table["id"] = corners, ids
    corner_table["normal"] = np.concatenate([mesh.normals for mesh in meshes])
    corner_table["colour"] = np.concatenate([mesh.colours for mesh in meshes])
    _, first, number = np.unique(
        corner_table.view(f"V{corner_table.itemsize}"), return_index=True, return_inverse=True
    )
    order = np.argsort(first)  # as they come, building by building
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    vertices, indices = corner_table[first[order]], place[number.ravel()]
    return {
        "attributes": {
            "POSITION": document.positions(vertices["place"]),
            "NORMAL": document.accessor(vertices["normal"]),
            "COLOR_0": document.accessor(vertices["colour"], normalized=True),
            "_FEATURE_ID_0": document.accessor(vertices["id"]),
        },
        "indices": document.accessor(
            indices.astype("<u2" if len(vertices) < 65535 else "<u4"), INDICES
        ),
        "material": 0,
        "extensions": {
            FEATURE_EXTENSION: {
                "featureIds": [
                    {
                        "label": "building",
                        "featureCount": len(meshes),
                        "attribute": 0,
                        "propertyTable": 0,
                    }
                ]
            }
        },
    }


@dataclass(frozen=True)
class TileMesh:
    """Corners (3 t, 3), y up, with `normals` (3 t, 3) and linear `colours` (3 t, 4)."""

    corners: np.ndarray
    normals: np.ndarray
    colours: np.ndarray

    @property
    def triangles(self) -> int:
        return len(self.corners) // 3

    def save(self, file: BinaryIO) -> None:
        for array in (self.corners, self.normals, self.colours):
            np.save(file, array, allow_pickle=False)

    @classmethod
    def load(cls, file: BinaryIO) -> TileMesh:
        """Load the mesh that `save` wrote where `file` stands now."""
        return cls(*(np.load(file, allow_pickle=False) for _ in range(3)))


def make_mesh(model: ViewedModel, vertices: np.ndarray) -> TileMesh:
    """Return a model's mesh; `vertices` (n, 3) are east, north, up of the tileset's frame."""
    corners, normals, colours = [], [], []
    for look, faces in model.faces_by_look().items():
        places, facing = flat_triangles(vertices, faces)
        corners.append(places)
        normals.append(facing)
        colours.append(
            np.tile(np.round(np.multiply([*linear_rgb(look.colour), 1.0], 255)), (len(places), 1))
        )
    return TileMesh(
        np.concatenate(corners),
        np.concatenate(normals).astype("<f4"),
        np.concatenate(colours).astype(np.uint8),
    )
