"""Binary STL: the triangles of all buildings, for printing and meshing.

STL holds nothing but triangles. Coordinates are metres about an origin that its header names,
because they are float32. z points up.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from .triangles import faces_triangles
from .viewed import ViewedModel

STL_HEADER_BYTES = 80  # of free text, which the format fixes
STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("colour", "<u2")])


def write_models(path: Path, buildings: Iterable[ViewedModel], crs: str | None = None) -> int:
    """Write `buildings` to `path`; returns how many.

    Neither ids nor `crs` have a place in STL. Raises OutputError when the file cannot be written.
    """
    from ..files import atomic_file

    count, triangles, origin = 0, 0, np.zeros(3)
    with atomic_file(path) as file:
        file.write(bytes(STL_HEADER_BYTES + 4))
        for model in buildings:
            if not count:
                origin = model.corner
            rows = solid_triangles(model, origin)
            file.write(rows.tobytes())
            triangles, count = triangles + len(rows), count + 1
        file.seek(0)
        file.write(header(origin) + struct.pack("<I", triangles))
    return count


def header(origin: np.ndarray) -> bytes:
    text = f"hiproof; metres about {' '.join(f'{value:.0f}' for value in origin)}"
    return text.encode().ljust(STL_HEADER_BYTES)[:STL_HEADER_BYTES]


def solid_triangles(model: ViewedModel, origin: np.ndarray) -> np.ndarray:
    """Return the triangles (t,) of a model about `origin` (3,) with unit normals."""
    solid = model.solid
    triangles = np.concatenate(faces_triangles(solid.vertices, solid.faces))
    corners = (solid.vertices - origin)[triangles]
    rows = np.zeros(len(corners), STL_TRIANGLE)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rows["normal"] = normals / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    rows["corners"] = corners
    return rows
