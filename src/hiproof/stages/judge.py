"""The finished building: quality, verdict and doubts."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from ..model import ROOF, Building, Model, Roof, Solid, as_xyz
from ..settings import Settings
from ..status import Doubt
from .fit import Fitted
from .ground import Ground
from .points import compress_inside, finite
from .remarks import add_remark

if TYPE_CHECKING:
    from ..evaluate.metrics import Inner

# Of ground above the lowest eave; less is how well both are known, where a roof comes down to the
# ground.
SUNK_M = 0.2


def judge(
    building: Building,
    roof: Roof,
    solid: Solid | None,
    points: np.ndarray,
    fitted: Fitted,
    ground: Ground,
    settings: Settings,
    unused: np.ndarray | None = None,
) -> Building:
    """Return the building in the world with quality of its solid, status, verdict, doubts."""
    from ..compose.settle import round_building
    from ..evaluate.metrics import quality, well_inside

    if solid is None:
        return dataclasses.replace(building, status=fitted.status, detail=fitted.detail)
    inner = well_inside(points, roof.outline)
    measured = dataclasses.replace(
        building,
        status=fitted.status,
        detail=fitted.detail,
        built=Model(roof, solid.move(roof.frame.origin), settings.compose),
        quality=quality(solid, points, roof.outline, inner),
        z_ground=ground.z,
        ground_source=ground.source,
        terrain_intersection=ground.intersection,
        objective=fitted.objective,
        types=fitted.types,
    )
    return add_cautions(
        grade_building(round_building(measured), points, select_unused(roof, unused)), points, inner
    )


def select_unused(roof: Roof, unused: np.ndarray | None) -> np.ndarray:
    """Return the finite `unused` world points (m, 3) inside the outline, in the roof's frame."""
    if unused is None:
        return np.zeros((0, 3))
    local = roof.frame.to_local(finite(as_xyz(unused)))
    return compress_inside(local, roof.outline)


def grade_building(
    building: Building, points: np.ndarray, unused: np.ndarray | None = None
) -> Building:
    """Add the verdict by `points` (n, 3), in the roof's frame, and `unused` ones (m, 3)."""
    from ..evaluate.verdict import judge_model

    grade, reasons = judge_model(building.model, points, unused)
    return add_remark(dataclasses.replace(building, grade=grade), "; ".join(reasons))


def add_cautions(building: Building, points: np.ndarray, inner: Inner) -> Building:
    """Add doubts about a building to its detail: ground above its eaves, or two surfaces.

    Two surfaces, one over the other, are found among the points (n, 3) in the roof's frame that lie
    well `inner`.
    """
    from ..evaluate.layers import find_second_surface

    building = remark_ground(building)
    share, apart_m = find_second_surface(points, building.roof, inner)
    if share:
        building = add_remark(
            building,
            f"over {100 * share:.0f} % of its area {Doubt.TWO_SURFACES.value}, {apart_m:.2f} m "
            "apart: two flights, two dates, glass or leaves; use a cloud of one",
        )
    return building


def remark_ground(building: Building) -> Building:
    """Add a remark where the ground lies above the eaves, unless the detail has one."""
    lowest = min(
        building.solid.vertices[list(ring), 2].min()
        for face in building.solid.select_faces(ROOF)
        for ring in face.rings
    )
    sunk = building.z_ground - float(lowest)
    if sunk <= SUNK_M or Doubt.GROUND_ABOVE_EAVES.value in building.detail:
        return building
    return add_remark(
        building,
        f"the ground ({building.ground_source}) lies {sunk:.1f} "
        f"{Doubt.GROUND_ABOVE_EAVES.value}: heights of other kinds",
    )
