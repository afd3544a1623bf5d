"""A run's own folder.

It is opened, compared with the request, and resumed or begun anew.
"""

from __future__ import annotations

import json
import secrets
import shutil
import sqlite3
import time
import warnings
from collections.abc import Callable
from pathlib import Path

from ... import __version__
from ...errors import OutputError, OutputWarning
from ...formats import FORMATS
from ...log import LOGGER, count_things
from ...masking import masked_values
from ...write.files import atomic
from ..merge.join import remove_tiles, tile_parts, whole_files
from ..merge.outputs import broken_claims
from ..plan.from_cloud import Progress
from ..plan.overrides import REDO, settle_overrides
from ..plan.prepare import make_plan
from ..plan.work_plan import PLAN_FILE, WorkPlan
from ..request import Request
from ..work import noted
from ..work.bundle_folders import remove_bundles
from .changed import take_over
from .ledger import Ledger, Task
from .marks import compute_mark, describe_inputs, describe_selection, find_changed_files

STATE_FOLDER = ".hiproof"  # in the output folder: the run's own folder

LEDGER_BYTES = 200_000  # of an empty one with its journal; where less is free that is what ails it


def open_state(out: Path) -> Path:
    """Return the run's own folder inside the output folder.

    It is made if need be.
    """
    state = Path(out) / STATE_FOLDER
    try:
        state.mkdir(parents=True, exist_ok=True)
        (state / "tiles").mkdir(exist_ok=True)
        (state / "points").mkdir(exist_ok=True)
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
            raise OutputError(
                f"expected to write the ledger in {state}, got: {error}; free some space, the same "
                "command then goes on"
            ) from error
        raise OutputError(
            f"expected the ledger of a run of this version in {state}, got: {error}; begin anew "
            "with --restart, or "
            "choose another --out"
        ) from error
    return ledger


def resume_or_plan(
    request: Request,
    state: Path,
    ledger: Ledger,
    progress: Progress,
    plan_maker: Callable[[Request, Progress], WorkPlan] = make_plan,
) -> WorkPlan:
    """Return the plan of an earlier run of the same request, or a new one.

    The earlier one holds where its files stand as it left them. Where the footprints changed since,
    the new one takes over what is known of the others.
    """
    new_items = False
    plan = None if request.restart else plan_to_go_on(request, state, ledger)
    if plan is None or ledger.get("choice") != compute_mark(
        describe_selection(request), ledger.get("salt") or ""
    ):
        old, plan = plan, plan_maker(request, progress)
        new_items = old is None or not take_over(plan, old, state, ledger)
        if new_items:
            begin(plan, request, state, ledger)
        enter(request, ledger)
    settle_overrides(request.overrides, plan, state, ledger, is_new=new_items)
    if ledger.open_tasks("solve") and not any((state / "points").iterdir()):
        # somebody made room: without points, the buildings that are left would come out as ones
        # that have none
        ledger.sort_again()
    LOGGER.info(
        "version %s %s in %s: %s in %s",
        __version__,
        "begins" if new_items else "goes on",
        request.out,
        count_things(len(plan.jobs), "building"),
        count_things(len(plan.tiles), "work tile"),
    )
    return plan


def plan_to_go_on(request: Request, state: Path, ledger: Ledger) -> WorkPlan | None:
    """Return the plan of the run in the folder that may resume, or None.

    Raises OutputError for another's.
    """
    inputs = describe_inputs(request)
    if ledger.get("mark") is None or not (is_of(inputs, ledger) or is_begun(ledger)):
        return None
    refuse_other_inputs(request.out, inputs, ledger)
    if not stands(request.out, ledger):
        return None
    plan = WorkPlan.load(state / PLAN_FILE)
    refuse_other_operations(request.out, plan)
    return plan if ledger.get("merged") != "yes" or has_parts(plan, state) else None


def begin(plan: WorkPlan, request: Request, state: Path, ledger: Ledger) -> None:
    """Put the run on `plan`, with nothing done yet."""
    remove_unrequested(plan, Path(request.out), ledger)
    forget(state, ledger)
    with atomic(state / PLAN_FILE) as temporary:
        plan.save(Path(temporary))
    ledger.add_tasks([Task(f"sort:{i}", "sort", 0) for i in range(len(request.clouds))])
    ledger.add_tasks(
        [Task(f"solve:{tile}", "solve", len(members)) for tile, members in plan.tiles.items()]
    )


