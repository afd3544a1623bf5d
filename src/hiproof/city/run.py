"""The main job over an area: plan, sort, solve, merge.

Each step resumes where an earlier run stopped.
"""

from __future__ import annotations

import json
import shutil
import sqlite3
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import __version__
from ..errors import InputError
from ..evaluate.overview import Overview
from ..formats import list_model_paths
from ..frames import METRES, Units
from ..garbage import collect_rarely
from ..log import LOGGER, count_things
from ..masking import mask, masked_values
from ..progress import show_in_notebook
from ..status import Doubt
from ..write.files import save_text
from ..write.head import FileHead
from .folder.ledger import Failure, Ledger
from .folder.marks import hold_folder
from .folder.resume import explain_full_disk, open_ledger, open_state, resume_or_plan
from .merge.join import TEXTS_FOLDER, claims, list_output_files, merge
from .plan.checks import refuse_unusable
from .plan.from_cloud import Progress
from .plan.from_overture import choose_footprints, read_source
from .plan.overrides import REDO
from .plan.prepare import make_plan
from .plan.work_plan import WorkPlan
from .request import Request
from .work.bundle_folders import FAILURES_FOLDER, bundles_in, remove_bundles
from .work.cores import as_many_as_pay
from .work.executors import make_executor
from .work.queue import Queue
from .work.seams import warn_of_steps
from .work.solve import solve_tile
from .work.sort import sort_cloud

INPUTS = (
    *("clouds", "footprints", "layer", "id_attribute", "where"),
    *("bbox", "terrain", "overrides"),
)
"""Fields of a request that run.json names."""

RESULTS = ("by_status", "by_quality", "by_type", "broken_inputs", "seconds")
"""Fields of a summary that run.json has."""


@dataclass(frozen=True)
class Summary:
    """The result of a run: models, counts by status and type, unusable input, and timings."""

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
    `make_head` with the plan before their buildings are joined. With `may_be_bare` no point has to
    be of a building.
    """

    make_plan: Callable[[Any, Progress], WorkPlan] = make_plan
    solve_tile: Callable[..., Any] = solve_tile
    sort_cloud: Callable[..., Any] = sort_cloud
    before: Callable[[WorkPlan, Any, Progress], None] = lambda *_: None
    make_head: Callable[[WorkPlan], FileHead] = lambda plan: plan.head
    may_be_bare: bool = False


def reconstruct_in_folder(
    request: Request, state: Path, progress: Progress, steps: Steps | None = None
) -> Summary:
    """Run the steps of a run that has its folder `state` to itself."""
    steps = steps or Steps(solve_tile=solve_tile, sort_cloud=sort_cloud)
    clock = Clock()
    executor = make_executor(request.processes or 1, request.scheduler)
    ledger = open_ledger(state, request.restart)
    try:
        plan = resume_or_plan(request, state, ledger, progress, steps.make_plan)
        if request.processes is None and not request.scheduler:
            remainder = ledger.open_buildings()
            buildings = sum(map(len, remainder.values()))
            executor = make_executor(
                as_many_as_pay(buildings, len(remainder), request.footprints is not None)
            )
        clock.lap("plan")
        if ledger.open_tasks("sort") or ledger.open_tasks("solve"):
            executor.prepare()
        clock.lap("prepare")
        queue = Queue(plan, state, ledger, executor, request.clouds, request.terrain, progress)
        queue.work_off("sort", steps.sort_cloud)
        refuse_without_points(plan, ledger, steps.may_be_bare)
        clock.lap("sort")
        if ledger.open_tasks("solve"):
            warn_of_steps(state / "points", request.clouds)
            steps.before(plan, executor, progress)
        queue.work_off("solve", steps.solve_tile)
        clock.lap("solve")
        if ledger.get("merged") != "yes":
            merge(plan, steps.make_head(plan), state, ledger, progress)
        remove_bundles(Path(request.out), dict(ledger.failures(-1)))
        summary = summarise(request, plan, ledger, clock)
        LOGGER.info(
            "%s: %s; seconds: %s",
            count_things(summary.buildings, "building"),
            summary.by_status,
            summary.seconds,
        )
        write_run_record(request, plan, summary)
        if ledger.get("merged") != "yes":
            ledger.claim(claims(list_output_files(plan, Path(request.out)), Path(request.out)))
        clean(state, ledger)
        return summary
    except sqlite3.OperationalError as error:
        raise explain_full_disk(state, error) from error
    finally:
        executor.close()
        with suppress(sqlite3.Error):
            ledger.interrupt()
        ledger.close()


class Clock:
    """Seconds by step."""

    def __init__(self) -> None:
        self.start = time.perf_counter()
        self.seconds: dict[str, float] = {}

    def lap(self, step: str) -> None:
        current = time.perf_counter()
        self.seconds[step], self.start = round(current - self.start, 3), current


def refuse_without_points(plan: WorkPlan, ledger: Ledger, may_be_bare: bool) -> None:
    """Raise InputError when no file holds usable points.

    None could be read, or none holds a point of the building classes unless it `may_be_bare`.

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
    if may_be_bare or ledger.counts("status"):
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
            f"classes {present}; say which class holds roofs with --building-class"
        )


