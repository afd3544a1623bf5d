"""3DM for Rhino and Grasshopper: meshes on layers by surface (needs rhino3dm).

Each building has a mesh of its walls, of its ground and of the roof of each part, named by its id
and in one group. A mesh keeps its identifier in all files. Roofs have the colours of their types.
Attributes are user texts of the meshes.

Coordinates are metres about an origin, because meshes are float32. The texts `origin` and `crs` of
the document place them.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import OutputError
from ...extras import import_extra
from ...model import CEILING, GROUND, ROOF, WALL, Face
from ..naming import PlacedNames, make_uuid
from .triangles import faces_triangles
from .viewed import ViewedModel, choose_look

RHINO_VERSION = 7  # of the file, which Rhino 7 and later open


def write_models(path: Path, buildings: Iterable[ViewedModel], crs: str | None = None) -> int:
    """Write `buildings` to `path`; returns how many.

    The file is made in memory. Raises InputError where rhino3dm is missing, OutputError when the
    file cannot be written.
    """
    from ..files import atomic

    rhino = import_extra("rhino3dm", "rhino", "3DM")
    document, count, origin = rhino.File3dm(), 0, np.zeros(3)
    document.Settings.ModelUnitSystem = rhino.UnitSystem.Meters
    layers = {kind: add_layer(rhino, document, kind) for kind in (ROOF, WALL, GROUND, CEILING)}
    keys = PlacedNames(crs)
    for model in buildings:
        if not count:
            origin = model.corner
        add_building(rhino, document, layers, model, origin, keys)
        count += 1
    document.Strings["origin"] = " ".join(f"{value:.0f}" for value in origin)
    document.Strings["crs"] = crs or ""
    with atomic(path) as temporary:
        if not document.Write(str(temporary), RHINO_VERSION):
            raise OutputError(
                f"expected to write {path}, but rhino3dm could not; choose a folder that can be "
                "written"
            )
    return count


def add_layer(rhino: Any, document: Any, kind: str) -> int:
    """Add the layer of a kind of surface; returns its number."""
    layer = rhino.Layer()
    layer.Name, layer.Id = kind, make_uuid("layer", kind)
    return document.Layers.Add(layer)


def add_building(
    rhino: Any,
    document: Any,
    layers: dict[str, int],
    model: ViewedModel,
    origin: np.ndarray,
    keys: PlacedNames,
) -> None:
    """Add the meshes of a building."""
    key = keys.take_at(model.id, model.solid.vertices)
    group = rhino.Group()
    group.Name, group.Id = model.id, make_uuid("group", key)
    document.Groups.Add(group)
    for (kind, part), faces in model.faces_by_element().items():
        attributes = rhino.ObjectAttributes()
        attributes.Id = make_uuid(kind, f"{key} {part}")
        attributes.Name, attributes.LayerIndex = model.id, layers[kind]
        attributes.AddToGroup(len(document.Groups) - 1)
        colour = choose_look(faces[0], model.part_types).colour
        attributes.ObjectColor = (*bytes.fromhex(colour[1:]), 255)
        attributes.ColorSource = rhino.ObjectColorSource.ColorFromObject
        for name, value in model.values.items():
            if value is not None:
                text = value if isinstance(value, str) else json.dumps(value)
                attributes.SetUserString(name, text)
        document.Objects.AddMesh(make_mesh(rhino, model, faces, origin), attributes)


def make_mesh(rhino: Any, model: ViewedModel, faces: list[Face], origin: np.ndarray) -> Any:
    """Make the mesh of some faces, which has only their vertices."""
    triangles = np.concatenate(faces_triangles(model.solid.vertices, faces))
    used, corners = np.unique(triangles, return_inverse=True)
    mesh = rhino.Mesh()
    for place in (model.solid.vertices[used] - origin).tolist():
        mesh.Vertices.Add(*place)
    for a, b, c in corners.reshape(-1, 3).tolist():
        mesh.Faces.AddFace(a, b, c)
    mesh.Normals.ComputeNormals()
    return mesh
