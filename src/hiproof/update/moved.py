"""The earlier model with parts moved up or down, or pulled down.

It takes the place of a search where the earlier points, moved with their parts, pass the test of an
update against the new ones. So nothing but heights changes.

Parts were pulled down where their ground lies bare in the new survey.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from ..city.plan.work_plan import Job
from ..errors import HiproofError
from ..fit.bare_ground import find_bare_ground
from ..model import Building, Roof
from ..parametric.building import build
from ..parametric.refit import measure_building, select_inside
from ..stages.remarks import add_finding
from ..status import Change, Doubt, Status
from .cells import MEDIAN_VARIANCE, CellComparison
from .epochs import Surveys
from .judge import (
    FEWEST_COMPARED,
    OVER_GROUND_M,
    ChangeVerdict,
    find_bare,
    judge_building,
)
from .kinds import LEAST_BARE_M2, moves_together
from .lineage import lift_part, measure_lift, show_parts, unite_lifts
from .places import move_to_frame

OF_SURVEYS = ("survey_date", "epochs_used", "change")  # keys that say which points made a model


def move_building(
    earlier: Building,
    record: dict[str, Any],
    verdict: ChangeVerdict,
    points: tuple[np.ndarray | None, np.ndarray],
    surveys: Surveys,
    near_m: float,
) -> Building | None:
    """Return the earlier building with parts moved as the new points show them.

    `record` is its object of parameters.jsonl, and `points` (n, 3) are the old and new ones in the
    roof's frame. None where something else changed, too, or where nothing moved by more than
    `near_m`.
    """
    roof, comparison = earlier.roof, verdict.comparison
    if earlier.status is not Status.MODELLED or record.get("installations"):
        return None
    lifts = measure_lifts(roof, comparison, near_m)
    if lifts is None or not any(lifts):
        return None
    sigmas = measure_sigmas(roof, comparison, surveys.shift.sigma[2])
    parts = [
        lift_part(part, lift, sigma)
        for part, lift, sigma in zip(record["parts"], lifts, sigmas, strict=True)
    ]
    kept = {name: value for name, value in record.items() if name not in OF_SURVEYS}
    try:
        result = build(kept | {"parts": parts}, earlier.model.compose)
    except HiproofError:
        return None
    old = None if points[0] is None else lift_points(roof, points[0], np.array(lifts))
    again = judge_building(
        result.roof,
        old,
        points[1],
        verdict.ground,
        surveys.shift,
        surveys.largest_chance,
    )
    return result if again.change is Change.UNCHANGED else None


def measure_lifts(roof: Roof, comparison: CellComparison, near_m: float) -> list[float] | None:
    """Return how much higher (m) each part lies, 0 for one that did not move.

    None where a part has too few cells, or these did not move alike. Parts that moved together move
    by the same height.
    """
    result = {}
    for number, d in enumerate(split_by_part(roof, comparison, comparison.difference)):
        if len(d) < FEWEST_COMPARED:
            return None
        result[number] = measure_lift(d, near_m)
        if result[number] and not moves_together(d):
            return None
    return list(unite_lifts(result, near_m).values())


def measure_sigmas(roof: Roof, comparison: CellComparison, sigma_m: float) -> list[float]:
    """Return the standard deviation (m) of how much higher each part lies.

    `sigma_m` is that of the common vertical shift.
    """
    variances = split_by_part(roof, comparison, comparison.sigma**2)
    means = [MEDIAN_VARIANCE * float(own.mean()) / len(own) for own in variances]
    return [float(np.hypot(np.sqrt(mean), sigma_m)) for mean in means]


def split_by_part(roof: Roof, comparison: CellComparison, values: np.ndarray) -> list[np.ndarray]:
    """Return the `values` (n,) of the compared cells, part by part."""
    shown = show_parts(roof, comparison.centres)[comparison.is_compared]
    compared = values[comparison.is_compared]
    return [compared[shown == number] for number in range(len(roof.parts))]


def lift_points(roof: Roof, points: np.ndarray, lifts: np.ndarray) -> np.ndarray:
    """Return points (n, 3) moved by the lift (p,) of the part at each."""
    shown = show_parts(roof, points[:, :2])
    rise = np.where(shown >= 0, lifts[shown], 0.0)
    return points + np.column_stack([np.zeros((len(points), 2)), rise])


def measure_moved(moved: Building, points: np.ndarray) -> Building:
    """Return a moved building measured on the new roof `points` (n, 3) in the world."""
    measured = measure_building(moved, select_inside(moved.roof, points))
    return dataclasses.replace(moved, quality=measured.quality, grade=measured.grade)


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
    def find(cls, verdict: ChangeVerdict, earlier: Roof) -> LostParts | None:
        """Find the places that a verdict calls changed and where the ground lies bare.

        None where they are too small.
        """
        c, changed = verdict.comparison, [cluster.members for cluster in verdict.clusters]
        if not changed or verdict.change is Change.UNCERTAIN:
            return None
        is_bare = np.logical_and(*find_bare(c, earlier, verdict.ground))
        bare = np.intersect1d(np.concatenate(changed), np.flatnonzero(is_bare))
        area_m2 = sum(
            cluster.area_m2 * float(np.isin(cluster.members, bare).mean())
            for cluster in verdict.clusters
        )
        if area_m2 < LEAST_BARE_M2:
            return None
        is_low = c.points[:, 2] - verdict.ground.height_at(c.points) < OVER_GROUND_M
        xy = c.points[:, :2]
        return cls(c.centres[bare], area_m2, xy[~is_low], xy[is_low], earlier)

    def measure_under(self, building: Building) -> float:
        """Return the lost area (m2) that a model covers, 0 where it covers little of it."""
        outline = move_to_frame(building.roof, self.earlier).outline
        share = float(shapely.intersects_xy(outline, self.places).mean())
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
