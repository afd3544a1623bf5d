"""From files to values: point clouds, footprints, terrain, RoofN3D, models.

`read_points` and `read_footprints` give what a run starts from; `points_of_footprints` brings the two together, a
terrain answers how high the ground is. Everything
unreadable raises `errors.InputError` with one sentence; what was put right on the way is said by `errors.InputWarning`.
The names below are imported when first used: GDAL and laspy cost a third of a second.
"""

from importlib import import_module
from typing import Any

_HOME = {
    **dict.fromkeys(("read_points", "iter_points", "read_header", "PointFileHeader"), "pointcloud"),
    **dict.fromkeys(("read_footprints", "footprint_crs"), "footprints"),
    "check_overlap": "overlap",
    **dict.fromkeys(("points_of_footprints", "PointGrid"), "assign"),
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
