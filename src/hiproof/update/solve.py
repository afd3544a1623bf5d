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
from ..city.found import FoundRoof
from ..city.ledger import Outcome
from ..city.overrides import load_overrides
from ..city.plan import Job, WorkPlan, load_plan, neighbourhood
from ..city.solve import Surroundings, open_terrain, record_failure, solve_buildings, solve_one
from ..city.sort import load_points
from ..errors import report_error
from ..log import LOGGER
from ..model import Building, Roof
from ..parametric.building import build, with_model
from ..parametric.override import Override
from ..parametric.record import read_building, read_terrain_lines
from ..read.thin import without_repeats
from ..status import Change, ChangeKind, Doubt, Status
from ..write.fragments import Fragments
from ..write.run_files import fragments
from .cells import SAME_SIGMAS
from .judge import ChangeVerdict, judge_building
from .kinds import Difference, name_differences, name_doubts
from .lineage import continue_parts
from .members import UpdateMember, load_members
from .places import (
    demolish,
    end_building,
    end_model,
    explains,
    move_to_frame,
    place_new,
    record_places,
)
from .plan import EARLIER_FOLDER
from .register import SurveyShift
from .texts import KeptBuilding, keep_texts, load_texts

SURVEYS_FILE = "surveys.json"
BEGINNING = (Change.CHANGED, Change.NEW)  # the roof as it is begins with the survey
BARE_SHARE = 0.5
"""Share of an outline that has to lie bare before, for a building to be built since."""


@dataclass(frozen=True)
class Surveys:
    """The shift of the two surveys, the new one's date and the significance.

    `texts` is the state folder of the earlier run, "" where its texts cannot be kept. `history`
    says whether models that ended are kept.
    """

    shift: SurveyShift
    date: str
    significance: float
    has_earlier: bool
    texts: str = ""
    history: bool = False

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

    def select_roofs(self, job: Job) -> tuple[np.ndarray | None, np.ndarray]:
        """Return the old and new roof points (n, 3) of a building."""
        old = None if self.old is None else select_roof(self.old, job).points
        return old, select_roof(self.new, job).points


def select_points(surroundings: Surroundings, job: Job) -> np.ndarray:
    """Return the points (n, 3) of a roof and of bare ground in its outline, each once."""
    roof = select_roof(surroundings, job)
    if not (len(roof.ground) or has_ground(surroundings, job)):
        return roof.points
    bare = surroundings.bare(job, roof, surroundings.select_other_points(job))
    bare = bare[shapely.intersects_xy(job.area, bare[:, 0], bare[:, 1])]
    return np.concatenate([roof.points, bare])


def has_ground(surroundings: Surroundings, job: Job) -> bool:
    """Return whether points of the ground class lie in a building's outline."""
    ground = surroundings.ground.inside(neighbourhood(job, 0.0))
    return bool(shapely.intersects_xy(job.area, ground[:, 0], ground[:, 1]).any())


def select_roof(surroundings: Surroundings, job: Job) -> FoundRoof:
    """Return the roof of a building, with the points inside its outline."""
    if surroundings.plan.settings.read.by_class:
        inside = surroundings.grid.inside(job.area)
        return FoundRoof(without_repeats(surroundings.roof.take(inside, axis=0)))
    found = surroundings.select_roof_points(job)
    points = without_repeats(found.points)
    inside = shapely.intersects_xy(job.area, points[:, 0], points[:, 1])
    return dataclasses.replace(found, points=points[inside])


def update_tile(
    folder: str, tile: str, terrain: str | None = None, avoid: tuple[int, ...] = ()
) -> list[Outcome]:
    """Bring the buildings of `tile` up to date.

    The arguments are those of `solve_tile`.
    """
    root = Path(folder)
    plan, surveys, members = load_plan(root), Surveys.load(root / SURVEYS_FILE), load_members(root)
    epochs = Epochs(root, tile, terrain, surveys.shift.clear_xyz)
    keep = functools.partial(keep_failure, root, tile, plan)

    texts, overrides = load_texts(surveys.texts, tile, plan.head), load_overrides(root)
    updater = Updater(plan, epochs, surveys, keep, texts, overrides)

    def solve(job: Job) -> tuple[Building, Fragments]:
        building = updater.update(job, UpdateMember.read(members[job.index], job))
        if isinstance(building, KeptBuilding):
            return building, building.texts
        return fragments(building, plan.list_names(job), plan.head)

    return solve_buildings(root, plan, tile, solve, avoid)


