"""A work tile brought up to date.

Every building is judged by the points of both surveys. What is unchanged keeps its object of
parameters, of which its texts are made as `hiproof build` makes them: byte for byte. What changed
is reconstructed from the new points.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..city.folder.ledger import Outcome
from ..city.plan.overrides import load_overrides
from ..city.plan.work_plan import Job, WorkPlan, load_plan, make_job
from ..city.work.solve import (
    KeepFailure,
    keep_nothing,
    pass_over_failure,
    solve_buildings,
    solve_one,
)
from ..fit.align import AROUND_M, find_shift
from ..model import Building, Roof
from ..parametric.building import build, with_model
from ..parametric.override import Override
from ..parametric.record import read_building
from ..stages.points import distinct
from ..stages.remarks import add_remark
from ..status import Change, ChangeKind, Doubt, Status
from ..write.fragments import Fragments
from ..write.run_files import fragments
from .cells import SAME_SIGMAS
from .epochs import JUDGING_FILE, SURVEYS_FILE, Epochs, Surveys, compare_ground, select_roof
from .ground import Ground
from .judge import OVER_GROUND_M, ChangeVerdict, judge_building
from .kinds import Difference, name_differences, name_doubts
from .lineage import continue_parts
from .members import UpdateMember, load_members
from .moved import LostParts, measure_moved, move_building
from .places import (
    demolish,
    end_building,
    end_model,
    explains,
    move_to_frame,
    place_new,
    record_places,
)
from .refine import refine_building
from .texts import KeptBuilding, keep_texts, load_texts
from .unseen import find_unseen

BEGINNING = (Change.CHANGED, Change.NEW)  # the roof as it is begins with the survey
TESTED = (Change.CHANGED, Change.UNCHANGED, Change.UNCERTAIN, Change.GONE)
"""Classes of buildings that were tested; others have too few points."""

SHIFT_DIGITS = 3  # of footprints: millimetres

GROUND_MOVED_M = 0.25
"""Height (m) by which the ground around a building moved rather than grass grew on it."""

LEAST_MOVE_M = 0.6
"""Distance (m) from which on a building stands elsewhere: three standard deviations of the plan
between two surveys, which are 0.2 m."""

BARE_SHARE = 0.5
"""Share of an outline that has to lie bare before, for a building to be built since."""


def update_tile(
    folder: str, tile: str, terrain: str | None = None, avoid: tuple[int, ...] = ()
) -> list[Outcome]:
    """Bring the buildings of `tile` up to date.

    The arguments are those of `solve_tile`.
    """
    root = Path(folder)
    updater, members = Updater.load(root, tile, terrain, SURVEYS_FILE), load_members(root)
    plan, points = updater.plan, updater.epochs.new.points

    def update(job: Job, keep: KeepFailure) -> tuple[Building, Fragments]:
        member = UpdateMember.read(members[job.index], job)
        building = dataclasses.replace(updater, keep=keep).update(job, member)
        if isinstance(building, KeptBuilding):
            return building, building.texts
        return fragments(building, plan.list_names(job), plan.head)

    return solve_buildings(root, plan, tile, update, lambda: points, avoid)


def judge_tile(folder: str, tile: str, terrain: str | None = None) -> list[float]:
    """Return the chances of the buildings of `tile` that were tested.

    One that fails is left to `update_tile`, which says so.
    """
    root, chances = Path(folder), []
    updater, members = Updater.load(root, tile, terrain, JUDGING_FILE), load_members(root)
    for index in updater.plan.tiles[tile]:
        job = updater.plan.jobs[index]
        with pass_over_failure(job):
            record = members[index]["record"] or {"id": ""}
            verdict = updater.judge(job, record, *read_building(record))
            if verdict is not None and verdict.change in TESTED:
                chances.append(1.0 if verdict.change is Change.UNCERTAIN else verdict.chance)
    return chances


@dataclass(frozen=True)
class Updater:
    """Everything that the buildings of a work tile are brought up to date with."""

    plan: WorkPlan
    epochs: Epochs
    surveys: Surveys
    texts: dict[bytes, Fragments]
    overrides: dict[int, Override]
    keep: KeepFailure = keep_nothing

    @classmethod
    def load(cls, root: Path, tile: str, terrain: str | None, file: str) -> Updater:
        """Load what a work tile is brought up to date with, by the surveys in `file`."""
        plan, surveys = load_plan(root), Surveys.load(root / file)
        epochs = Epochs(root, tile, terrain, surveys.shift.clear_xyz)
        texts = load_texts(surveys.texts, tile, plan.head)
        return cls(plan, epochs, surveys, texts, load_overrides(root))

    @property
    def near_m(self) -> float:
        """Largest difference (m) of heights between unchanged roofs."""
        noise = self.surveys.shift.noise
        return SAME_SIGMAS * math.hypot(noise.cell, noise.roof)

    def update(self, job: Job, member: UpdateMember) -> Building:
        """Return a building brought up to date."""
        if member.record is None:
            return self.replace_earlier(job, member)
        earlier, roof = read_building(member.record)
        verdict = self.judge(job, member.record, earlier, roof)
        if roof is None or verdict is None:
            return self.revisit_empty(job, member, earlier)
        is_gone = verdict.change is Change.GONE
        unseen = [] if is_gone else find_unseen(roof, verdict, self.epochs.new)
        if verdict.change is Change.UNCHANGED and member.is_same_outline and not unseen:
            kept = self.refine(job, member.record) if self.surveys.refine else None
            kept = kept or keep_texts(earlier, member.record, self.texts)
            if kept is not None:
                return kept
        earlier = with_model(earlier, roof, self.plan.settings.compose)
        lost, places = LostParts.find(verdict, roof), record_places(unseen, roof.frame)
        is_hidden = any(place.kind is ChangeKind.UNCLEAR for place in unseen)
        hardly_seen = Change.UNCERTAIN if is_hidden else Change.NOT_COVERED
        if verdict.change is Change.NOT_COVERED:
            return self.mark(earlier, hardly_seen, verdict.chance, places, member)
        result = self.follow_verdict(job, member, earlier, verdict, lost)
        if places and result is earlier:
            return self.mark(earlier, hardly_seen, verdict.chance, places, member)
        if places and result.change:
            change = result.change | {"places": [*result.change["places"], *places]}
            result = dataclasses.replace(result, change=change)
        return result if lost is None else lost.doubt(result)

    def judge(
        self, job: Job, record: dict[str, Any], earlier: Building, roof: Roof | None
    ) -> ChangeVerdict | None:
        """Return the verdict on an earlier building by the points of both surveys.

        None where its roof was made of no points.
        """
        if roof is None or earlier.status is Status.FROM_ATTRIBUTES:
            return None
        old, new = self.epochs.select(job, record)
        frame = roof.frame
        unexplained = earlier.quality.unexplained_area_m2
        return judge_building(
            roof,
            None if old is None else frame.to_local(old),
            frame.to_local(new),
            Ground.under(earlier, frame),
            self.surveys.shift,
            self.surveys.largest_chance,
            0.0 if math.isnan(unexplained) else unexplained,
        )

    def refine(self, job: Job, record: dict[str, Any]) -> Building | None:
        """Return an unchanged building fitted to both surveys.

        None where it gains nothing.
        """
        old, new = self.epochs.select_roofs(job, record)
        if old is None:
            return None
        earlier = build(record, self.plan.settings.compose)
        return refine_building(earlier, old, new, self.surveys.date)

    def reconstruct(
        self, job: Job, member: UpdateMember, lost: LostParts | None = None
    ) -> Building:
        """Return a building made of the new points and its override, without `lost` parts.

        Where its outline is new, that is moved onto its roof, as in every run.
        """
        override, new = self.overrides.get(job.index), self.epochs.new
        if member.is_same_outline:
            new = new.without_moving()
        building, _ = solve_one(self.plan, job, new, override, self.keep)
        building = building if lost is None else self.lose_parts(job, building, lost)
        x, y = np.add(member.shift, building.shift).round(SHIFT_DIGITS).tolist()
        return dataclasses.replace(building, shift=(x, y))

    def lose_parts(self, job: Job, building: Building, lost: LostParts) -> Building:
        """Return a building made again without `lost` parts, where its model covers them.

        So is one without a model, of which a small part still stands.
        """
        trust = self.plan.settings.reconstruct.footprint_trust
        covered_m2 = math.inf if building.built is None else lost.measure_under(building)
        if not covered_m2 or job.index in self.overrides or trust == "full":
            return building
        smaller = lost.make_smaller_job(job, building.shift)
        if smaller is None:
            return building
        new = self.epochs.new.without_moving()
        result, _ = solve_one(self.plan, smaller, new, None, self.keep)
        if result.built is None or lost.measure_under(result) >= covered_m2:
            return building
        area_m2 = job.area.area - smaller.area.area
        result = dataclasses.replace(result, footprint=building.footprint, shift=building.shift)
        return add_remark(result, f"{area_m2:.0f} m2 {Doubt.BARE_GROUND_INSIDE.value} was cut out")

    def follow_verdict(
        self,
        job: Job,
        member: UpdateMember,
        earlier: Building,
        verdict: ChangeVerdict,
        lost: LostParts | None,
    ) -> Building:
        """Return the building that a verdict leads to."""
        frame, change, chance = earlier.roof.frame, verdict.change, verdict.chance
        if change is Change.GONE:
            places = record_places([demolish(earlier)], frame)
            return self.mark(end_building(earlier), change, chance, places, member)
        if not member.is_same_outline:
            return self.redraw(job, member, earlier, verdict, lost)
        if change is Change.UNCHANGED:
            return earlier
        doubts = record_places(name_doubts(verdict), frame)
        if change is Change.UNCERTAIN:
            return self.mark(earlier, change, chance, doubts, member)
        place = None if lost is None else self.find_place(job, verdict, earlier)
        if place is not None:
            return self.redraw(place, member, earlier, verdict, lost, ChangeKind.MOVED)
        moved = self.move(job, member, earlier, verdict)
        if moved is not None:
            places, lineage = self.name_places(earlier, moved, verdict), range(len(moved.parts))
            return self.mark(moved, change, chance, places, member, list(lineage))
        new = self.reconstruct(job, member, lost)
        if new.built is None or not explains(
            move_to_frame(new.roof, earlier.roof), earlier.roof, verdict
        ):
            places = self.name_places(earlier, None, verdict)
            if {place["kind"] for place in places} == {ChangeKind.PART_REMOVED.code}:
                return self.mark(earlier, change, chance, places, member)  # no pulse passes a roof
            return self.mark(earlier, Change.UNCERTAIN, chance, doubts, member)
        return self.replace_model(job, member, earlier, verdict, new)

    def find_place(self, job: Job, verdict: ChangeVerdict, earlier: Building) -> Job | None:
        """Return the job where its roof stands now, None where that is its earlier place."""
        nearby = distinct(self.epochs.new.select_points(job, AROUND_M))
        local = earlier.roof.frame.to_local(nearby)
        local = local[local[:, 2] - verdict.ground.height_at(local) > 2 * OVER_GROUND_M]
        origin = earlier.roof.frame.origin[:2]
        outline = shapely.transform(job.area, lambda xy: xy - origin)
        shift = find_shift(local[:, :2], outline)
        if not shift.is_clear or np.hypot(*shift.xy) < LEAST_MOVE_M or job.footprint is None:
            return None
        x, y = shift.xy.round(SHIFT_DIGITS).tolist()
        return make_job(job.index, job.footprint, (x, y))

    def move(
        self, job: Job, member: UpdateMember, earlier: Building, verdict: ChangeVerdict
    ) -> Building | None:
        """Return the earlier building with moved parts.

        None where that does not explain the new points, where the ground moved, too, or where an
        override holds.
        """
        if job.index in self.overrides or member.record is None:
            return None
        before = self.epochs.find_ground(job, member.record)
        rises = compare_ground(before, self.epochs.new, job)[:, 2]
        if len(rises) and abs(float(np.median(rises))) > GROUND_MOVED_M:
            return None
        old, new = self.epochs.select(job, member.record)
        to_local = earlier.roof.frame.to_local
        points = None if old is None else to_local(old), to_local(new)
        moved = move_building(earlier, member.record, verdict, points, self.surveys, self.near_m)
        if moved is None:
            return None
        moved = dataclasses.replace(moved, attributes=member.attributes)
        return measure_moved(moved, select_roof(self.epochs.new, job).points)

    def name_places(
        self, earlier: Building, result: Building | None, verdict: ChangeVerdict
    ) -> list[dict[str, Any]]:
        """Return the places where a building changed, as its record has them.

        `result` is its new model, None where no new model explains the points.
        """
        roof = None if result is None else move_to_frame(result.roof, earlier.roof)
        found = name_differences(verdict, earlier.roof, roof, self.surveys.shift.sigma[2])
        return record_places(found, earlier.roof.frame)

    def redraw(
        self,
        job: Job,
        member: UpdateMember,
        earlier: Building,
        verdict: ChangeVerdict,
        lost: LostParts | None,
        kind: ChangeKind = ChangeKind.OUTLINE_CHANGED,
    ) -> Building:
        """Return a building over another outline than before."""
        new = self.reconstruct(job, member, lost)
        if new.built is None:
            return self.mark(earlier, Change.UNCERTAIN, verdict.chance, [], member)
        before = earlier.roof.world_outline
        apart = shapely.symmetric_difference(before, job.area)
        if kind is ChangeKind.MOVED:
            area_m2 = apart.area / 2  # what is covered now, and was not
        else:
            area_m2 = job.area.area - before.area
        outline = Difference(kind, area_m2, apart)
        return self.replace_model(job, member, earlier, verdict, new, outline)

    def replace_model(
        self,
        job: Job,
        member: UpdateMember,
        earlier: Building,
        verdict: ChangeVerdict,
        new: Building,
        outline: Difference | None = None,
    ) -> Building:
        """Return the `new` building in place of the earlier one, perhaps over another outline."""
        points = select_roof(self.epochs.new, job).points
        result, lineage = continue_parts(earlier, new, self.near_m, points)
        is_moved = outline is not None and outline.kind is ChangeKind.MOVED
        is_named = verdict.change is Change.CHANGED and not is_moved
        places = self.name_places(earlier, result, verdict) if is_named else []
        if outline is not None:
            is_first = outline.place.area > max((place["area"] for place in places), default=0.0)
            places.insert(0 if is_first else len(places), *record_places([outline]))
        return self.mark(result, Change.CHANGED, verdict.chance, places, member, lineage)

    def replace_earlier(self, job: Job, member: UpdateMember) -> Building:
        """Return the building of a new footprint that is no earlier building."""
        new = self.reconstruct(job, member)
        if new.built is None:
            return self.end_predecessors(job, member, new)
        if not member.predecessors:
            is_bare = self.was_bare(job)
            return self.mark(new, Change.NEW, 0.0, place_new(new, is_bare), member)
        one = len(member.predecessors) == 1
        kind = ChangeKind.SPLIT if one else ChangeKind.MERGED
        place = Difference(kind, job.area.area, job.area, (-1, 0))
        return self.mark(new, Change.CHANGED, 1.0, record_places([place]), member)

    def end_predecessors(self, job: Job, member: UpdateMember, new: Building) -> Building:
        """Return a `new` building without a model, over outlines that were merged or split."""
        if not member.predecessors or self.was_bare(job):
            return new
        if not lies_on_ground(new):
            return self.mark(new, Change.NOT_COVERED, 1.0, [], member)
        place = Difference(ChangeKind.DEMOLISHED, job.area.area, job.area)
        return self.mark(new, Change.GONE, 0.0, record_places([place]), member)

    def was_bare(self, job: Job) -> bool:
        """Return whether the earlier survey shows bare ground over most of an outline."""
        if self.epochs.old is None:
            return False
        old = self.epochs.old.choose({})
        bare = old.bare(job, old.select_roof_points(job), old.select_other_points(job))
        bare = bare[shapely.intersects_xy(job.area, bare[:, :2])]
        cells = np.unique(np.floor(bare[:, :2]), axis=0)
        return len(cells) >= BARE_SHARE * job.area.area

    def revisit_empty(self, job: Job, member: UpdateMember, earlier: Building) -> Building:
        """Return what the new points make of a building that no earlier points showed."""
        new = self.reconstruct(job, member)
        if new.built is None or new.status is Status.FROM_ATTRIBUTES:
            return build(member.record or {}, self.plan.settings.compose)
        places = place_new(new, lies_on_ground(earlier))
        return self.mark(new, Change.NEW, 0.0, places, member, [])

    def mark(
        self,
        building: Building,
        change: Change,
        chance: float,
        places: list[dict[str, Any]],
        member: UpdateMember,
        lineage: list[int | None] | None = None,
    ) -> Building:
        """Return the building with the record of its change.

        A roof begins and a building ends on the day of the survey. A `lineage` comes with a model
        that takes the place of the earlier one.
        """
        before = (member.record or {}).get("change") or {}
        survey = self.surveys.date
        record = {
            "class": change.code,
            "survey": survey,
            "chance": float(f"{chance:.3g}"),
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


def lies_on_ground(building: Building) -> bool:
    """Return whether a building has no model because its outline lies bare."""
    return building.status is Status.NO_BUILDING or Doubt.BARE_GROUND.value in building.detail
