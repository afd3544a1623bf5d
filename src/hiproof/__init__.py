"""hiproof: HolIstic Parametric ROOFs.

Airborne LiDAR point clouds into watertight, semantic LoD2 building models.

    import hiproof
    fit = hiproof.fit_roof(points)                       # one primitive, all points
    building = hiproof.reconstruct(points, footprint)    # a valid solid, with status and quality

The names below are imported when they are first used, so that `import hiproof` and the command line
start at once.
"""

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

from . import early  # first, so that Ctrl-C while the rest is imported ends the command quietly  # noqa: F401

if TYPE_CHECKING:
    from .method import reconstruct as reconstruct

__version__ = "0.1.0"

_HOME = {
    name: module
    for module, names in {
        "parametric": "build read_parameters",
        "draw.plot": "plot",
        "draw.objects": "to_geodataframe",
        "parametric.finished": "open_run Run",
        "method": "reconstruct",
        "city.run": "reconstruct_area Summary",
        "city.request": "Request",
        "fit": "fit_roof",
        "fit.roof": "fit_building",
        "compose": "check_solid Finding",
        "read": "read_points read_footprints read_terrain",
        "read.models.solids": "read_solids",
        "write": "write_citygml write_cityjson write_parameters write_attributes",
        "model": "Building Face Fit Footprint Model Part Piece PointCloud Roof Solid Quality",
        "fit.outcome": "BuildingFit",
        "frames": "LocalFrame Units",
        "settings": "Settings",
        "status": "Grade Status",
        "errors": "HiproofError InputError NoModelError SettingsError OutputError FitError "
        "CompositionError HiproofWarning InputWarning NotKeptWarning OutputWarning",
        "read.terrain": "Terrain",
    }.items()
    for name in names.split()
}

__all__ = ["__version__", *sorted(_HOME)]


def __getattr__(name: str) -> Any:
    """Import a public name from its module when it is first asked for (PEP 562)."""
    if name == "learn":  # whose names are under its own
        return import_module(".learn", __name__)
    if name not in _HOME:
        raise AttributeError(f"module 'hiproof' has no attribute {name!r}")
    value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def _import_when_called(module: str, name: str) -> Callable[..., Any]:
    """Return a function that imports `name` from `module` when it is first called."""

    def call(*args: Any, **kwargs: Any) -> Any:
        return getattr(import_module(f".{module}", __name__), name)(*args, **kwargs)

    return call


# Functions that methods of `model.Building` call, from packages that stand above `model`.
METHODS = {
    name: _import_when_called(module, name)
    for name, module in {
        "with_part": "parametric.edit",
        "without_part": "parametric.edit",
        "refit": "parametric.refit",
        "render_building": "draw.html",
        "to_pyvista": "draw.objects",
        "to_trimesh": "draw.objects",
    }.items()
}


def __dir__() -> list[str]:
    return list(__all__)
