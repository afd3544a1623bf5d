"""The roof of one building among points without classes.

Points that lie on no surface, or on the ground, are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import shapely

CLEAR_M = 0.5  # of a roof above the ground
BESIDE_M = 1.0  # m from the outline beyond which points lie beside the building
FEWEST_BESIDE = 10  # cells beside a building, without which nothing is known of the ground
MOSTLY, HARDLY = 0.5, 0.15  # shares of the outline's points
# log odds of a roof where a footprint says that there is a building: sparse points of small roofs
# tell little by themselves
FOOTPRINT_ODDS = 0.7


@dataclass(frozen=True)
class FoundRoof:
    """`points` (n, 3) of a roof, and what is known of it.

    `remark` says what hides it, `is_seen` whether enough of it is there to be modelled; `ground`
    (m, 3) are points on the ground inside the outline, and `is_ground` says whether the points that
    are no roof are these.
    """

    points: np.ndarray
    remark: str = ""
    is_seen: bool = True
    ground: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    is_ground: bool = False


def found_roof(
    nearby: np.ndarray, area: shapely.Geometry, height: np.ndarray, is_asked_for: bool = False
) -> FoundRoof:
    """Find the roof within `area`, from the points in and around it.

    `nearby` are (n, 3), their `height` (n,) is above ground, NaN where unknown.

    `is_asked_for`: the area is a footprint, not one that was found by these points. Shares are of
    points thinned to one a voxel, so that a wall or a crown hit often does not count as more.
    """
    from ...classify import roof_points
    from ...classify.surfaces import thin_to_voxels
    from ...fit.site import remark_parcel

    inside = shapely.intersects_xy(area, nearby[:, :2])
    if not inside.any():
        return FoundRoof(nearby[inside])
    shapely.prepare(area)
    is_high = ~(height < CLEAR_M)
    is_roof = np.zeros(len(nearby), bool)
    is_roof[is_high] = roof_points(nearby[is_high], FOOTPRINT_ODDS if is_asked_for else 0.0)
    selection, _ = thin_to_voxels(nearby[inside])
    roof, upper = is_roof[inside][selection].mean(), is_high[inside][selection].mean()
    ground = nearby[inside & ~is_high]
    text = "leaves" if upper > 0.5 * (1 + roof) else "ground"
    if roof < HARDLY:
        parcel = remark_parcel(nearby[inside & is_roof], area) if text == "ground" else ""
        remark = f"no roof seen: its points are {text}{parcel}"
        return FoundRoof(nearby[inside], remark, False, ground, text == "ground")
    found = FoundRoof(nearby[inside & is_roof], ground=ground)
    if roof >= MOSTLY:
        return found
    remark = (
        f"mostly not seen: only {100 * roof:.0f} % of what lies inside the outline is roof, "
        f"the rest {text}"
    )
    return replace(found, remark=remark, is_ground=text == "ground")
