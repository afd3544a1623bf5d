"""The main job over an area: plan, sort, solve, merge.

Each step resumes where an earlier run stopped.
"""

from __future__ import annotations

import functools
import json
import logging
import shutil
import sqlite3
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import __version__
from ..errors import InputError, OutputError
from ..evaluate.overview import Overview
from ..formats import list_model_paths
from ..frames import METRES, Units
from ..garbage import collect_rarely
from ..log import LOGGER, count_things
from ..masking import mask, masked_values
from ..progress import show_in_notebook
from ..read.decoded import forget_points, hold_points
from ..stages.recognise import asks_network, fits_one
from ..status import Doubt, Status
from ..write.files import atomic
from ..write.head import FileHead
from .folder.ledger import Failure, Ledger
from .folder.lock import hold_folder
from .folder.resume import open_ledger, open_state, resume_or_plan
from .merge.join import merge, output_files
from .merge.outputs import claims
from .plan.checks import refuse_unusable
from .plan.from_cloud import Progress
from .plan.from_overture import choose_footprints, read_source
from .plan.overrides import REDO, load_redo
from .plan.prepare import make_plan
from .plan.work_plan import WorkPlan
from .request import Request
from .work import solved
from .work.bundle_folders import find_bundle_folder, remove_bundles
from .work.cores import as_many_as_pay
from .work.executors import Arguments, Executor, Outcome, make_executor
from .work.quarantine import is_loss, run_isolated, solve_in_quarantine
from .work.tasks import (
    MAIN_JOB,
    ONE_PRIMITIVE,
    RECOGNISING,
    WITHOUT_FOOTPRINTS,
    solve_tile,
    sort_cloud,
)

MOST_LOSSES = 3  # deaths of its process until a task is tried alone: two may be a neighbour's doing


@dataclass(frozen=True)
class Summary:
    """The result of a run.

    It says where the models are, how many buildings were modelled and how well, counts buildings by
    status and type, and names input that could not be used, with the seconds of each step.
    """

    models: tuple[Path, ...]
    overview: Overview
    by_status: dict[str, int]
    by_type: dict[str, int]
    broken_inputs: tuple[tuple[str, str], ...]
    failures: tuple[Failure, ...]
    seconds: dict[str, float]
    units: Units = METRES
    doubts: dict[Doubt, int] = field(default_factory=dict)
    bundles: Path | None = None  # where the input of failed buildings is kept
    by_quality: dict[str, int] = field(default_factory=dict)

    @property
    def buildings(self) -> int:
        """All buildings, modelled or not."""
        return self.overview.buildings

    @property
    def exit_code(self) -> int:
        """The exit code of the run.

        0 is for all modelled or explained by their data, 1 for an internal error, 2 for input that
        could not be read.
        """
        if self.by_status.get("internal_error"):
            return 1
        return 2 if self.broken_inputs else 0


def reconstruct_area(request: Request, progress: Progress | None = None) -> Summary:
    """Reconstruct every building of an area into `request.out`.

    The package's docstring has the steps.

    Raises InputError, SettingsError or OutputError (full sentences) when the run cannot start or go
    on, or when another one works in that folder; what was done so far stays, and the same call goes
    on from there. Without `progress`, which is called with a step, how much of it is done and how
    much there is, a notebook shows bars.
    """
    if progress is None:
        with show_in_notebook("plan") as update:
            return reconstruct_area(request, update)
    refuse_unusable(request)
    state = open_state(request.out)
    with hold_folder(state), collect_rarely():
        return reconstruct_in_folder(request, state, progress)


@dataclass(frozen=True)
class Steps:
    """The steps in which a reconstruction and an update differ.

    `before` is called with the plan, the executor and the progress before tiles are solved, and
    `make_head` with the plan before their buildings are joined.
    """

    make_plan: Callable[[Any, Progress], WorkPlan] = make_plan
    solve_tile: Callable[..., Any] = solve_tile
    sort_cloud: Callable[..., Any] = sort_cloud
    before: Callable[[WorkPlan, Any, Progress], None] = lambda *_: None
    make_head: Callable[[WorkPlan], FileHead] = lambda plan: plan.head


