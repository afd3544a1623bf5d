"""Parts of a building that were pulled down: their ground lies bare in the new survey."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import shapely

from ..city.plan.work_plan import Job
from ..fit.bare_ground import find_bare_ground
from ..model import Building, Roof
from ..stages.remarks import add_finding
from ..status import Doubt
from .judge import OVER_GROUND_M, ChangeVerdict, lies_bare
from .places import move_to_frame

LEFT_SHARE = 0.25
"""Share of the lost area that a new model may cover: strips along its edge, whose points are as
far apart as those of the roof beside them."""


@dataclass(frozen=True)
class LostParts:
    """Places (k, 2) of `area_m2` in all that were roof and lie bare now.

    `high` (n, 2) and `low` (m, 2) are the new points on roofs and on the ground. All are in the
    frame of the `earlier` roof.
    """

    places: np.ndarray
    area_m2: float
    high: np.ndarray
    low: np.ndarray
    earlier: Roof

    @classmethod
    def find(cls, verdict: ChangeVerdict, earlier: Roof, z_ground: float) -> LostParts | None:
        """Find the places that a verdict calls changed and where the ground lies bare.

        `z_ground` is its height in the frame of the earlier roof. None where there are none.
        """
        c = verdict.comparison
        if c is None:
            return None
        bare = [cluster for cluster in verdict.clusters if lies_bare(cluster, c, z_ground)]
        if not bare:
            return None
        places = c.centres[np.concatenate([cluster.members for cluster in bare])]
        is_low, xy = c.points[:, 2] < z_ground + OVER_GROUND_M, c.points[:, :2]
        area_m2 = sum(cluster.area_m2 for cluster in bare)
        return cls(places, area_m2, xy[~is_low], xy[is_low], earlier)

    def measure_under(self, building: Building) -> float:
        """Return the lost area (m2) that a model covers, 0 where it covers little of it."""
        outline = move_to_frame(building.roof, self.earlier).outline
        share = float(shapely.intersects_xy(outline, *self.places.T).mean())
        return share * self.area_m2 if share > LEFT_SHARE else 0.0

    def make_smaller_job(self, job: Job, shift: tuple[float, float]) -> Job | None:
        """Return the job, moved by `shift`, without the ground that lies bare.

        None where that cannot be cut out. That a roof stood there is known, so less bare ground
        counts than in a first survey.
        """
        origin = self.earlier.frame.origin[:2]
        outline = shapely.transform(job.area, lambda xy: xy + shift - origin)
        bare = find_bare_ground(outline, self.high, self.low, was_roof=True)
        if bare is None or bare.outline is None or job.footprint is None:
            return None
        area = shapely.transform(bare.outline, lambda xy: xy + origin)
        footprint = dataclasses.replace(job.footprint, polygon=area, shift=(0.0, 0.0))
        return dataclasses.replace(job, area=area, footprint=footprint)

    def doubt(self, building: Building) -> Building:
        """Return a building with a finding against it where it covers what was lost."""
        area_m2 = self.measure_under(building) if building.built is not None else 0.0
        words = f"{area_m2:.0f} m2 {Doubt.BARE_GROUND_INSIDE.value} is roofed over"
        return add_finding(building, words) if area_m2 else building
