"""What `reconstruct` refuses before it begins."""

from __future__ import annotations

import shapely

from ..errors import InputError
from ..model import Footprint
from ..settings import Settings
from .recognise import asks_network


def refuse_other_kinds(footprint: object, terrain: object, settings: object) -> None:
    """Raise InputError for arguments of another kind, by their names, whatever they hold."""
    for value, is_of_kind, kind, advice in (
        (
            footprint,
            isinstance(footprint, (shapely.Geometry, Footprint)),
            "a polygon of shapely as footprint",
            "make a shapely.Polygon of it",
        ),
        (
            settings,
            isinstance(settings, Settings),
            "hiproof.Settings as settings",
            "make them by Settings.from_dict",
        ),
        (
            terrain,
            hasattr(terrain, "height_at"),
            "a terrain that answers height_at",
            "read a raster by hiproof.read_terrain",
        ),
    ):
        if value is not None and not is_of_kind:
            raise InputError(f"expected {kind}, got {type(value).__name__}; {advice}")


def refuse_without_network(settings: Settings) -> None:
    """Raise InputError where the network is to be asked and cannot be.

    Evidence alone names other types, and builds other roofs, in some buildings: what is installed
    must not decide that unsaid, so who wants it has to say so.
    """
    if asks_network(settings):
        from ..segment.inference import import_onnxruntime

        import_onnxruntime(alternative="--network never to go by the points alone")