def enter(request: Request, ledger: Ledger) -> None:
    """Enter whose run it is, which makes it one to go on from."""
    inputs, salt = describe_inputs(request), secrets.token_hex(16)
    text = json.dumps(masked_values(inputs), default=str)
    marks = {
        "mark": compute_mark(inputs, salt),
        "choice": compute_mark(describe_selection(request), salt),
    }
    ledger.set(inputs=text, salt=salt, started=str(time.time()), **marks)


def is_of(inputs: dict, ledger: Ledger) -> bool:
    """Return whether the run in the folder is that of these inputs."""
    return ledger.get("mark") == compute_mark(inputs, ledger.get("salt") or "")


def is_begun(ledger: Ledger) -> bool:
    """Return whether any task is done.

    A run that ended before, by a wrong setting, is nothing to keep.
    """
    return any(task.state == "done" for task in ledger.tasks())


def refuse_other_inputs(out: Path, inputs: dict, ledger: Ledger) -> None:
    """Raise OutputError where the folder holds a run of another request.

    The error names what differs.
    """
    if is_of(inputs, ledger):
        return
    old_inputs, new_inputs = (
        json.loads(ledger.get("inputs") or "{}"),
        json.loads(json.dumps(masked_values(inputs), default=str)),
    )
    other = [
        name + find_changed_files(new_inputs.get(name), old_inputs.get(name))
        for name in new_inputs | old_inputs
        if new_inputs.get(name) != old_inputs.get(name)
    ]
    raise OutputError(
        f"expected {out} to be new or to hold a run of the same inputs, settings and version, got "
        "a run that differs in "
        f"{', '.join(other) or 'the part of an address that is masked'}; choose another --out, or "
        "begin anew with --restart"
    )


def refuse_other_operations(out: Path, plan: WorkPlan) -> None:
    """Raise OutputError where PROJ transforms coordinates in another way.

    That is another way than when the run was planned.
    """
    from ...read.operations import is_current

    changed = [operation for operation in plan.operations if not is_current(operation)]
    if changed:
        raise OutputError(
            f"expected PROJ to transform {changed[0].subject} in {out} as before "
            f"({changed[0].name}), got another operation: "
            "a grid was installed or removed since; choose another --out, or begin anew with "
            "--restart"
        )


def stands(out: Path, ledger: Ledger) -> bool:
    """Return whether a run may resume from what exists.

    It may not where files of a finished run were removed or changed since.
    """
    broken = broken_claims(ledger.claims(), Path(out)) if ledger.get("merged") == "yes" else []
    if broken:
        names = ", ".join(broken[:5]) + (" and others" if len(broken) > 5 else "")
        warnings.warn(
            f"{out}: {names} is gone or not as the run left it; all is made again", OutputWarning
        )
    return not broken


def has_parts(plan: WorkPlan, state: Path) -> bool:
    """Return whether the texts of all work tiles still exist."""
    return all(tile_parts(state, tile).exists() for tile in plan.tiles)


def remove_unrequested(plan: WorkPlan, out: Path, ledger: Ledger) -> None:
    """Remove files that an earlier run wrote and this one will not.

    They would pass for its own.
    """
    earlier, requested = {claim.name for claim in ledger.claims()}, whole_files(plan, out).values()
    for name in (format.file for format in FORMATS.values() if format.fragment):
        if name in earlier and out / name not in requested:
            (out / name).unlink(missing_ok=True)


def forget(state: Path, ledger: Ledger) -> None:
    """Drop all state of an earlier run in this folder.

    Output files that this run will replace stay until then.
    """
    remove_tiles(state.parent)
    remove_bundles(state.parent)
    ledger.forget()
    (state / REDO).unlink(missing_ok=True)
    for name in ("tiles", "points", noted.NOTED_FOLDER):
        shutil.rmtree(state / name, ignore_errors=True)
        (state / name).mkdir()
