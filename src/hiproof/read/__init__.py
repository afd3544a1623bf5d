"""From files to values: point clouds, footprints, terrain, RoofN3D, models.

points        point clouds; `read_points`
    pointcloud    points of any kind of file, in chunks
    las           LAS, LAZ and COPC, checked against what their headers say
    las_header    whether what such a file says of itself is possible
    las_crs       the CRS that its records define
    runs          where the points of a file lie, run by run
    lax           LAStools' index beside a file
    ply           PLY files
    text          XYZ, CSV and the like, and which column holds what
outlines      building polygons; `read_footprints`
    footprints    footprints of any source
    attribute_columns  their attributes as they are declared; names in SQL
    vector_file   features of a vector file, by GDAL
    polygons      polygons put right, from WKB with surfaces in space
    database      footprints from PostGIS
    geoparquet    GeoParquet files, of which only the row groups around an extent are fetched
    overture      footprints of an Overture Maps release
terrain       how high the ground is; `read_terrain`
    raster        terrain models
    raster_checks whether a raster can be one, and in which unit it counts
models        models of other files
    cityjson      documents of CityJSON, vertices in place, and shells, every number checked
    damage        what becomes of a damaged building in a file of many
    solids        solids of CityJSON and CityGML as they stand
crs           reference systems and their units
    axes          what no roof can be built in is refused
    operations    which operation of PROJ lies between two of them, and how accurate it is
    positions     positions in a CRS: reprojected, doubted, described
roofn3d       the RoofN3D data set
remote        files by address
numbers       numbers in columns that people fill
names         names, units and codes that files use
plausible     what no input may say

Everything unreadable raises `errors.InputError` with one sentence; what was put right on the way is
said by `errors.InputWarning`. docs/libraries.md says why code stands here beside laspy and pyogrio.
The names below are imported when first used: GDAL costs a third of a second.
"""

from importlib import import_module
from typing import Any

_HOME = {
    **dict.fromkeys(
        ("read_points", "iter_points", "read_header", "PointFileHeader"), "points.pointcloud"
    ),
    **dict.fromkeys(("read_footprints", "footprint_crs"), "outlines.footprints"),
    **dict.fromkeys(("read_terrain", "Terrain", "TerrainChain"), "terrain"),
    **dict.fromkeys(("read_roofn3d", "read_roofn3d_labels", "RoofN3DRecord"), "roofn3d"),
    **dict.fromkeys(("same_horizontal", "combine", "parse_crs"), "crs"),
}
__all__ = sorted(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOME[name]}", __name__), name)


def __dir__() -> list[str]:
    return __all__
