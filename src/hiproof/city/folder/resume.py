"""A run's own folder: opened, compared with the request, and resumed or begun anew.

A building's answer depends on the building alone. Where its digest is the same, its texts still
hold, although footprints, overrides, the choice of buildings or the work tiles changed.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import secrets
import shutil
import sqlite3
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from ... import __version__
from ...errors import OutputError, OutputWarning
from ...formats import FORMATS, list_requested_files
from ...log import LOGGER, count_things
from ...masking import masked_values
from ...write.files import PARAMETERS, STATE_FOLDER, atomic, save_text
from ..merge.join import TEXTS_FOLDER, broken_claims, remove_tiles, write_tile
from ..plan.from_cloud import Progress
from ..plan.overrides import REDO, keep_overrides
from ..plan.prepare import make_plan
from ..plan.work_plan import PLAN_FILE, WorkPlan, encode_passages
from ..request import Request
from ..work.bundle_folders import remove_bundles
from ..work.noted import NOTED_FOLDER
from .ledger import Ledger
from .marks import RESULT, SELECTION, compute_mark, describe, find_changed_files

LEDGER_BYTES = 200_000  # of an empty one with its journal; where less is free that is what ails it


def open_state(out: Path) -> Path:
    """Return the run's own folder inside the output folder, and make it if need be."""
    state = Path(out) / STATE_FOLDER
    try:
        for name in (TEXTS_FOLDER, "points"):
            (state / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"expected a folder that can be written at {out}, got: {error}; choose another --out"
        ) from error
    return state


def open_ledger(state: Path, restart: bool) -> Ledger:
    """Open the ledger of a run.

    One that is damaged or of another version is dropped where the run begins anew.
    """
    path = state / "ledger.sqlite"
    try:
        ledger = Ledger(path)
        ledger.reopen()
    except sqlite3.Error as error:
        is_full = shutil.disk_usage(state).free < LEDGER_BYTES
        if restart and not is_full:
            for end in ("", "-wal", "-shm"):
                path.with_name(path.name + end).unlink(missing_ok=True)
            return open_ledger(state, False)
        if is_full:
            raise explain_full_disk(state, error) from error
        raise OutputError(
            f"expected the ledger of a run of this version in {state}, got: {error}; begin anew "
            "with --restart, or choose another --out"
        ) from error
    return ledger


def explain_full_disk(state: Path, error: Exception) -> OutputError:
    """Make the error for a ledger that cannot be written."""
    return OutputError(
        f"expected to write the ledger in {state}, got: {error}; free some space, the same "
        "command then goes on"
    )


def resume_or_plan(
    request: Request,
    state: Path,
    ledger: Ledger,
    progress: Progress,
    plan_maker: Callable[[Request, Progress], WorkPlan] = make_plan,
) -> WorkPlan:
    """Return the plan of an earlier run of the same request, or a new one.

    The earlier one holds where its files stand as it left them. What is known of buildings stays
    where footprints or overrides changed since, and the others are to be solved.
    """
    goes_on = not request.restart and is_resumable(request, ledger)
    chosen = compute_mark(describe(request, SELECTION), ledger.get("salt") or "")
    is_planned = goes_on and ledger.get("choice") == chosen
    plan = WorkPlan.load(state / PLAN_FILE) if goes_on else None
    if plan is not None:
        refuse_other_operations(request.out, plan)
    if plan is None or not is_planned:
        plan = plan_maker(request, progress)
        if not goes_on:
            remove_unrequested(plan, Path(request.out), ledger)
            forget(state, ledger)
        ledger.set(choice="")  # killed from here on, the next call plans again
        with atomic(state / PLAN_FILE) as temporary:
            plan.save(Path(temporary))
    overrides = keep_overrides(request.overrides, plan, state)
    settle(request, plan, overrides, state, ledger, is_planned)
    open_buildings = ledger.open_buildings()
    is_partial = sum(map(len, open_buildings.values())) < len(plan.jobs)
    save_text(state / REDO, json.dumps(open_buildings if is_partial else {}))
    if open_buildings and not any((state / "points").iterdir()):
        # somebody made room: without points, the buildings that are left would come out as ones
        # that have none
        ledger.sort_again()
    LOGGER.info(
        "version %s %s in %s: %s in %s",
        __version__,
        "goes on" if goes_on else "begins",
        request.out,
        count_things(len(plan.jobs), "building"),
        count_things(len(plan.tiles), "work tile"),
    )
    return plan


def is_resumable(request: Request, ledger: Ledger) -> bool:
    """Return whether the run in the folder is one of these inputs, and stands.

    Raises OutputError for another's.
    """
    inputs = describe(request, RESULT)
    is_of = ledger.get("mark") == compute_mark(inputs, ledger.get("salt") or "")
    # a run that ended before any task was done, by a wrong setting, is nothing to keep
    is_begun = any(task.state == "done" for task in ledger.tasks())
    if ledger.get("mark") is None or not (is_of or is_begun):
        return False
    if not is_of:
        refuse_other_inputs(request.out, inputs, ledger)
    return stands(request.out, ledger)