def reconstruct_in_folder(
    request: Request, state: Path, progress: Progress, steps: Steps | None = None
) -> Summary:
    """Run the steps of a run that has its folder `state` to itself."""
    steps = steps or Steps(solve_tile=solve_tile, sort_cloud=sort_cloud)
    clock = Clock()
    executor = make_executor(request.processes or 1, request.scheduler)
    ledger = open_ledger(state, request.restart)
    try:
        if ledger.get("merged") != "yes":
            executor.start()
        with hold_points():  # for the step that sorts them
            plan = resume_or_plan(request, state, ledger, progress, steps.make_plan)
        if request.processes is None and not request.scheduler:
            executor = make_executor(count_processes(request, plan, state, ledger))
        clock.lap("plan")
        if ledger.open_tasks("sort") or ledger.open_tasks("solve"):
            executor.prepare(list_compiled_pieces(request))
        clock.lap("prepare")
        arguments = functools.partial(task_arguments, request, state)
        work_off(ledger, executor, "sort", steps.sort_cloud, arguments, progress)
        forget_points()
        refuse_without_points(plan, ledger)
        clock.lap("sort")
        if ledger.open_tasks("solve"):
            steps.before(plan, executor, progress)
        work_off(ledger, executor, "solve", steps.solve_tile, arguments, progress)
        clock.lap("solve")
        if ledger.get("merged") != "yes":
            merge(plan, steps.make_head(plan), state, Path(request.out), progress)
        remove_bundles(Path(request.out), ledger.failed_ids())
        summary = summarise(request, plan, ledger, clock)
        LOGGER.info(
            "%s: %s; seconds: %s",
            count_things(summary.buildings, "building"),
            summary.by_status,
            summary.seconds,
        )
        write_run_record(request, plan, summary)
        if ledger.get("merged") != "yes":
            ledger.claim(claims(output_files(plan, Path(request.out)), Path(request.out)))
        clean(state)
        return summary
    except sqlite3.OperationalError as error:
        raise OutputError(
            f"expected to write the ledger in {state}, got: {error}; free some space, the same "
            "command then goes on"
        ) from error
    finally:
        forget_points()
        executor.close()
        with suppress(sqlite3.Error):
            ledger.interrupt()
        ledger.close()


def count_processes(request: Request, plan: WorkPlan, state: Path, ledger: Ledger) -> int:
    """Return as many processes as pay for the buildings left to do."""
    remainder, redo = (
        [name.partition(":")[2] for name in ledger.open_tasks("solve")],
        load_redo(state),
    )
    buildings = sum(len(redo.get(tile, plan.tiles[tile])) for tile in remainder)
    return as_many_as_pay(buildings, len(remainder), request.footprints is not None)


def list_compiled_pieces(request: Request) -> tuple[str, ...]:
    """Return the pieces of compiled code that the run needs."""
    besides = RECOGNISING if asks_network(request.settings) else ()
    if request.footprints is None:
        return (*WITHOUT_FOOTPRINTS, *besides)
    return (*(ONE_PRIMITIVE if fits_one(request.settings) else MAIN_JOB), *besides)


class Clock:
    """Seconds by step."""

    def __init__(self) -> None:
        self.start = time.perf_counter()
        self.seconds: dict[str, float] = {}

    def lap(self, step: str) -> None:
        current = time.perf_counter()
        self.seconds[step], self.start = round(current - self.start, 3), current


def work_off(
    ledger: Ledger,
    executor: Executor,
    kind: str,
    function: Callable[..., Any],
    arguments: Callable[[str], Arguments],
    progress: Progress,
) -> None:
    """Run all open tasks of a kind.

    One whose process dies is tried again, and after MOST_LOSSES alone.

    `arguments` are those of `function` by the name of a task.
    """
    sizes = {
        task.name: task.buildings if kind == "solve" else 1
        for task in ledger.tasks()
        if task.kind == kind
    }
    tally = Tally(kind, sum(sizes.values()), progress)
    while names := ledger.open_tasks(kind):
        tally.reach(tally.total - sum(sizes[name] for name in names))
        suspects = [name for name in names if ledger.losses(name) >= MOST_LOSSES]
        for name in suspects:
            run_task_isolated(ledger, executor, kind, name, function, arguments(name))
        tasks = iterate_started(
            ledger, [name for name in names if name not in set(suspects)], arguments
        )
        for task, result, error in tally.listen(executor.run(function, tasks)):
            name = f"{kind}:{task[1]}"
            if is_loss(error):
                ledger.lose(name)
                LOGGER.warning(
                    "%s was lost (%s) and is tried again", name, error or "out of memory"
                )
                continue
            record(ledger, kind, name, result, error)
            tally.reach(tally.ended + sizes[name])


