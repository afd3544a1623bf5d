"""A tile's file: binary glTF with one mesh of one primitive.

Its feature ids are rows of the table of its buildings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

from ...colours import linear_rgb
from ..gltf import INDICES, GlbDocument, flat_triangles
from ..viewed import ViewedModel
from .properties import EXTENSION, Property, add_table, make_schema

FEATURE_EXTENSION = "EXT_mesh_features"
PAINTED = {
    "name": "building",
    "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.9},
}


def tile_glb(
    meshes: Sequence[TileMesh], rows: Sequence[dict[str, Any]], properties: Sequence[Property]
) -> bytes:
    """Return the file of the buildings `meshes`.

    `rows` have their attributes by name.

    Coordinates are about the tile's middle, which the node's translation gives in float64, so that
    float32 is enough.
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
    table = add_table(document, properties, rows)
    document.tables["extensions"] = {
        EXTENSION: {"schema": make_schema(properties), "propertyTables": [table]}
    }
    return document.to_bytes()


def primitive(
    document: GlbDocument, meshes: Sequence[TileMesh], corners: np.ndarray
) -> dict[str, Any]:
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
