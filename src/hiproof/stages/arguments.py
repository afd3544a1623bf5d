"""What `reconstruct` refuses before it begins."""

from __future__ import annotations

import shapely

from ..errors import InputError
from ..model import Footprint
from ..settings import Settings
from .recognise import asks_network


def refuse_other_kinds(footprint: object, terrain: object, settings: object) -> None:
    """Raise InputError for arguments of another kind, by their names, whatever they hold."""
    if footprint is not None and not isinstance(footprint, (shapely.Geometry, Footprint)):
        raise InputError(
            f"expected a polygon of shapely as footprint, got {type(footprint).__name__}; make a "
            "shapely.Polygon of it"
        )
    if settings is not None and not isinstance(settings, Settings):
        raise InputError(
            f"expected hiproof.Settings as settings, got {type(settings).__name__}; make them by "
            "Settings.from_dict"
        )
    if terrain is not None and not hasattr(terrain, "height_at"):
        raise InputError(
            f"expected a terrain that answers height_at, got {type(terrain).__name__}; read a "
            "raster by hiproof.read_terrain"
        )


def refuse_without_network(settings: Settings) -> None:
    """Raise InputError where the network is to be asked and cannot be.

    Evidence alone names other types, and builds other roofs, in some buildings: what is installed
    must not decide that unsaid, so who wants it has to say so.
    """
    if asks_network(settings):
        from ..segment.inference import import_onnxruntime

        import_onnxruntime(alternative="--network never to go by the points alone")