class Tally:
    """How much is done of a kind of tasks.

    That is what the tasks that ended hold, and the buildings counted since.
    """

    def __init__(self, kind: str, total: int, progress: Progress):
        self.kind, self.total, self.progress = kind, total, progress
        self.ended = self.counted = 0

    def reach(self, ended: int) -> None:
        """Say that tasks with so many buildings have ended."""
        self.ended, self.counted = ended, max(self.counted, ended)
        self.progress(self.kind, min(self.counted, self.total), self.total)

    def count(self, number: int) -> None:
        """Say that so many more buildings are solved, of tasks that go on."""
        self.counted += number
        self.progress(self.kind, min(self.counted, self.total), self.total)

    def listen(self, outcomes: Iterator[Outcome]) -> Iterator[Outcome]:
        """Yield the outcomes of tasks, and count the buildings that are solved meanwhile."""
        solved.listener = self.count
        try:
            yield from outcomes
        finally:
            solved.listener = solved.ignore


def iterate_started(
    ledger: Ledger, names: list[str], arguments: Callable[[str], Arguments]
) -> Iterator[Arguments]:
    """Yield the tasks' arguments, and record each as running.

    That happens when an executor takes it.
    """
    for name in names:
        ledger.start(name)
        yield arguments(name)


def task_arguments(request: Request, state: Path, name: str) -> Arguments:
    """Return the arguments of a task.

    They are the run's folder, the number or name of what it works on, and the address that it
    reads.
    """
    kind, key = name.split(":", 1)
    folder = str(state.absolute())
    if kind == "sort":
        return folder, int(key), absolute(request.clouds[int(key)])
    return folder, key, request.terrain and absolute(request.terrain)


def absolute(name: str) -> str:
    """Return a path that means the same to a worker started elsewhere.

    Addresses stay as they are.
    """
    return name if "://" in name or name.startswith("/vsi") else str(Path(name).absolute())


def record(ledger: Ledger, kind: str, name: str, result: Any, error: Exception | None) -> None:
    """Enter a finished task.

    Only unreadable point files may fail; any other error ends the run with what is done kept.
    """
    if error is None:
        if kind == "sort":
            ledger.finish(name, "done", json.dumps(result))
        else:
            ledger.finish(name, "done", "", result)
            for outcome in result:
                level = (
                    logging.ERROR if outcome.status == Status.INTERNAL_ERROR.code else logging.DEBUG
                )
                LOGGER.log(level, "building %s: %s", outcome.id, outcome.detail)
        LOGGER.info(
            "%s is done: %s",
            name,
            count_things(len(result), "building") if kind == "solve" else result,
        )
    elif kind == "sort" and isinstance(error, InputError):
        ledger.finish(name, "failed", str(error))
        LOGGER.error("a point file could not be read: %s", error)
    else:
        raise error


def run_task_isolated(
    ledger: Ledger,
    executor: Executor,
    kind: str,
    name: str,
    function: Callable[..., Any],
    task: Arguments,
) -> None:
    """Run a task whose process kept dying in a process of its own.

    See quarantine.py.
    """
    LOGGER.warning(
        "%s was lost %s and is now tried alone", name, count_things(ledger.losses(name), "time")
    )
    with closing(executor.isolate()) as single:
        result, error = (solve_in_quarantine if kind == "solve" else run_isolated)(
            single, function, task
        )
    if is_loss(error):
        died = "the process died each time it read this file; not enough memory, or a damaged file"
        ledger.finish(name, "failed", died)
    else:
        record(ledger, kind, name, result, error)


