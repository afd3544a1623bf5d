"""A work tile brought up to date.

Every building is judged by the points of both surveys. What is unchanged keeps its object of
parameters, of which its texts are made as `hiproof build` makes them: byte for byte. What changed
is reconstructed from the new points.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..city.bundles import keep_failure
from ..city.ledger import Outcome
from ..city.plan import Job, WorkPlan, load_plan
from ..city.solve import Surroundings, open_terrain, record_failure, solve_buildings, solve_one
from ..city.sort import load_points
from ..errors import report_error
from ..frames import LocalFrame
from ..model import Building, Roof
from ..parametric.building import build
from ..read.thin import without_repeats
from ..status import Change, ChangeKind, Doubt, Status
from ..write.fragments import Fragments
from ..write.parameters import outline_record
from ..write.run_files import fragments
from .judge import ChangeVerdict, judge_building
from .kinds import Difference, name_differences, name_doubts
from .lineage import continue_parts
from .plan import EARLIER_FOLDER, load_earlier
from .register import SurveyShift
from .residuals import measure_residuals

SURVEYS_FILE = "surveys.json"
DIFFERENCE_DIGITS = 4  # of differences: tenths of a millimetre
PLACE_DIGITS = 3  # of the outlines of places: millimetres

BETTER = 0.5
"""Share of the earlier roof's distance from contradicting points that a new roof may keep."""


@dataclass(frozen=True)
class Surveys:
    """The shift of the two surveys, the new one's date and the significance."""

    shift: SurveyShift
    date: str
    significance: float
    has_earlier: bool

    def save(self, path: Path) -> None:
        """Write the surveys for the workers."""
        record = dataclasses.asdict(self) | {"shift": self.shift.to_dict()}
        path.write_text(json.dumps(record) + "\n", encoding="utf-8")

    @staticmethod
    def load(path: Path) -> Surveys:
        """Read what `save` wrote."""
        record = json.loads(path.read_text(encoding="utf-8"))
        return Surveys(**record | {"shift": SurveyShift.from_dict(record["shift"])})


class Epochs:
    """The points of both surveys in a work tile, looked up building by building."""

    def __init__(self, root: Path, tile: str, terrain: str | None, shift: np.ndarray):
        self.root, self.plan = root, load_plan(root)
        points = {kind: xyz - shift for kind, xyz in load_points(root, tile).items()}
        self.new = Surroundings(points, open_terrain(self.plan, terrain), self.plan)
        folder, self.old = root / EARLIER_FOLDER, None
        if any((folder / "points").iterdir()):
            self.old = Surroundings(load_points(folder, tile), None, load_plan(folder))

    def select(self, job: Job) -> tuple[np.ndarray | None, np.ndarray]:
        """Return the old and new points (n, 3) of a building, roof and bare ground alike."""
        old = None if self.old is None else select_points(self.old, job)
        return old, select_points(self.new, job)


def select_points(surroundings: Surroundings, job: Job) -> np.ndarray:
    """Return the points (n, 3) of a roof and of bare ground in its outline."""
    found = surroundings.select_roof_points(job)
    bare = surroundings.bare(job, found, surroundings.select_other_points(job))
    points = without_repeats(np.concatenate([found.points, bare]))
    return points[shapely.intersects_xy(job.area, points[:, 0], points[:, 1])]


def update_tile(
    folder: str, tile: str, terrain: str | None = None, avoid: tuple[int, ...] = ()
) -> list[Outcome]:
    """Bring the buildings of `tile` up to date.

    The arguments are those of `solve_tile`.
    """
    root = Path(folder)
    plan, surveys, records = load_plan(root), Surveys.load(root / SURVEYS_FILE), load_earlier(root)
    epochs = Epochs(root, tile, terrain, surveys.shift.applied)
    keep = functools.partial(keep_failure, root, tile, plan)

    def solve(job: Job) -> tuple[Building, Fragments]:
        return update_building(plan, job, records[job.index], epochs, surveys, keep)

    return solve_buildings(root, plan, tile, solve, avoid)


def update_building(
    plan: WorkPlan,
    job: Job,
    record: dict[str, Any],
    epochs: Epochs,
    surveys: Surveys,
    keep: Callable,
) -> tuple[Building, Fragments]:
    """Return a building brought up to date, and its texts."""
    try:
        earlier = build(record, plan.settings.compose)
        if earlier.built is None:
            return revisit_empty(plan, job, earlier, epochs, surveys, keep)
        old, new = epochs.select(job)
        to_local = earlier.roof.frame.to_local
        verdict = judge_building(
            earlier.roof,
            None if old is None else to_local(old),
            to_local(new),
            earlier.z_ground - earlier.roof.frame.origin[2],
            surveys.shift.noise,
            surveys.shift.sigma[2],
            surveys.significance,
            0.0 if math.isnan(u := earlier.quality.unexplained_area_m2) else u,
        )
        return follow_verdict(verdict, plan, job, earlier, epochs, surveys, keep)
    except MemoryError:
        raise
    except Exception as error:
        report = report_error(error)
        return record_failure(plan, job, report.detail)


