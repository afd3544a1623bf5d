"""The buildings of an update: earlier ones, and those of new footprints."""

from __future__ import annotations

import dataclasses
import functools
import json
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..city.plan.frame import AreaFrame, plan_bounds
from ..city.plan.overlap import check_overlap
from ..city.plan.prepare import read_requested_footprints
from ..city.plan.registration import register_footprints
from ..city.plan.work_plan import Job, make_job
from ..errors import InputWarning
from ..geometry.components import label_components
from ..masking import mask
from ..model import Footprint
from ..parametric.building import read_passage
from ..parametric.record import polygon, read_outline, read_shift
from ..settings import Settings
from ..write.files import atomic
from ..write.values import dump
from .earlier import EarlierRun
from .request import UpdateRequest

LINKED_SHARE, LINKED_M2 = 0.1, 2.0
"""Share of the smaller outline, and area (m2), that two have in common where they are linked.
Neighbours overlap by less, as footprints of two sources are drawn."""

PAIR_SHARE = 0.7
"""Intersection over union from which on two among several on both sides are one building."""

SAME_OUTLINE = 0.9
"""Intersection over union from which on an outline was drawn again rather than changed."""

SHARE_DIGITS = 6  # of these shares: the last bits decide nothing


@dataclass(frozen=True)
class Successor:
    """What a new footprint is.

    It is one earlier building, or the successor of some, or a new one. `earlier` is the number of
    the earlier building, -1 for none. `is_same_outline` says whether the earlier outline stands.
    `predecessors` are numbers of earlier buildings that were split or merged.
    """

    earlier: int = -1
    is_same_outline: bool = False
    predecessors: tuple[int, ...] = ()


def match_outlines(old: list[shapely.Polygon], new: list[shapely.Polygon]) -> list[Successor]:
    """Return what each of the `new` outlines is."""
    links, shares = link_outlines(old, new)
    labels = label_components(len(old) + len(new), np.stack([links[0], links[1] + len(old)]))
    members_old = group_members(labels[: len(old)])
    members_new = group_members(labels[len(old) :])
    share_of = {(int(i), int(j)): float(s) for i, j, s in zip(*links, shares, strict=True)}
    result = [Successor()] * len(new)
    for label, after in members_new.items():
        before = members_old.get(label, [])
        for j, successor in zip(after, match_group(before, after, share_of), strict=True):
            result[j] = successor
    return result


