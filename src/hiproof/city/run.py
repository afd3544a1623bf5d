"""The main job over an area: plan, sort, solve, merge; each step goes on where an earlier run stopped."""

from __future__ import annotations

import json
import shutil
import sqlite3
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from .. import __version__
from ..errors import InputError, OutputError
from ..frames import METRES, Units
from ..masking import masked, masked_values
from ..settings import Settings
from ..write.files import atomic
from .checks import refuse_unusable
from .executors import WorkerLost, make_executor
from .ledger import Ledger
from .merge import merge, remove_tiles
from .plan import Plan, fingerprint
from .prepare import make_plan
from .quarantine import run_alone, solve_in_quarantine
from .tasks import solve_tile, sort_cloud

MOST_LOSSES = 3
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Request:
    """What the user asked for."""

    clouds: tuple[str, ...]
    out: Path
    footprints: str | None = None
    terrain: str | None = None
    id_attribute: str | None = None
    layer: str | None = None
    settings: Settings = field(default_factory=Settings)
    jobs: int = 1
    scheduler: str | None = None
    restart: bool = False


@dataclass(frozen=True)
class Summary:
    """What came of it: buildings by status and type, figures, input that could not be used, seconds by step."""

    out: Path
    buildings: int
    by_status: dict[str, int]
    by_type: dict[str, int]
    median_psd: float | None
    median_share: float | None
    broken_inputs: tuple[tuple[str, str], ...]
    failures: tuple[tuple[str, str], ...]
    seconds: dict[str, float]
    units: Units = METRES

    @property
    def exit_code(self) -> int:
        """0 all modelled or explained by their data, 1 an internal error, 2 some input could not be read."""
        if self.by_status.get("internal_error"):
            return 1
        return 2 if self.broken_inputs else 0


def reconstruct_area(request: Request, progress: Progress = lambda step, done, total: None) -> Summary:
    """Reconstruct every building of an area into `request.out`; see the package's docstring for the steps.

    Raises InputError, SettingsError or OutputError (full sentences) when the run cannot start or go on; what was done
    so far stays, and the same call goes on from there.
    """
    clock = Clock()
    refuse_unusable(request)
    executor = make_executor(request.jobs, request.scheduler)
    state = open_state(request.out)
    ledger = open_ledger(state, request.restart)
    try:
        plan = resume_or_plan(request, state, ledger)
        clock.lap("plan")
        work_off(ledger, executor, "sort", sort_cloud, state, progress)
        refuse_without_points(plan, ledger)
        clock.lap("sort")
        work_off(ledger, executor, "solve", solve_tile, state, progress)
        clock.lap("solve")
        if ledger.get("merged") != "yes":
            merge(plan, state, Path(request.out), progress)
        summary = summarise(request, plan, ledger, clock)
        write_run_record(request, plan, summary)
        ledger.set(merged="yes")
        clean(state)
        return summary
    except sqlite3.OperationalError as error:
        raise OutputError(
            f"expected to write the ledger in {state}, got: {error}; free some space, the same command then goes on"
        ) from error
    finally:
        executor.close()
        with suppress(sqlite3.Error):
            ledger.interrupt()
        ledger.close()


def open_ledger(state: Path, restart: bool) -> Ledger:
    """The ledger of a run; one that is damaged or of another version is dropped where the run begins anew."""
    path = state / "ledger.sqlite"
    try:
        ledger = Ledger(path)
        ledger.reopen()
    except sqlite3.Error as error:
        if restart:
            for end in ("", "-wal", "-shm"):
                path.with_name(path.name + end).unlink(missing_ok=True)
            return open_ledger(state, False)
        raise OutputError(
            f"expected the ledger of a run of this version in {state}, got: {error}; begin anew with --restart, or "
            "choose another --out"
        ) from error
    return ledger


class Clock:
    """Seconds by step."""

    def __init__(self) -> None:
        self.start, self.seconds = time.perf_counter(), {}

    def lap(self, step: str) -> None:
        now = time.perf_counter()
        self.seconds[step], self.start = round(now - self.start, 3), now