def summarise(request: Request, plan: WorkPlan, ledger: Ledger, clock: Clock) -> Summary:
    clock.lap("merge")
    out, broken = Path(request.out), []
    for task in ledger.tasks():
        if task.state == "failed":
            kind, _, key = task.name.partition(":")
            name = mask(request.clouds[int(key)]) if kind == "sort" else task.name
            broken.append((name, task.message))
    return Summary(
        models=tuple(list_model_paths(plan.settings, out)),
        overview=ledger.overview(),
        by_status=ledger.counts("status"),
        by_type=ledger.counts("type"),
        broken_inputs=tuple(broken),
        failures=tuple(ledger.failures()),
        seconds=clock.seconds,
        units=plan.head.units.gml,
        doubts=ledger.doubts(),
        bundles=out / FAILURES_FOLDER if bundles_in(out) else None,
        by_quality=ledger.counts("quality"),
    )


def write_run_record(request: Request, plan: WorkPlan, summary: Summary) -> None:
    """Write run.json, the only file of a run that knows the time."""
    footprints = choose_footprints(request)
    inputs = {name: getattr(request, name) for name in INPUTS} | {"footprints": footprints}
    if request.underpasses:
        inputs["underpasses"] = request.underpasses
    record = {
        "hiproof": __version__,
        "settings": plan.settings.to_dict(),
        # what is not an address or absolute is meant from there
        "inputs": inputs | {"started_in": str(Path.cwd())},
        "footprints_source": read_source(footprints),
        "crs": plan.crs_wkt,
        "transformations": [operation.to_dict() for operation in plan.operations],
        "registration": plan.registration and plan.registration.to_dict(),
        "units": plan.head.units.describe(),
        "processes": request.processes,
        "summary": summary.overview.to_dict(),
        **{name: getattr(summary, name) for name in RESULTS},
    }
    save_record(request, record)


def save_record(request: Request, record: dict[str, Any]) -> None:
    save_text(Path(request.out) / "run.json", json.dumps(masked_values(record), indent=1) + "\n")


def extend_run_record(request: Request, entries: dict[str, Any]) -> None:
    """Add entries to the run.json that a run has written."""
    text = (Path(request.out) / "run.json").read_text(encoding="utf-8")
    save_record(request, json.loads(text) | entries)


def clean(state: Path, ledger: Ledger) -> None:
    """Remove what a finished run no longer needs.

    The ledger and the plan stay for `status` and for a repeated call, the texts of the buildings
    for one with other overrides.
    """
    shutil.rmtree(state / "points", ignore_errors=True)
    (state / REDO).unlink(missing_ok=True)
    known = ledger.text_files()
    for file in (state / TEXTS_FOLDER).iterdir():
        if file.name not in known:
            file.unlink(missing_ok=True)
