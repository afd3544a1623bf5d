"""A run whose footprints changed since: what became of a building stays where the building is the
same, and the rest is done.

A building's answer depends on the building alone, so its texts are those of a run from the start:
they move with it to the work tile and the place that the new plan gives it.
"""

from __future__ import annotations

import functools
import hashlib
import json
import shutil
from pathlib import Path
from typing import NamedTuple

from ..formats import asked_fragments
from ..log import LOGGER
from ..write.files import atomic, atomic_file
from ..write.fragments import Fragment, Fragments, load_fragments, save_fragments
from .ledger import Ledger, Task
from .merge import remove_tiles, tile_parts, write_tile
from .overrides import REDO, load_redo
from .plan import PLAN_FILE, WorkPlan


class Place(NamedTuple):
    """Where a building's texts stand: its position in the old plan, its tile, and how many stand
    before it there.
    """

    position: int
    tile: str
    number: int


def take_over(new: WorkPlan, old: WorkPlan, state: Path, ledger: Ledger) -> bool:
    """Put the run in `state` on the plan `new`, with all that is known of buildings that `old` has
    too; whether that could be.

    It could not where the two plans tell buildings apart, read them or write them in different
    ways.
    """
    if common_of(new) != common_of(old):
        return False
    places = known_places(old, state, ledger)
    kept = {i: places[d] for i in range(len(new.jobs)) if (d := digest_of(new, i)) in places}
    redo = {tile: [i for i in own if i not in kept] for tile, own in new.tiles.items()}
    redo = {tile: left for tile, left in redo.items() if left}
    tasks, outcomes, overrides = ledger.tasks(), ledger.outcomes(), ledger.overrides()
    ledger.forget()  # killed from here on, the run begins anew
    move_texts(new, state, kept, redo)
    with atomic(state / PLAN_FILE) as beside:
        new.save(Path(beside))
    if redo:
        with atomic(state / REDO) as beside:
            Path(beside).write_text(json.dumps(redo), encoding="utf-8")
    ledger.begin_again(
        [*sorting(tasks, bool(redo)), *solving(new, redo)],
        {i: outcomes[place.position]._replace(position=i) for i, place in kept.items()},
        {i: overrides[place.position] for i, place in kept.items() if place.position in overrides},
    )
    gone, fresh = len(old.jobs) - len(kept), len(new.jobs) - len(kept)
    LOGGER.warning(
        "the footprints changed: buildings kept: %d, gone or changed: %d, done now: %d",
        len(kept),
        gone,
        fresh,
    )
    return True


def common_of(plan: WorkPlan) -> tuple:
    """What all texts of a plan have in common."""
    return plan.settings, plan.crs_wkt, plan.translate.tolist(), plan.around_m


def digest_of(plan: WorkPlan, index: int) -> str:
    """What a building's texts depend on beside the points, as a digest."""
    job = plan.jobs[index]
    attributes = job.footprint.attributes if job.footprint else None
    known = [job.id, job.area.wkb_hex, attributes, plan.names_of(job), row_of(plan, index)]
    return hashlib.sha256(json.dumps(known, sort_keys=True, default=str).encode()).hexdigest()


def row_of(plan: WorkPlan, index: int) -> list[str]:
    """The outlines that a building's footprint is moved with."""
    return [polygon.wkb_hex for polygon in plan.outlines.row(index)] if plan.moves_rows else []


def known_places(plan: WorkPlan, state: Path, ledger: Ledger) -> dict[str, Place]:
    """Where the texts of every building stand that was solved, by its digest."""
    done, left = {task.name for task in ledger.tasks() if task.state == "done"}, load_redo(state)
    found = {}
    for tile, members in plan.tiles.items():
        if tile_parts(state, tile).exists():
            open_still = () if f"solve:{tile}" in done else left.get(tile, members)
            for number, index in enumerate(members):
                if index not in open_still:
                    found[digest_of(plan, index)] = Place(index, tile, number)
    return found


def move_texts(
    plan: WorkPlan, state: Path, kept: dict[int, Place], redo: dict[str, list[int]]
) -> None:
    """Write the tiles' files anew from those that are there, and drop these; points are sorted
    again.
    """
    before, after = state / "tiles", state / "tiles.new"
    shutil.rmtree(after, ignore_errors=True)
    after.mkdir()
    texts_of = functools.lru_cache(maxsize=8)(
        lambda tile: list(load_fragments(tile_parts(state, tile)))
    )
    remove_tiles(state.parent)
    for tile, members in plan.tiles.items():
        if any(i in kept for i in members):
            parts = [
                texts_of(kept[i].tile)[kept[i].number] if i in kept else to_do(plan)
                for i in members
            ]
            with atomic_file(after / tile_parts(state, tile).name) as file:
                save_fragments(file, parts)
            if tile not in redo:
                write_tile(plan, state.parent, tile, parts)
    shutil.rmtree(before)
    after.rename(before)
    shutil.rmtree(state / "points", ignore_errors=True)
    (state / "points").mkdir()
    (state / REDO).unlink(missing_ok=True)


def to_do(plan: WorkPlan) -> Fragments:
    """What stands in a tile's file where a building is to be solved."""
    return dict.fromkeys(asked_fragments(plan.settings.write), Fragment(b""))


def sorting(tasks: list[Task], again: bool) -> list[Task]:
    """The tasks that sort points, all of them open where buildings wait for their points."""
    own = [task for task in tasks if task.kind == "sort"]
    return [task._replace(state="open", losses=0) for task in own] if again else own


def solving(plan: WorkPlan, redo: dict[str, list[int]]) -> list[Task]:
    """The tasks that solve tiles, open where a building is to be solved."""
    return [
        Task(f"solve:{tile}", "solve", len(members), "open" if tile in redo else "done")
        for tile, members in plan.tiles.items()
    ]
