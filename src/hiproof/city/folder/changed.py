"""A run whose footprints changed since.

Results stay where the building is the same, and the rest is done.

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

from ...formats import requested_fragments
from ...log import LOGGER
from ...write.files import atomic, atomic_file
from ...write.fragments import Fragment, Fragments, load_fragments, save_fragments
from ..merge.join import remove_tiles, tile_parts, write_tile
from ..plan.overrides import REDO, load_redo
from ..plan.work_plan import OVERHANG_REACH_M, PLAN_FILE, WorkPlan, encode_passages
from .ledger import Ledger, Task


class StoredText(NamedTuple):
    """The place of a building's texts.

    It is the building's position in the old plan, its tile, and how many stand before it there.
    """

    position: int
    tile: str
    number: int


def take_over(new: WorkPlan, old: WorkPlan, state: Path, ledger: Ledger) -> bool:
    """Put the run in `state` on the plan `new`, and keep what still holds.

    All that is known of buildings that `old` has too stays. Returns whether that could be done.

    It could not where the two plans tell buildings apart, read them or write them in different
    ways.
    """
    if describe_common_inputs(new) != describe_common_inputs(old):
        return False
    places = find_stored_texts(old, state, ledger)
    selection = {
        i: places[d] for i in range(len(new.jobs)) if (d := digest_building(new, i)) in places
    }
    redo = {tile: [i for i in members if i not in selection] for tile, members in new.tiles.items()}
    redo = {tile: remainder for tile, remainder in redo.items() if remainder}
    tasks, outcomes, overrides = ledger.tasks(), ledger.outcomes(), ledger.overrides()
    ledger.forget()  # killed from here on, the run begins anew
    move_texts(new, state, selection, redo)
    with atomic(state / PLAN_FILE) as temporary:
        new.save(Path(temporary))
    if redo:
        with atomic(state / REDO) as temporary:
            Path(temporary).write_text(json.dumps(redo), encoding="utf-8")
    ledger.begin_again(
        [*select_sorting_tasks(tasks, bool(redo)), *select_solving_tasks(new, redo)],
        {i: outcomes[place.position]._replace(position=i) for i, place in selection.items()},
        {
            i: overrides[place.position]
            for i, place in selection.items()
            if place.position in overrides
        },
    )
    missing, new_items = len(old.jobs) - len(selection), len(new.jobs) - len(selection)
    LOGGER.warning(
        "the footprints changed: buildings kept: %d, gone or changed: %d, done now: %d",
        len(selection),
        missing,
        new_items,
    )
    return True


def describe_common_inputs(plan: WorkPlan) -> tuple:
    """Return what all texts of a plan have in common."""
    return plan.settings, plan.crs_wkt, plan.translate.tolist(), plan.around_m


def digest_building(plan: WorkPlan, index: int) -> str:
    """Return a digest of what a building's texts depend on.

    The points are not part of it.
    """
    job = plan.jobs[index]
    attributes = job.footprint.attributes if job.footprint else None
    inputs = [
        job.id,
        job.area.wkb_hex,
        attributes,
        plan.list_names(job),
        find_row_outlines(plan, index),
        encode_passages(job),
        *find_neighbours(plan, index),
    ]
    return hashlib.sha256(json.dumps(inputs, sort_keys=True, default=str).encode()).hexdigest()


def find_row_outlines(plan: WorkPlan, index: int) -> list[str]:
    """Return the outlines with which a building's footprint is moved."""
    return [polygon.wkb_hex for polygon in plan.outlines.row(index)] if plan.moves_rows else []


def find_neighbours(plan: WorkPlan, index: int) -> list[str]:
    """Return the outlines beside a building."""
    near = plan.outlines.select_near(index, OVERHANG_REACH_M)
    return [polygon.wkb_hex for polygon in near]


def find_stored_texts(plan: WorkPlan, state: Path, ledger: Ledger) -> dict[str, StoredText]:
    """Return the places of solved buildings' texts, by their digests."""
    names, redo = {task.name for task in ledger.tasks() if task.state == "done"}, load_redo(state)
    result = {}
    for tile, members in plan.tiles.items():
        if tile_parts(state, tile).exists():
            open_still = () if f"solve:{tile}" in names else redo.get(tile, members)
            for number, index in enumerate(members):
                if index not in open_still:
                    result[digest_building(plan, index)] = StoredText(index, tile, number)
    return result


def move_texts(
    plan: WorkPlan, state: Path, selection: dict[int, StoredText], redo: dict[str, list[int]]
) -> None:
    """Write the tiles' files anew from those that exist, and drop these.

    Points are sorted again.
    """
    previous, updated = state / "tiles", state / "tiles.new"
    shutil.rmtree(updated, ignore_errors=True)
    updated.mkdir()
    texts_of = functools.lru_cache(maxsize=8)(
        lambda tile: list(load_fragments(tile_parts(state, tile)))
    )
    remove_tiles(state.parent)
    for tile, members in plan.tiles.items():
        if any(i in selection for i in members):
            parts = [
                texts_of(selection[i].tile)[selection[i].number] if i in selection else to_do(plan)
                for i in members
            ]
            with atomic_file(updated / tile_parts(state, tile).name) as file:
                save_fragments(file, parts)
            if tile not in redo:
                write_tile(plan, state.parent, tile, parts)
    shutil.rmtree(previous)
    updated.rename(previous)
    shutil.rmtree(state / "points", ignore_errors=True)
    (state / "points").mkdir()
    (state / REDO).unlink(missing_ok=True)


def to_do(plan: WorkPlan) -> Fragments:
    """Return the placeholder in a tile's file for a building to be solved."""
    return dict.fromkeys(requested_fragments(plan.settings.write), Fragment(b""))


def select_sorting_tasks(tasks: list[Task], repeat: bool) -> list[Task]:
    """Return the tasks that sort points.

    All of them are open where buildings wait for their points.
    """
    selected_tasks = [task for task in tasks if task.kind == "sort"]
    return (
        [task._replace(state="open", losses=0) for task in selected_tasks]
        if repeat
        else selected_tasks
    )


def select_solving_tasks(plan: WorkPlan, redo: dict[str, list[int]]) -> list[Task]:
    """Return the tasks that solve tiles, open where a building is to be solved."""
    return [
        Task(f"solve:{tile}", "solve", len(members), "open" if tile in redo else "done")
        for tile, members in plan.tiles.items()
    ]
