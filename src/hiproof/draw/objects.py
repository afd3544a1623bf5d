"""Buildings as objects of other packages: meshes of trimesh and pyvista, geopandas' tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import shapely

from ..extras import import_extra
from ..model import Building
from ..parametric.finished import Run
from ..write.building_attributes import measure_figures
from ..write.colours import srgb
from ..write.fragments import Sheet, describe
from ..write.head import FileHead
from ..write.meshes.triangles import faces_triangles
from ..write.naming import plan_wkt
from ..write.tables.rows import building_row
from .view import list_colours

OPAQUE = 255  # of a colour's bytes


def to_trimesh(building: Building) -> Any:
    """Return the solid as a closed trimesh.Trimesh in world coordinates.

    Its faces are coloured by roof type, and its `metadata` hold the id and the roof type. Raises
    NoModelError without a model, InputError where trimesh (extra `trimesh`) is missing.
    """
    trimesh = import_extra("trimesh", "trimesh", "meshes")
    triangles, face_of = triangulate(building)
    colours = [[round(OPAQUE * value) for value in srgb(c)] for c in list_colours(building)]
    return trimesh.Trimesh(
        building.solid.vertices,
        triangles,
        face_colors=np.array([[*colours[face], OPAQUE] for face in face_of], np.uint8),
        metadata={"id": building.id, "type": building.type},
        process=False,
    )


def to_pyvista(building: Building) -> Any:
    """Return the solid as a pyvista.PolyData in world coordinates.

    Its cells say the `kind` of face and the roof's `part`, -1 beside the roof. Raises NoModelError
    without a model, InputError where pyvista (extra `pyvista`) is missing.
    """
    pyvista = import_extra("pyvista", "pyvista", "meshes")
    triangles, face_of = triangulate(building)
    cells = np.column_stack([np.full(len(triangles), 3), triangles])
    mesh = pyvista.PolyData(building.solid.vertices, cells.ravel())
    faces = [building.solid.faces[face] for face in face_of]
    mesh.cell_data["kind"] = np.array([face.kind for face in faces])
    mesh.cell_data["part"] = np.array([face.part for face in faces])
    return mesh


def triangulate(building: Building) -> tuple[np.ndarray, np.ndarray]:
    """Return triangles (t, 3) of the solid's vertices, and the face (t,) of each."""
    solid = building.solid
    triangles = faces_triangles(solid.vertices, solid.faces)
    face_of = np.repeat(np.arange(len(triangles)), [len(tiles) for tiles in triangles])
    return np.concatenate(triangles), face_of


def to_geodataframe(models: Run | Building | Iterable[Building], crs: Any = None) -> Any:
    """Return outlines with all attributes as a geopandas.GeoDataFrame.

    Its columns are those of the layer `buildings` of the GeoPackage. `crs` is that of buildings
    (anything pyproj understands); a run has its own. Raises InputError where geopandas (extra
    `geopandas`) is missing.
    """
    geopandas = import_extra("geopandas", "geopandas", "data frames")
    head = models.head if isinstance(models, Run) else FileHead(crs)
    rows = [
        building_row(sheet.building, sheet.attributes, head.units.table)
        for sheet in describe_models(models, head)
    ]
    geometry = shapely.from_wkb(np.array([wkb for wkb, _ in rows], dtype=object))
    values = [row for _, row in rows]
    return geopandas.GeoDataFrame(values, geometry=geometry, crs=plan_wkt(head.crs_of_files))


def describe_models(models: Run | Building | Iterable[Building], head: FileHead) -> Iterator[Sheet]:
    """Yield buildings with their attributes."""
    if isinstance(models, Run):
        yield from models.describe()
        return
    for building in [models] if isinstance(models, Building) else models:
        yield describe(building, measure_figures(building), head)