def link_outlines(
    old: list[shapely.Polygon], new: list[shapely.Polygon]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the links (2, k) of old and new outlines, and their overlaps (k,).

    An overlap is an intersection over union.
    """
    first, second = np.array(old, object), np.array(new, object)
    j, i = shapely.STRtree(first).query(second, predicate="intersects")
    common = shapely.area(shapely.intersection(first[i], second[j]))
    areas = shapely.area(first)[i], shapely.area(second)[j]
    linked = (common >= LINKED_SHARE * np.minimum(*areas)) & (common >= LINKED_M2)
    shares = np.round(common / np.maximum(areas[0] + areas[1] - common, 1e-9), SHARE_DIGITS)
    order = np.lexsort([j[linked], i[linked]])
    return np.stack([i[linked][order], j[linked][order]]), shares[linked][order]


def compute_overlap(first: shapely.Geometry, second: shapely.Geometry) -> float:
    """Return the intersection over union of two outlines."""
    common = shapely.intersection(first, second).area
    return float(common / max(first.area + second.area - common, 1e-9))


def group_members(labels: np.ndarray) -> dict[int, list[int]]:
    """Return the members of each component."""
    result: dict[int, list[int]] = {}
    for member, label in enumerate(labels.tolist()):
        result.setdefault(label, []).append(member)
    return result


def match_group(
    before: list[int], after: list[int], share_of: dict[tuple[int, int], float]
) -> list[Successor]:
    """Return what each outline `after` is, among the linked ones `before`."""
    pairs: dict[int, int] = {}
    if len(before) == len(after) == 1:
        pairs[after[0]] = before[0]
    else:
        least = PAIR_SHARE if min(len(before), len(after)) > 1 else SAME_OUTLINE
        ranked = sorted((-share_of.get((i, j), 0.0), i, j) for i in before for j in after)
        for share, i, j in ranked:
            if -share >= least and j not in pairs and i not in pairs.values():
                pairs[j] = i
    result = []
    for j in after:
        if j in pairs:
            is_same = share_of.get((pairs[j], j), 0.0) >= SAME_OUTLINE
            result.append(Successor(pairs[j], is_same))
        else:
            taken = set(pairs.values())
            others = (i for i in before if (i, j) in share_of and i not in taken)
            result.append(Successor(predecessors=tuple(others)))
    return result


EARLIER_FILE = "earlier.jsonl"


@dataclass(frozen=True)
class UpdateMember:
    """A building of an update: its outline, and the earlier building that it is.

    The outline lies on its roof. `record` is the earlier building's object of parameters.jsonl,
    None for a new building. `is_same_outline` says whether its outline stands, `predecessors` are
    ids of buildings that were split or merged, and `shift` (m) is how far the footprint was moved
    onto the outline. `ended` are the objects of the predecessors, of which the first successor
    alone keeps them.
    """

    id: str
    outline: shapely.Polygon
    attributes: dict[str, Any]
    record: dict[str, Any] | None = None
    is_same_outline: bool = True
    predecessors: tuple[str, ...] = ()
    shift: tuple[float, float] = (0.0, 0.0)
    ended: tuple[dict[str, Any], ...] = ()

    @staticmethod
    def read(values: dict[str, Any], job: Job) -> UpdateMember:
        """Read the member of a job from what `save_members` kept of it."""
        attributes = job.footprint.attributes if job.footprint else {}
        return UpdateMember(
            job.id,
            job.area,
            attributes,
            values["record"],
            values["is_same_outline"],
            tuple(values["predecessors"]),
            tuple(values["shift"]),
            tuple(values["ended"]),
        )

    def make_job(self, index: int) -> Job:
        """Make the job of the member, with the passages that led through it before."""
        passages = read_passages(self.record or {})
        footprint = Footprint(self.id, self.outline, self.attributes, passages=passages)
        return make_job(index, footprint, (0.0, 0.0))


def read_passages(record: dict[str, Any]) -> tuple[tuple[shapely.Polygon, float], ...]:
    """Read the passages of an earlier object: polygons in the world, clearances."""
    above_ground = [
        read_passage(item, f"passage {k}", record["z_ground"])
        for k, item in enumerate(record.get("passages") or ())
    ]
    return tuple(
        (shapely.transform(p.outline, lambda xy: xy + record["origin"][:2]), p.ceiling)
        for p in above_ground
    )


def make_members(
    request: UpdateRequest,
    earlier: EarlierRun,
    frame: AreaFrame,
    headers: list,
    settings: Settings,
) -> tuple[UpdateMember, ...]:
    """Return the buildings of an update.

    Without new footprints they are the earlier ones. With them these come first, and then what
    they replace nothing of. New footprints are registered to the new roofs, and where these are few
    also to the earlier outlines: how far those were moved says nothing of them.
    """
    kept = [keep_member(record) for record in earlier.records]
    if not request.footprints:
        return tuple(kept)
    footprints = read_requested_footprints(request, frame, where=None, bbox=None)
    footprints = leave_out_copies(footprints, request.footprints)
    bounds = frame.units.to_metres(plan_bounds(headers))
    check_overlap(footprints, bounds, frame.footprints, frame.cloud, frame.units)
    old = [member.outline for member in kept]
    registration = register_footprints(
        footprints,
        headers,
        frame.units,
        settings,
        request.footprints,
        functools.partial(is_known_shift, old, footprints),
    )
    shift = registration.shift if registration else (0.0, 0.0)
    drawn = move_outlines(footprints, shift)
    successors = match_outlines(old, drawn)
    successors = [
        dataclasses.replace(s, is_same_outline=s.is_same_outline or is_known(kept, s, footprint))
        for s, footprint in zip(successors, footprints, strict=True)
    ]
    used = {s.earlier for s in successors} | {i for s in successors for i in s.predecessors}
    others = [member for i, member in enumerate(kept) if i not in used]
    if request.id_attribute:
        warn_of_other_ids(kept, successors, footprints, request.footprints)
    names = {member.id for member in others} | {
        kept[s.earlier].id for s in successors if s.earlier >= 0
    }
    result: list[UpdateMember] = []
    for footprint, outline, successor in zip(footprints, drawn, successors, strict=True):
        member = replace_member(footprint, outline, successor, kept, shift, names)
        known = {id for earlier in result for id in earlier.predecessors}
        ended = [kept[i].record for i in successor.predecessors if kept[i].id not in known]
        result.append(dataclasses.replace(member, ended=tuple(filter(None, ended))))
        names.add(member.id)
    return (*result, *others)


def move_outlines(
    footprints: tuple[Footprint, ...], shift: tuple[float, float]
) -> list[shapely.Polygon]:
    return [shapely.transform(f.polygon, lambda xy: xy + shift) for f in footprints]


def is_known_shift(
    old: list[shapely.Polygon], footprints: tuple[Footprint, ...], shift: tuple[float, float]
) -> bool:
    """Return whether footprints lie on `old` outlines, those of roofs, once they are moved."""
    still, moved = (match_outlines(old, move_outlines(footprints, s)) for s in ((0.0, 0.0), shift))
    n_still, n_moved = (sum(s.is_same_outline for s in found) for found in (still, moved))
    return n_moved > max(2 * n_still, sum(s.earlier >= 0 for s in moved) // 2)


def warn_of_other_ids(
    kept: list[UpdateMember],
    successors: list[Successor],
    footprints: tuple[Footprint, ...],
    path: str,
) -> None:
    """Warn of footprints whose ids are those of other earlier buildings than they lie on."""
    known = {member.id for member in kept}
    pairs = [
        (footprint.id, kept[successor.earlier].id)
        for successor, footprint in zip(successors, footprints, strict=True)
        if successor.earlier >= 0 and footprint.id in known - {kept[successor.earlier].id}
    ]
    if pairs:
        given, found = pairs[0]
        warnings.warn(
            f"{mask(path)}: {len(pairs)} of {len(footprints)} footprints lie on another building "
            f"than the one with their id, the first, {given:.80}, on {found:.80}. Buildings keep "
            "the ids of the run; check that the footprints are of the same place and CRS",
            InputWarning,
        )


def leave_out_copies(footprints: tuple[Footprint, ...], path: str) -> tuple[Footprint, ...]:
    """Return footprints without copies of others: these are the same buildings."""
    result = tuple(f for f in footprints if "copy_of" not in f.attributes)
    if len(result) < len(footprints):
        warnings.warn(
            f"{mask(path)}: {len(footprints) - len(result)} copies of other footprints are left "
            "out; they are the same buildings",
            InputWarning,
        )
    return result


def is_known(kept: list[UpdateMember], successor: Successor, footprint: Footprint) -> bool:
    """Return whether a footprint is the earlier building's, before it was moved."""
    if successor.earlier < 0:
        return False
    member = kept[successor.earlier]
    outline = shapely.transform(member.outline, lambda xy: xy - member.shift)
    return compute_overlap(outline, footprint.polygon) >= SAME_OUTLINE


def keep_member(record: dict[str, Any]) -> UpdateMember:
    """Return the building of an earlier object.

    Its outline lies on its roof already.
    """
    outline = read_outline(record)
    if outline is None:
        rings = record.get("outline")
        outline = shapely.Polygon() if rings is None else polygon(rings, "outline")
    shift = read_shift(record) if record.get("parts") else (0.0, 0.0)
    return UpdateMember(record["id"], outline, record.get("attributes") or {}, record, shift=shift)


def replace_member(
    footprint: Footprint,
    outline: shapely.Polygon,
    successor: Successor,
    kept: list[UpdateMember],
    shift: tuple[float, float],
    names: set[str],
) -> UpdateMember:
    """Return the building of a new footprint, whose `outline` lies on its roof.

    One that is an earlier building keeps its id. Another has its own, or a further one where that
    is among the `names` that are taken.
    """
    if successor.earlier >= 0:
        member = kept[successor.earlier]
        if successor.is_same_outline:
            return dataclasses.replace(member, attributes=footprint.attributes)
        return dataclasses.replace(
            member,
            outline=outline,
            attributes=footprint.attributes,
            is_same_outline=False,
            shift=shift,
        )
    predecessors = tuple(kept[i].id for i in successor.predecessors)
    id, number = footprint.id, 2
    while id in names:
        id, number = f"{footprint.id}-{number}", number + 1
    return UpdateMember(id, outline, footprint.attributes, None, False, predecessors, shift)


def save_members(state: Path, members: tuple[UpdateMember, ...]) -> None:
    """Keep the members for the workers; their outlines stand in the plan."""
    names = ("record", "is_same_outline", "predecessors", "shift", "ended")
    lines = [dump({name: getattr(member, name) for name in names}) for member in members]
    with atomic(state / EARLIER_FILE) as temporary:
        Path(temporary).write_bytes(b"".join(line + b"\n" for line in lines))


def load_members(state: Path) -> list[dict[str, Any]]:
    """Load what was kept of the members by number, once a process."""
    path = state / EARLIER_FILE
    return load_lines(path, path.stat().st_mtime_ns)


@functools.lru_cache(maxsize=1)
def load_lines(path: Path, stamp: int) -> list[dict[str, Any]]:
    """Load the objects at `path`, whose file has the time `stamp`."""
    with path.open(encoding="utf-8") as lines:
        return [json.loads(line) for line in lines]
