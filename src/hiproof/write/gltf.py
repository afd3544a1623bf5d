"""Binary glTF 2.0 (`.glb`): one node a building, its id the node's name, its attributes the node's `extras`.

Viewers compute in float32, so coordinates are given about an origin that `asset.extras` names. glTF's y axis points up:
east is x, north is -z.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ..model import GROUND, ROOF, WALL, Solid
from .colours import GROUND_COLOUR, WALL_COLOUR, linear_rgb, type_colour
from .glb import GlbDocument, y_up
from .triangles import face_normals, faces_triangles


def write_models(
    path: Path, buildings: Iterable[tuple[str, str, Solid, dict[str, Any]]], crs: str | None = None
) -> int:
    """Write `buildings` (id, roof type, solid in world metres, attributes) to `path`; returns how many.

    `crs` is kept as text beside the origin, which is in metres too, whatever the unit of the CRS. Raises OutputError when the file cannot be written.
    """
    from .files import atomic_file

    content = GlbContent()
    for id, roof_type, solid, attributes in buildings:
        content.add(id, roof_type, solid, attributes)
    with atomic_file(path) as file:
        file.write(content.to_bytes(crs))
    return len(content.nodes)


class GlbContent:
    """The document as it grows, a node a building."""

    def __init__(self) -> None:
        self.document = GlbDocument()
        self.nodes: list[dict[str, Any]] = []
        self.meshes: list[dict[str, Any]] = []
        self.materials: dict[str, int] = {}
        self.origin: np.ndarray | None = None

    def add(self, id: str, roof_type: str, solid: Solid, attributes: dict[str, Any]) -> None:
        """One building: a primitive for its roof, its walls and its ground each."""
        if self.origin is None:
            self.origin = np.floor(solid.vertices.min(axis=0))
        primitives = []
        for kind, colour in surface_colours(roof_type).items():
            corners, normals = flat_triangles(solid, kind, self.origin)
            if len(corners):
                name = f"roof {roof_type}" if kind == ROOF else kind
                normal = self.document.accessor(normals.astype("<f4"))
                places = {"POSITION": self.document.positions(corners), "NORMAL": normal}
                primitives.append({"attributes": places, "material": self.material(name, colour)})
        extras = {"id": id, "roof_type": roof_type, **attributes}
        self.nodes.append({"name": id, "mesh": len(self.meshes), "extras": extras})
        self.meshes.append({"name": id, "primitives": primitives})

    def material(self, name: str, colour: str) -> int:
        return self.materials.setdefault(f"{name}|{colour}", len(self.materials))

    def to_bytes(self, crs: str | None) -> bytes:
        """The whole file."""
        origin = (np.zeros(3) if self.origin is None else self.origin).tolist()
        tables = self.document.tables
        tables["asset"]["extras"] = {"origin": origin, "unit": "metre", "crs": crs, "axes": "x east, y up, z south"}
        if self.nodes:
            tables["scenes"] = [{"nodes": list(range(len(self.nodes)))}]
            tables |= {"nodes": self.nodes, "meshes": self.meshes}
            tables["materials"] = [material_table(key) for key in self.materials]
        return self.document.to_bytes()


def surface_colours(roof_type: str) -> dict[str, str]:
    """The colour of each kind of face of a building."""
    return {ROOF: type_colour(roof_type), WALL: WALL_COLOUR, GROUND: GROUND_COLOUR}


def material_table(key: str) -> dict[str, Any]:
    name, colour = key.rsplit("|", 1)
    surface = {"baseColorFactor": [*linear_rgb(colour), 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.9}
    return {"name": name, "pbrMetallicRoughness": surface, "doubleSided": True}


def flat_triangles(solid: Solid, kind: str, origin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (3 t, 3) and face normals (3 t, 3) of the triangles of one kind of face, y up, about `origin`."""
    corners, normals = [np.empty((0, 3))], [np.empty((0, 3))]
    faces = solid.of_kind(kind)
    directions = face_normals(solid.vertices, faces)
    for normal, triangles in zip(directions, faces_triangles(solid.vertices, faces, directions), strict=True):
        corners.append(solid.vertices[triangles.ravel()] - origin)
        normals.append(np.tile(normal / max(np.linalg.norm(normal), 1e-12), (triangles.size, 1)))
    return y_up(np.concatenate(corners)), y_up(np.concatenate(normals))
