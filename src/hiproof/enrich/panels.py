"""The area of a roof face that panels may cover, and what they yield."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from ..model import ROOF, Solid

PANEL_MARGIN_M = 0.3  # width (m) that panels leave free along the edges of a roof face
PANEL_WIDTH_M = 1.0  # width (m) of a panel: where less is free none fits
# Share of the irradiation that becomes electricity: modules of 20 %, and 0.8 for heat, cables and
# inverters.
PANEL_EFFICIENCY, PERFORMANCE_RATIO = 0.20, 0.80


def measure_panels(
    solid: Solid, face: int, normal: np.ndarray, objects: Sequence[Solid] = ()
) -> float:
    """Return the area (m2) of a roof face that panels may cover.

    It is PANEL_MARGIN_M or more from its edges and from `objects` on the roof, and nowhere narrower
    than PANEL_WIDTH_M. The face is laid flat: plan coordinates are stretched along its slope.
    """
    covered = [item.project_face(top) for item in objects for top in item.select_faces(ROOF)]
    free = shapely.difference(solid.project_face(solid.faces[face]), shapely.union_all(covered))
    flat = float(np.hypot(normal[0], normal[1]))
    down = normal[:2] / flat if flat > 0 else np.array([1.0, 0.0])
    axes = np.column_stack([down / normal[2], (-down[1], down[0])])
    outline = shapely.transform(free, lambda xy: xy @ axes)
    half = PANEL_WIDTH_M / 2
    core = shapely.buffer(outline, -(PANEL_MARGIN_M + half), join_style="mitre")
    grown = shapely.buffer(core, half, join_style="mitre")
    inner = shapely.buffer(outline, -PANEL_MARGIN_M, join_style="mitre")
    return float(shapely.intersection(grown, inner).area)


def estimate_yield(area_m2: float, sun_kwh_m2: float) -> float:
    """Return the yield (kWh) of panels in a year."""
    return area_m2 * sun_kwh_m2 * PANEL_EFFICIENCY * PERFORMANCE_RATIO