def settle(
    request: Request,
    plan: WorkPlan,
    overrides: dict[int, dict[str, Any]],
    state: Path,
    ledger: Ledger,
    is_planned: bool,
) -> None:
    """Put the ledger on a plan, in one transaction.

    Models of work tiles that are whole are written again where the tiles are new ones.
    """
    lost = [file for file in ledger.text_files() if not (state / TEXTS_FOLDER / file).exists()]
    with ledger.transact():
        settled = ledger.settle(list_buildings(plan, overrides), lost)
        if settled is None and is_planned:
            return
        remainder = ledger.open_buildings()
        ledger.put_tasks(
            len(request.clouds), {tile: len(members) for tile, members in plan.tiles.items()}
        )
        if not is_planned:
            remove_tiles(state.parent)
            for tile in plan.tiles.keys() - remainder.keys():
                write_tile(plan, state, tile, ledger.texts(tile))
        inputs, salt = describe(request, RESULT), secrets.token_hex(16)
        ledger.set(  # whose run it is, which makes it one to go on from
            inputs=json.dumps(masked_values(inputs), default=str),
            salt=salt,
            merged="no",
            mark=compute_mark(inputs, salt),
            choice=compute_mark(describe(request, SELECTION), salt),
        )
    if remainder:
        shutil.rmtree(state / "points", ignore_errors=True)
        (state / "points").mkdir()
    if settled is None or not settled.kept:
        return
    if not is_planned:
        text = "the footprints changed: buildings kept: %d, gone or changed: %d, done now: %d"
        LOGGER.warning(text, *settled)
    elif not lost:
        count = count_things(settled.remainder, "building")
        LOGGER.info("%s with another override than before to be redone", count)


def refuse_other_inputs(out: Path, inputs: dict, ledger: Ledger) -> None:
    """Raise OutputError for a run of another request, which names what differs."""
    old_inputs = json.loads(ledger.get("inputs") or "{}")
    new_inputs = json.loads(json.dumps(masked_values(inputs), default=str))
    other = [
        name + find_changed_files(new_inputs.get(name), old_inputs.get(name))
        for name in new_inputs | old_inputs
        if new_inputs.get(name) != old_inputs.get(name)
    ]
    raise OutputError(
        f"expected {out} to be new or to hold a run of the same inputs, settings and version, got "
        f"a run that differs in {', '.join(other) or 'the part of an address that is masked'}; "
        "choose another --out, or begin anew with --restart"
    )


def refuse_other_operations(out: Path, plan: WorkPlan) -> None:
    """Raise OutputError where PROJ transforms coordinates otherwise than when it was planned."""
    from ...read.crs.operations import is_current

    changed = [operation for operation in plan.operations if not is_current(operation)]
    if changed:
        raise OutputError(
            f"expected PROJ to transform {changed[0].subject} in {out} as before "
            f"({changed[0].name}), got another operation: a grid was installed or removed since; "
            "choose another --out, or begin anew with --restart"
        )


def stands(out: Path, ledger: Ledger) -> bool:
    """Return whether the files of a finished run are still as it left them."""
    broken = broken_claims(ledger.claims(), Path(out)) if ledger.get("merged") == "yes" else []
    if broken:
        names = ", ".join(broken[:5]) + (" and others" if len(broken) > 5 else "")
        warnings.warn(
            f"{out}: {names} is gone or not as the run left it; all is made again"
            + keep_edited(out, broken),
            OutputWarning,
        )
    return not broken


def keep_edited(out: Path, broken: list[str]) -> str:
    """Rename parameters that were changed since, perhaps by hand; returns a clause that says so."""
    path = Path(out) / PARAMETERS
    if PARAMETERS not in broken or not path.exists():
        return ""
    for number in itertools.count(1):
        kept = path.with_name(f"{path.stem}.edited-{number}{path.suffix}")
        if not kept.exists():
            break
    path.rename(kept)
    return f", and the changed {PARAMETERS} is kept as {kept.name}"


def remove_unrequested(plan: WorkPlan, out: Path, ledger: Ledger) -> None:
    """Remove files of an earlier run that would pass for those of this one."""
    of_formats = {format.file for format in FORMATS.values() if format.fragment}
    requested = {path.name for path in list_requested_files(plan.settings, out).values()}
    for name in {claim.name for claim in ledger.claims()} & of_formats - requested:
        (out / name).unlink(missing_ok=True)


def forget(state: Path, ledger: Ledger) -> None:
    """Drop all state of an earlier run in this folder.

    Output files that this run will replace stay until then.
    """
    remove_tiles(state.parent)
    remove_bundles(state.parent)
    ledger.forget()
    (state / REDO).unlink(missing_ok=True)
    for name in (TEXTS_FOLDER, "points", NOTED_FOLDER):
        shutil.rmtree(state / name, ignore_errors=True)
        (state / name).mkdir()


def list_buildings(
    plan: WorkPlan, overrides: dict[int, dict[str, Any]]
) -> Iterator[tuple[int, str, bytes]]:
    """Yield the position, the work tile and the digest of each building of a plan.

    The digest is of what a building's texts depend on, but for the points. `overrides` are those of
    its buildings by position.
    """
    common = [plan.settings.to_dict(), plan.crs_wkt, plan.translate.tolist(), plan.around_m]
    shared = make_digest(common).hex()
    for tile, members in plan.tiles.items():
        for index in members:
            job = plan.jobs[index]
            row = plan.outlines.row(index) if plan.moves_rows else []
            neighbours = plan.outlines.select_near(index, plan.beyond_m) if plan.beyond_m else []
            inputs = [
                shared,
                job.id,
                job.area.wkb_hex,
                job.footprint.attributes if job.footprint else None,
                plan.list_names(job),
                [polygon.wkb_hex for polygon in row],
                encode_passages(job),
                [polygon.wkb_hex for polygon in neighbours],
                overrides.get(index),
            ]
            yield index, tile, make_digest(inputs)


def make_digest(values: list) -> bytes:
    text = json.dumps(values, sort_keys=True, default=str)
    return hashlib.blake2b(text.encode(), digest_size=16).digest()