def follow_verdict(
    verdict: ChangeVerdict,
    plan: WorkPlan,
    job: Job,
    earlier: Building,
    epochs: Epochs,
    surveys: Surveys,
    keep: Callable,
) -> tuple[Building, Fragments]:
    """Return the building that a verdict leads to."""
    frame = earlier.roof.frame
    if verdict.change is Change.UNCHANGED:
        return finish(plan, job, earlier)
    if verdict.change is Change.GONE:
        places = record_places([demolish(earlier)], frame)
        return finish(plan, job, mark(end_building(earlier), verdict, surveys, places))
    if verdict.change is not Change.CHANGED:
        places = record_places(name_doubts(verdict), frame)
        return finish(plan, job, mark(earlier, verdict, surveys, places))
    new, _ = solve_one(plan, job, epochs.new, None, keep)
    roof = None if new.built is None else move_to_frame(new.roof, earlier.roof)
    if roof is not None and not explains(roof, earlier.roof, verdict):
        roof = None
    z_ground = earlier.z_ground - frame.origin[2]
    found = name_differences(verdict, earlier.roof, roof, z_ground, surveys.shift.sigma[2])
    result, lineage = continue_parts(earlier, earlier if roof is None else new)
    return finish(plan, job, mark(result, verdict, surveys, record_places(found, frame), lineage))


def explains(new: Roof, old: Roof, verdict: ChangeVerdict) -> bool:
    """Return whether the new roof explains what contradicts the earlier one.

    It has to lie much nearer to those points.
    """
    c = verdict.comparison
    if c is None:
        return False
    members = [cluster.members for cluster in verdict.clusters]
    chosen = np.isin(c.number, np.concatenate(members)) if members else c.number >= 0
    points = c.points[chosen]
    after, before = (np.abs(measure_residuals(roof, points)) for roof in (new, old))
    return bool(np.nanmedian(after) < BETTER * np.nanmedian(before))


def revisit_empty(
    plan: WorkPlan,
    job: Job,
    earlier: Building,
    epochs: Epochs,
    surveys: Surveys,
    keep: Callable,
) -> tuple[Building, Fragments]:
    """Return what the new points make of a building that had no model."""
    new, _ = solve_one(plan, job, epochs.new, None, keep)
    if new.built is None:
        return finish(plan, job, earlier)
    verdict = ChangeVerdict(Change.NEW, 0.0)
    area = shapely.transform(new.roof.outline, new.roof.frame.to_world)
    was_bare = earlier.status is Status.NO_BUILDING or Doubt.BARE_GROUND.value in earlier.detail
    kinds = [ChangeKind.BUILT] if was_bare else []
    height = float(np.median(new.solid.vertices[:, 2]) - new.z_ground)
    places = [Difference(kind, height, math.nan, area.area, area, (-1, 0)) for kind in kinds]
    return finish(plan, job, mark(new, verdict, surveys, record_places(places)))


def finish(plan: WorkPlan, job: Job, building: Building) -> tuple[Building, Fragments]:
    """Return the building and its texts."""
    return fragments(building, plan.list_names(job), plan.head)


def move_to_frame(roof: Roof, target: Roof) -> Roof:
    """Return the roof with its parts in the frame of `target`."""
    shift = roof.frame.origin - target.frame.origin
    parts = tuple(
        dataclasses.replace(
            part,
            translation=part.translation + shift,
            pieces=tuple(piece.move(shift) for piece in part.pieces),
        )
        for part in roof.parts
    )
    return Roof(parts, shapely.transform(roof.outline, lambda xy: xy + shift[:2]), target.frame)


def end_building(earlier: Building) -> Building:
    """Return the building without its model: its ground lies bare."""
    outline = shapely.transform(earlier.roof.outline, earlier.roof.frame.to_world)
    return Building(
        earlier.id,
        Status.NO_BUILDING,
        f"{Status.NO_BUILDING.value}; it was demolished",
        footprint=outline,
        attributes=earlier.attributes,
    )


def demolish(earlier: Building) -> Difference:
    """Return the place that a demolished building leaves, in the roof's frame."""
    outline = earlier.roof.outline
    height = earlier.z_ground - float(np.median(earlier.solid.vertices[:, 2]))
    return Difference(ChangeKind.DEMOLISHED, height, math.nan, outline.area, outline)


def mark(
    building: Building,
    verdict: ChangeVerdict,
    surveys: Surveys,
    places: list[dict[str, Any]],
    lineage: list[int | None] | None = None,
) -> Building:
    """Return the building with the record of its change."""
    record = {
        "class": verdict.change.code,
        "survey": surveys.date,
        "chance": float(f"{verdict.chance:.3g}"),
        "places": places,
        "lineage": lineage or [],
        "predecessors": [],
    }
    return dataclasses.replace(building, change=record)


def record_places(
    places: list[Difference], frame: LocalFrame | None = None
) -> list[dict[str, Any]]:
    """Return places that changed as parameters.jsonl holds them.

    `frame` is that of their outlines, None for the world.
    """
    result = []
    for place in places:
        area = place.place if frame is None else shapely.transform(place.place, frame.to_world)
        polygons = [g for g in shapely.get_parts(area) if g.geom_type == "Polygon"]
        rounded = [shapely.transform(g, lambda xy: np.round(xy, PLACE_DIGITS)) for g in polygons]
        result.append(
            {
                "kind": place.kind.code,
                "difference": round_length(place.difference_m),
                "sigma": round_length(place.sigma_m),
                "area": round_length(place.area_m2),
                "parts": [None if part < 0 else part for part in place.parts],
                "outlines": [outline_record(polygon) for polygon in rounded],
            }
        )
    return result


def round_length(value: float) -> float | None:
    """Round a length for a record, None where it is unknown."""
    return round(float(value), DIFFERENCE_DIGITS) if math.isfinite(value) else None