def open_state(out: Path) -> Path:
    """The run's own folder inside the output folder, made if need be."""
    state = Path(out) / ".hiproof"
    try:
        state.mkdir(parents=True, exist_ok=True)
        (state / "tiles").mkdir(exist_ok=True)
        (state / "points").mkdir(exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"expected a folder that can be written at {out}, got: {error}; choose another --out"
        ) from error
    return state


def resume_or_plan(request: Request, state: Path, ledger: Ledger) -> Plan:
    """The plan of an unfinished run of the same inputs and settings, else a new one."""
    mark = fingerprint(request.clouds, request.footprints, request.terrain, request.settings)
    known = ledger.get("fingerprint")
    if known is not None and not request.restart:
        if known != mark:
            raise OutputError(
                f"expected {request.out} to be new or to hold a run of the same inputs, settings and version, got another "
                "run's; choose another --out, or begin anew with --restart"
            )
        return Plan.load(state / "plan.pickle")
    if known is not None:
        forget(state, ledger)
    plan = make_plan(request, mark)
    with atomic(state / "plan.pickle") as beside:
        plan.save(Path(beside))
    ledger.add_tasks([(f"sort:{i}", "sort", i, 0) for i in range(len(plan.clouds))])
    tiles = enumerate(plan.tiles.items())
    ledger.add_tasks([(f"solve:{tile}", "solve", i, len(members)) for i, (tile, members) in tiles])
    ledger.set(fingerprint=mark, version=__version__, started=str(time.time()))
    return plan


def forget(state: Path, ledger: Ledger) -> None:
    """Drop all that an earlier run in this folder has left of its state (its output files stay until replaced)."""
    remove_tiles(state.parent)
    for table in ("run", "task", "building"):
        ledger.database.execute(f"delete from {table}")
    for name in ("tiles", "points"):
        shutil.rmtree(state / name, ignore_errors=True)
        (state / name).mkdir()


def work_off(ledger: Ledger, executor, kind: str, function: Callable, state: Path, progress: Progress) -> None:
    """Run all open tasks of a kind; one whose process dies is tried again, and after MOST_LOSSES alone."""
    total = len([row for row in ledger.tasks() if row[1] == kind])
    while names := ledger.open_tasks(kind):
        done = total - len(names)
        progress(kind, done, total)
        suspects = [name for name in names if ledger.losses(name) >= MOST_LOSSES]
        for name in suspects:
            work_off_alone(ledger, executor, kind, name, function, state)
        tasks = started(ledger, kind, [name for name in names if name not in set(suspects)], state)
        for task, result, error in executor.run(function, tasks):
            name = f"{kind}:{task[1]}"
            if isinstance(error, (WorkerLost, MemoryError)):
                ledger.lose(name)
                continue
            done += 1
            record(ledger, kind, name, result, error)
            progress(kind, done, total)


def started(ledger: Ledger, kind: str, names: list[str], state: Path) -> Iterator[tuple]:
    """The tasks' arguments, each entered as running when an executor takes it."""
    for name in names:
        ledger.start(name)
        yield task_arguments(kind, name, state)


def task_arguments(kind: str, name: str, state: Path) -> tuple:
    key = name.split(":", 1)[1]
    return (str(state.absolute()), int(key) if kind == "sort" else key)


def record(ledger: Ledger, kind: str, name: str, result, error: Exception | None) -> None:
    """Enter a finished task. Only unreadable point files may fail; any other error ends the run with what is done kept."""
    if error is None:
        if kind == "sort":
            ledger.finish(name, "done", json.dumps(result))
        else:
            ledger.finish(name, "done", "", result)
    elif kind == "sort" and isinstance(error, InputError):
        ledger.finish(name, "failed", str(error))
    else:
        raise error


