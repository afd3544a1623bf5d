"""A building's roof in OpenStreetMap's Simple 3D Buildings tags.

Its main part counts.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..model import ROOF, Building
from ..model.roof_figures import RoofFigures, find_ground_height
from ..primitives.catalogue import CATALOGUE
from .attribute_list import TABLES
from .values import round_value

ONE_ENDED = ("side_hip", "side_half_hip")


def osm_tags(building: Building, figures: RoofFigures | None) -> dict[str, Any]:
    """Return the tags by name, in the order of their table.

    None what cannot be told or, of a flat roof, has no meaning.

    >>> import hiproof
    >>> from hiproof.model.roof_figures import roof_figures
    >>> x, y = np.meshgrid(np.arange(0, 10, 0.5), np.arange(0, 6, 0.5))
    >>> house = hiproof.reconstruct(np.column_stack([x.ravel(), y.ravel(),
    ...     5 - 0.5 * abs(y.ravel() - 2.75)]))
    >>> tags = osm_tags(house, roof_figures(house.solid))
    >>> tags["roof:shape"], round(tags["roof:angle"])
    ('gabled', 27)
    """
    if figures is None or not building.parts:
        return dict.fromkeys(TABLES["osm"].names)
    main = building.model.main
    roof = [i for i, face in enumerate(building.solid.faces) if face.kind == ROOF]
    visible = [i for i in roof if building.solid.faces[i].part == main] or roof
    largest = max(visible, key=lambda i: figures.face_area_m2[i])
    lowest = min(
        building.solid.vertices[list(ring), 2].min()
        for i in visible
        for ring in building.solid.faces[i].rings
    )
    ground = min(find_ground_height(building, figures), figures.h_base)
    values = (
        osm_shape(building.parts[main].type),
        figures.h_max - lowest,
        find_direction(building, main, figures.face_azimuth_deg[largest]),
        figures.face_slope_deg[largest],
        figures.h_max - ground,
    )
    return dict(zip(TABLES["osm"].names, map(format_number, values), strict=True))


def osm_shape(name: str) -> str | None:
    """Return the value of roof:shape of a roof type, None if it has none."""
    return CATALOGUE[name].osm_shape if name in CATALOGUE else None


def find_direction(building: Building, main: int, azimuth_deg: float) -> float:
    """Return the direction of part `main`.

    It is that of its hipped end, else that of its largest face.
    """
    part = building.parts[main]
    return (
        math.degrees(0.5 * math.pi - part.kappa) % 360.0 if part.type in ONE_ENDED else azimuth_deg
    )


def format_number(value: Any) -> Any:
    """Round a number to the centimetre or hundredth of a degree; NaN is None."""
    if isinstance(value, (float, np.floating)):
        return round_value(float(value), 2) if math.isfinite(value) else None
    return value