def refuse_without_points(plan: WorkPlan, ledger: Ledger) -> None:
    """Raise InputError when no file holds usable points.

    None could be read, or none holds a point of the building classes.

    A run that goes on is past the second: it may have read a few runs of points alone, near what it
    does again.
    """
    tasks = [task for task in ledger.tasks() if task.kind == "sort"]
    failed = [task.message for task in tasks if task.state == "failed"]
    if tasks and len(failed) == len(tasks):
        raise InputError(
            failed[0]
            if len(failed) == 1
            else f"none of the {len(tasks)} point files could be read; first: {failed[0]}"
        )
    if ledger.counts("status"):
        return
    classes: Counter[int] = Counter()
    for task in tasks:
        if task.state == "done":
            classes.update({int(c): n for c, n in json.loads(task.message)["classes"].items()})
    building_classes = plan.settings.read.building_classes
    if sum(classes.values()) and not any(classes[c] for c in building_classes):
        present = ", ".join(f"{c} ({count_things(n, 'point')})" for c, n in sorted(classes.items()))
        raise InputError(
            f"expected points of building class {', '.join(map(str, building_classes))}, got "
            "classes "
            f"{present}; "
            "say which class holds roofs with --building-class"
        )


def summarise(request: Request, plan: WorkPlan, ledger: Ledger, clock: Clock) -> Summary:
    clock.lap("merge")
    failed = [task for task in ledger.tasks() if task.state == "failed"]
    broken = tuple((request_name(task.name, request), task.message) for task in failed)
    return Summary(
        models=tuple(list_model_paths(plan.settings, Path(request.out))),
        overview=ledger.overview(),
        by_status=ledger.counts("status"),
        by_type=ledger.counts("type"),
        broken_inputs=broken,
        failures=tuple(ledger.failures()),
        seconds=clock.seconds,
        units=plan.head.units.gml,
        doubts=ledger.doubts(),
        bundles=find_bundle_folder(Path(request.out)),
        by_quality=ledger.counts("quality"),
    )


def request_name(task: str, request: Request) -> str:
    kind, key = task.split(":", 1)
    return mask(request.clouds[int(key)]) if kind == "sort" else task


def write_run_record(request: Request, plan: WorkPlan, summary: Summary) -> None:
    """Write run.json: version, settings, inputs, counts and timings.

    It is the only file of a run that knows the time.
    """
    footprints = choose_footprints(request)
    record = {
        "hiproof": __version__,
        "settings": plan.settings.to_dict(),
        "inputs": {
            "clouds": list(request.clouds),
            "footprints": footprints,
            "layer": request.layer,
            "id_attribute": request.id_attribute,
            "where": request.where,
            "bbox": request.bbox,
            "terrain": request.terrain,
            "overrides": request.overrides,
            **({"underpasses": request.underpasses} if request.underpasses else {}),
            "started_in": str(Path.cwd()),  # what is not an address or absolute is meant from there
        },
        "footprints_source": read_source(footprints),
        "crs": plan.crs_wkt,
        "transformations": [operation.to_dict() for operation in plan.operations],
        "registration": plan.registration and plan.registration.to_dict(),
        "units": plan.head.units.describe(),
        "processes": request.processes,
        "summary": summary.overview.to_dict(),
        "by_status": summary.by_status,
        "by_quality": summary.by_quality,
        "by_type": summary.by_type,
        "broken_inputs": [list(pair) for pair in summary.broken_inputs],
        "seconds": summary.seconds,
    }
    save_run_record(Path(request.out) / "run.json", record)


def extend_run_record(request: Request, entries: dict[str, Any]) -> None:
    """Add entries to the run.json that a run has written."""
    path = Path(request.out) / "run.json"
    save_run_record(path, json.loads(path.read_text(encoding="utf-8")) | entries)


def save_run_record(path: Path, record: dict[str, Any]) -> None:
    with atomic(path) as temporary:
        Path(temporary).write_text(
            json.dumps(masked_values(record), indent=1) + "\n", encoding="utf-8"
        )


def clean(state: Path) -> None:
    """Remove what a finished run no longer needs.

    The ledger and the plan stay for `status` and for a repeated call, the texts of the buildings
    for one with other overrides.
    """
    shutil.rmtree(state / "points", ignore_errors=True)
    (state / REDO).unlink(missing_ok=True)
