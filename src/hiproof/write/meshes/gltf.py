"""Binary glTF 2.0 (`.glb`): one node a building.

Its id is the node's name, and its attributes are the node's `extras`.

Viewers compute in float32, so coordinates are given about an origin that `asset.extras` names.
glTF's y axis points up: east is x, north is -z.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...data_files import Values
from ...model import Face
from ..colours import linear_rgb
from .triangles import face_normals, faces_triangles
from .viewed import Look, ViewedModel

VERTICES, INDICES = 34962, 34963  # ARRAY_BUFFER and ELEMENT_ARRAY_BUFFER of WebGL, which glTF names
COMPONENT_TYPES = {"f4": 5126, "u4": 5125, "u2": 5123, "u1": 5121}
ACCESSOR_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
ALIGNED = 8  # bytes: what tables of properties ask for, and more than arrays of vertices do


class GlbDocument:
    """A glTF document that grows: its JSON in `tables`, its buffer by methods."""

    def __init__(self) -> None:
        asset = {"version": "2.0", "generator": "hiproof"}
        self.tables: Values = {"asset": asset, "scene": 0, "scenes": [{}]}
        self.chunks: list[bytes] = []
        self.size = 0

    def view(self, content: bytes, **table: Any) -> int:
        """Append `content` to the buffer; the index of its view."""
        views = self.tables.setdefault("bufferViews", [])
        views.append({"buffer": 0, "byteOffset": self.size, "byteLength": len(content), **table})
        self.chunks.append(content + b"\0" * (-len(content) % ALIGNED))
        self.size += len(self.chunks[-1])
        return len(views) - 1

    def accessor(self, values: np.ndarray, target: int = VERTICES, **table: Any) -> int:
        """Append `values` (n,) or (n, k), float32 or unsigned; returns their accessor's index."""
        accessors = self.tables.setdefault("accessors", [])
        view = self.view(np.ascontiguousarray(values).tobytes(), target=target)
        kind = {
            "componentType": COMPONENT_TYPES[values.dtype.str[1:]],
            "type": ACCESSOR_TYPES[1 if values.ndim == 1 else values.shape[1]],
        }
        accessors.append({"bufferView": view, "count": len(values), **kind, **table})
        return len(accessors) - 1

    def positions(self, places: np.ndarray) -> int:
        """Append `places` (n, 3) as float32 with bounds; return their accessor."""
        places = places.astype("<f4")
        return self.accessor(
            places, min=places.min(axis=0).tolist(), max=places.max(axis=0).tolist()
        )

    def to_bytes(self) -> bytes:
        """Return the file: header, JSON and binary chunks, padded to four bytes."""
        buffers = {"buffers": [{"byteLength": self.size}]} if self.size else {}
        text = json.dumps(self.tables | buffers, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        parts = [struct.pack("<II", len(text), 0x4E4F534A), text]
        if self.size:
            parts += [struct.pack("<II", self.size, 0x004E4942), *self.chunks]
        return struct.pack("<III", 0x46546C67, 2, 12 + sum(map(len, parts))) + b"".join(parts)


def turn_y_up(vectors: np.ndarray) -> np.ndarray:
    """Turn east, north, up to glTF's x, y, z: east is x, north is -z."""
    return np.column_stack([vectors[:, 0], vectors[:, 2], -vectors[:, 1]])


def write_models(path: Path, buildings: Iterable[ViewedModel], crs: str | None = None) -> int:
    """Write `buildings` to `path`; returns how many.

    `crs` is kept as text beside the origin, which is in metres too, whatever the unit of the CRS.
    Raises OutputError when the file cannot be written.
    """
    from ..files import atomic_file

    document, origin = GlbDocument(), np.zeros(3)
    nodes: list[Values] = []
    meshes: list[Values] = []
    materials: dict[Look, int] = {}
    for model in buildings:
        origin = origin if nodes else model.corner
        nodes.append({"name": model.id, "mesh": len(meshes), "extras": model.values})
        primitives = add_primitives(document, model, origin, materials)
        meshes.append({"name": model.id, "primitives": primitives})
    document.tables["asset"]["extras"] = {
        "origin": origin.tolist(),
        "unit": "metre",
        "crs": crs,
        "axes": "x east, y up, z south",
    }
    if nodes:
        document.tables["scenes"] = [{"nodes": list(range(len(nodes)))}]
        document.tables |= {"nodes": nodes, "meshes": meshes}
        document.tables["materials"] = [
            {
                "name": look.name,
                "pbrMetallicRoughness": {
                    "baseColorFactor": [*linear_rgb(look.colour), 1.0],
                    "metallicFactor": 0.0,
                    "roughnessFactor": 0.9,
                },
                "doubleSided": True,
            }
            for look in materials
        ]
    with atomic_file(path) as file:
        file.write(document.to_bytes())
    return len(nodes)


def add_primitives(
    document: GlbDocument, model: ViewedModel, origin: np.ndarray, materials: dict[Look, int]
) -> list[Values]:
    """Add a building to a document: primitives of roofs by type, walls and ground."""
    primitives = []
    for look, faces in model.faces_by_look().items():
        corners, normals = flat_triangles(model.solid.vertices - origin, faces)
        normal = document.accessor(normals.astype("<f4"))
        places = {"POSITION": document.positions(corners), "NORMAL": normal}
        material = materials.setdefault(look, len(materials))
        primitives.append({"attributes": places, "material": material})
    return primitives


def flat_triangles(vertices: np.ndarray, faces: Sequence[Face]) -> tuple[np.ndarray, np.ndarray]:
    """Return corners and normals (3 t, 3), y up, of the triangles of faces."""
    corners, normals = [np.empty((0, 3))], [np.empty((0, 3))]
    directions = face_normals(vertices, faces)
    for normal, triangles in zip(
        directions, faces_triangles(vertices, faces, directions), strict=True
    ):
        corners.append(vertices[triangles.ravel()])
        normals.append(np.tile(normal / max(np.linalg.norm(normal), 1e-12), (triangles.size, 1)))
    return turn_y_up(np.concatenate(corners)), turn_y_up(np.concatenate(normals))
