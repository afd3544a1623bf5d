"""The container of binary glTF 2.0: JSON tables, and one binary buffer."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

VERTICES, INDICES = 34962, 34963  # ARRAY_BUFFER and ELEMENT_ARRAY_BUFFER of WebGL, which glTF names
COMPONENT_TYPES = {"f4": 5126, "u4": 5125, "u2": 5123, "u1": 5121}
ACCESSOR_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
ALIGNED = 8  # bytes: what tables of properties ask for, and more than arrays of vertices do


class GlbDocument:
    """A glTF document that grows.

    `tables` are its JSON; views and accessors are added by the methods that fill the buffer.
    """

    def __init__(self) -> None:
        asset = {"version": "2.0", "generator": "hiproof"}
        self.tables: dict[str, Any] = {"asset": asset, "scene": 0, "scenes": [{}]}
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
        """Append `values`, and return the index of their accessor.

        They are (n,) or (n, k) of float32 or unsigned integers, little-endian.
        """
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
        """Return the whole file: header, JSON chunk, binary chunk.

        Each is padded to four bytes.
        """
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
