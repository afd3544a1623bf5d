"""The building to start from, and its footprint moved onto its points."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import shapely

from ..model import Building, Footprint
from ..settings import Settings
from ..status import Status
from .outline import largest_polygon, without_needless_vertices
from .points import finite

if TYPE_CHECKING:
    from ..fit.align import Shift


def start_building(footprint: shapely.Polygon | Footprint | None, id: str) -> Building:
    """Return the outcome to start from, with the building's name, footprint, attributes."""
    if isinstance(footprint, Footprint):
        input_values = {
            "footprint": footprint.polygon,
            "attributes": footprint.attributes,
            "shift": footprint.shift,
        }
        return Building(footprint.id, Status.MODELLED, **input_values)
    if footprint is not None and footprint.geom_type != "Polygon":
        footprint = largest_polygon(footprint)  # of several a building has one, and files hold one
    return Building(id, Status.MODELLED, footprint=footprint)


def align_footprint(
    building: Building, points: np.ndarray, settings: Settings
) -> tuple[Building, shapely.Polygon | None, str]:
    """Shift the footprint onto its points, with a remark.

    Points are those in and around it. Returns the building with the shift, and the footprint there.
    It stays where it is unless the evidence is clear, or its shift is known. Of thousands of
    vertices it keeps those that matter.
    """
    footprint, simplified = without_needless_vertices(building.footprint)
    if footprint is None or not (math.isfinite(footprint.area) and footprint.area):
        return building, footprint, simplified
    if any(building.shift):
        return building, shapely.transform(footprint, lambda c: c + building.shift), simplified
    if settings.reconstruct.align == "off":
        return building, footprint, simplified
    from ..fit.align import find_shift

    polygon = largest_polygon(footprint)
    origin = np.floor(polygon.bounds[:2])
    result = find_shift(
        finite(points[:, :2]) - origin, shapely.transform(polygon, lambda c: c - origin)
    )
    if result.is_clear:
        shift = (round(float(result.xy[0]), 3), round(float(result.xy[1]), 3))
        building = dataclasses.replace(building, shift=shift)
        footprint = shapely.transform(footprint, lambda c: c + shift)
    return building, footprint, "; ".join(filter(None, (simplified, shift_remark(result))))


def shift_remark(result: Shift, of_row: int = 1) -> str:
    """Return a remark on a footprint moved, alone or by row, or a roof's size, else ""."""
    remarks = []
    if result.is_clear:
        error = float(np.hypot(*result.sigma))
        row = f" with the {of_row} of its row" if of_row > 1 else ""
        remarks.append(
            f"its footprint was moved{row} by ({result.xy[0]:.2f}, {result.xy[1]:.2f}) m, within "
            f"{error:.2f} m, onto its roof"
        )
    if result.is_size_clear:
        reach = "reaches {:.1f} m beyond" if result.beyond > 0 else "stays {:.1f} m inside"
        remarks.append(
            f"its roof {reach.format(abs(result.beyond))} its footprint on every side that shows"
        )
    return "; ".join(remarks)