def work_off_alone(ledger: Ledger, executor, kind: str, name: str, function: Callable, state: Path) -> None:
    """A task whose process died again and again, in a process of its own; see quarantine.py."""
    task = task_arguments(kind, name, state)
    if kind == "solve":
        result, error = solve_in_quarantine(executor, function, *task)
    else:
        result, error = run_alone(executor, function, task)
    if isinstance(error, (WorkerLost, MemoryError)):
        died = "the process died each time it read this file; not enough memory, or a damaged file"
        ledger.finish(name, "failed", died)
    else:
        record(ledger, kind, name, result, error)


def refuse_without_points(plan: Plan, ledger: Ledger) -> None:
    """A clear sentence when no file could be read, or none holds a point of the building classes."""
    rows = [row for row in ledger.tasks() if row[1] == "sort"]
    failed = [row[5] for row in rows if row[3] == "failed"]
    if rows and len(failed) == len(rows):
        raise InputError(
            failed[0] if len(failed) == 1 else f"none of the {len(rows)} point files could be read; first: {failed[0]}"
        )
    classes: Counter[int] = Counter()
    for row in rows:
        if row[3] == "done":
            classes.update({int(c): n for c, n in json.loads(row[5])["classes"].items()})
    wanted = plan.settings.read.building_classes
    if sum(classes.values()) and not any(classes[c] for c in wanted):
        present = ", ".join(f"{c} ({n:,} points)" for c, n in sorted(classes.items()))
        raise InputError(
            f"expected points of building class {', '.join(map(str, wanted))}, got classes {present}; "
            "say which class holds roofs with --building-class"
        )


def summarise(request: Request, plan: Plan, ledger: Ledger, clock: Clock) -> Summary:
    clock.lap("merge")
    broken = tuple((request_name(row[0], request), row[5]) for row in ledger.tasks() if row[3] == "failed")
    return Summary(
        out=Path(request.out),
        buildings=sum(ledger.counts("status").values()),
        by_status=ledger.counts("status"),
        by_type=ledger.counts("type"),
        median_psd=median(ledger.column("psd")),
        median_share=median(ledger.column("share")),
        broken_inputs=broken,
        failures=tuple(ledger.failures()),
        seconds=clock.seconds,
        units=plan.units,
    )


def request_name(task: str, request: Request) -> str:
    kind, key = task.split(":", 1)
    return masked(request.clouds[int(key)]) if kind == "sort" else task


def median(values: list) -> float | None:
    known = sorted(v for v in values if v is not None)
    return known[len(known) // 2] if known else None


def write_run_record(request: Request, plan: Plan, summary: Summary) -> None:
    """run.json: version, effective settings, inputs, counts, timings: the only file of a run that knows the time."""
    record = {
        "hiproof": __version__,
        "settings": plan.settings.to_dict(),
        "inputs": {
            "clouds": list(request.clouds),
            "footprints": request.footprints,
            "layer": request.layer,
            "terrain": request.terrain,
        },
        "crs": plan.crs_wkt,
        "units": {"coordinates": str(plan.units), "attributes": "metre", **metres_in(plan.units)},
        "jobs": request.jobs,
        "buildings": summary.buildings,
        "by_status": summary.by_status,
        "by_type": summary.by_type,
        "median_psd_m": summary.median_psd,
        "median_share_within_20cm": summary.median_share,
        "broken_inputs": [list(pair) for pair in summary.broken_inputs],
        "seconds": summary.seconds,
    }
    with atomic(Path(request.out) / "run.json") as beside:
        Path(beside).write_text(json.dumps(masked_values(record), indent=1) + "\n")


def metres_in(units: Units) -> dict[str, float]:
    return {"metres_in_plan_unit": units.plan, "metres_in_height_unit": units.height}


def clean(state: Path) -> None:
    """Remove what a finished run no longer needs; the ledger and the plan stay for `status` and for a repeated call."""
    for name in ("tiles", "points"):
        shutil.rmtree(state / name, ignore_errors=True)