@dataclass(frozen=True)
class Updater:
    """Everything that the buildings of a work tile are brought up to date with."""

    plan: WorkPlan
    epochs: Epochs
    surveys: Surveys
    keep: Callable[..., None]
    texts: dict[bytes, Fragments]
    overrides: dict[int, Override]

    @property
    def near_m(self) -> float:
        """Largest difference (m) of heights between unchanged roofs."""
        noise = self.surveys.shift.noise
        return SAME_SIGMAS * math.hypot(noise.cell, noise.roof)

    def update(self, job: Job, member: UpdateMember) -> Building:
        """Return a building brought up to date, whatever happens to it."""
        try:
            if member.record is None:
                return self.replace_earlier(job, member)
            # lines of terrain judge nothing, and reading them takes long
            earlier, roof = read_building(member.record | {"terrain_line": []})
            if roof is None or earlier.status is Status.FROM_ATTRIBUTES:
                return self.revisit_empty(job, member)
            verdict = self.judge(job, earlier, roof)
            if verdict.change is Change.UNCHANGED and member.is_same_outline:
                kept = keep_texts(earlier, member.record, self.texts)
                if kept is not None:
                    return kept
            lines = tuple(read_terrain_lines(member.record))
            earlier = dataclasses.replace(earlier, terrain_intersection=lines)
            earlier = with_model(earlier, roof, self.plan.settings.compose)
            return self.follow_verdict(job, member, earlier, verdict)
        except MemoryError:
            raise
        except Exception as error:
            report = report_error(error)
            LOGGER.info("building %s failed:\n%s", job.id, report.trace)
            return record_failure(self.plan, job, report.detail)[0]

    def judge(self, job: Job, earlier: Building, roof: Roof) -> ChangeVerdict:
        """Return the verdict on an earlier building by the points of both surveys."""
        old, new = self.epochs.select(job)
        frame, shift = roof.frame, self.surveys.shift
        unexplained = earlier.quality.unexplained_area_m2
        return judge_building(
            roof,
            None if old is None else frame.to_local(old),
            frame.to_local(new),
            earlier.z_ground - frame.origin[2],
            shift.noise,
            shift.sigma[2],
            self.surveys.significance,
            0.0 if math.isnan(unexplained) else unexplained,
        )

    def reconstruct(self, job: Job, member: UpdateMember) -> Building:
        """Return a building made of the new points and its override."""
        override = self.overrides.get(job.index)
        new, _ = solve_one(self.plan, job, self.epochs.new, override, self.keep)
        return dataclasses.replace(new, shift=member.shift)

    def follow_verdict(
        self, job: Job, member: UpdateMember, earlier: Building, verdict: ChangeVerdict
    ) -> Building:
        """Return the building that a verdict leads to."""
        frame = earlier.roof.frame
        if verdict.change is Change.GONE:
            places = record_places([demolish(earlier)], frame)
            return self.mark(end_building(earlier), verdict, places, member)
        if verdict.change is Change.NOT_COVERED:
            return self.mark(earlier, verdict, [], member)
        if not member.is_same_outline:
            return self.redraw(job, member, earlier, verdict)
        if verdict.change is Change.UNCHANGED:
            return earlier
        if verdict.change is Change.UNCERTAIN:
            places = record_places(name_doubts(verdict), frame)
            return self.mark(earlier, verdict, places, member)
        new = self.reconstruct(job, member)
        if new.built is None or not explains(
            move_to_frame(new.roof, earlier.roof), earlier.roof, verdict
        ):
            return self.mark(earlier, verdict, self.name_places(earlier, None, verdict), member)
        result, lineage = continue_parts(earlier, new, self.near_m)
        places = self.name_places(earlier, result, verdict)
        return self.mark(result, verdict, places, member, lineage)

    def name_places(
        self, earlier: Building, result: Building | None, verdict: ChangeVerdict
    ) -> list[dict[str, Any]]:
        """Return the places where a building changed, as its record has them.

        `result` is its new model, None where no new model explains the points.
        """
        roof = None if result is None else move_to_frame(result.roof, earlier.roof)
        z_ground = earlier.z_ground - earlier.roof.frame.origin[2]
        sigma = self.surveys.shift.sigma[2]
        found = name_differences(verdict, earlier.roof, roof, z_ground, sigma)
        return record_places(found, earlier.roof.frame)

    def redraw(
        self, job: Job, member: UpdateMember, earlier: Building, verdict: ChangeVerdict
    ) -> Building:
        """Return a building over another outline than before."""
        new = self.reconstruct(job, member)
        if new.built is None:
            verdict = dataclasses.replace(verdict, change=Change.UNCERTAIN)
            return self.mark(earlier, verdict, [], member)
        result, lineage = continue_parts(earlier, new, self.near_m)
        is_changed = verdict.change is Change.CHANGED
        places = self.name_places(earlier, result, verdict) if is_changed else []
        before = shapely.transform(earlier.roof.outline, earlier.roof.frame.to_world)
        apart = shapely.symmetric_difference(before, job.area)
        outline = Difference(
            ChangeKind.OUTLINE_CHANGED, math.nan, math.nan, job.area.area - before.area, apart
        )
        places += record_places([outline])
        return self.mark(
            result, dataclasses.replace(verdict, change=Change.CHANGED), places, member, lineage
        )

    def replace_earlier(self, job: Job, member: UpdateMember) -> Building:
        """Return the building of a new footprint that is no earlier building."""
        new = self.reconstruct(job, member)
        if new.built is None:
            return new
        if not member.predecessors:
            is_bare = self.was_bare(job)
            return self.mark(new, ChangeVerdict(Change.NEW, 0.0), place_new(new, is_bare), member)
        one = len(member.predecessors) == 1
        kind = ChangeKind.SPLIT if one else ChangeKind.MERGED
        place = Difference(kind, math.nan, math.nan, job.area.area, job.area, (-1, 0))
        return self.mark(new, ChangeVerdict(Change.CHANGED), record_places([place]), member)

    def was_bare(self, job: Job) -> bool:
        """Return whether the earlier survey shows bare ground over most of an outline."""
        if self.epochs.old is None:
            return False
        old = self.epochs.old
        bare = old.bare(job, old.select_roof_points(job), old.select_other_points(job))
        bare = bare[shapely.intersects_xy(job.area, bare[:, 0], bare[:, 1])]
        cells = np.unique(np.floor(bare[:, :2]), axis=0)
        return len(cells) >= BARE_SHARE * job.area.area

    def revisit_empty(self, job: Job, member: UpdateMember) -> Building:
        """Return what the new points make of a building that no earlier points showed."""
        new = self.reconstruct(job, member)
        if new.built is None or new.status is Status.FROM_ATTRIBUTES:
            return build(member.record or {}, self.plan.settings.compose)
        earlier = read_building(member.record or {})[0]
        is_bare = earlier.status is Status.NO_BUILDING or Doubt.BARE_GROUND.value in earlier.detail
        places = place_new(new, is_bare)
        return self.mark(new, ChangeVerdict(Change.NEW, 0.0), places, member, [])

    def mark(
        self,
        building: Building,
        verdict: ChangeVerdict,
        places: list[dict[str, Any]],
        member: UpdateMember,
        lineage: list[int | None] | None = None,
    ) -> Building:
        """Return the building with the record of its change.

        A roof begins and a building ends on the day of the survey. A `lineage` comes with a model
        that takes the place of the earlier one.
        """
        before = (member.record or {}).get("change") or {}
        survey, change = self.surveys.date, verdict.change
        record = {
            "class": change.code,
            "survey": survey,
            "chance": float(f"{verdict.chance:.3g}"),
            "places": places,
            "lineage": lineage or [],
            "predecessors": list(member.predecessors),
            "valid_from": survey if change in BEGINNING else before.get("valid_from"),
            "valid_to": survey if change is Change.GONE else None,
        }
        ended = list(member.ended)
        if member.record and (change is Change.GONE or lineage is not None):
            ended.append(member.record)
        history = before.get("history", [])
        if self.surveys.history and ended:
            history = [model for other in ended for model in end_model(other, survey)]
        if history:
            record["history"] = history
        return dataclasses.replace(building, change=record)
