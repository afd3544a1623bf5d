"""A run of several surveys.

Each building is made of the best one, or of all that agree.

The surveys are registered to the newest by sampled roofs of that one, before there are work tiles.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..city.folder.marks import hold_folder
from ..city.folder.resume import open_state
from ..city.plan.checks import refuse_unusable
from ..city.plan.from_cloud import Progress
from ..city.plan.work_plan import WorkPlan
from ..city.request import Request
from ..city.run import Steps, Summary, extend_run_record, reconstruct_in_folder
from ..city.work.solve import Surroundings, open_terrain, pass_over_failure, solve_one
from ..city.work.sort import load_points
from ..errors import InputError
from ..garbage import collect_rarely
from ..write.files import save_text
from .best import EPOCHS_FILE, load_shifts, solve_best_tile
from .epochs import compare_ground, find_ground, select_roof, sort_epoch
from .register import SampledRoof, SurveyShift, draw_buildings, read_shift, register_surveys


def reconstruct_epochs(request: Request, progress: Progress = lambda *_: None) -> Summary:
    """Reconstruct every building of an area from the surveys of `request.epochs`.

    Raises what `reconstruct_area` does, and InputError without footprints.
    """
    refuse_unusable(request)
    read_shift(request.settings.read.shift)
    if not request.footprints:
        raise InputError(
            "expected --footprints with --epoch, got none; outlines that are found in points of "
            "several surveys would be those of none"
        )
    state = open_state(request.out)
    names = tuple(sorted(set(request.epochs), reverse=True))

    def prepare(plan: WorkPlan, _: Any, __: Progress) -> None:
        shifts = register_epochs(state, plan, names, request)
        record = {name: shift.to_dict() for name, shift in shifts.items()}
        save_text(state / EPOCHS_FILE, json.dumps(record) + "\n")

    steps = Steps(
        solve_tile=functools.partial(solve_best_tile, names),
        sort_cloud=functools.partial(sort_epoch, request.epochs),
        before=prepare,
    )
    with hold_folder(state), collect_rarely():
        summary = reconstruct_in_folder(request, state, progress, steps)
        add_to_record(request, names, load_shifts(state))
        return summary


def register_epochs(
    state: Path, plan: WorkPlan, names: tuple[str, ...], request: Request
) -> dict[str, SurveyShift]:
    """Return how far each survey but the newest lies beside that one."""
    samples: dict[str, list[SampledRoof]] = {name: [] for name in names[1:]}
    for roofs in draw_roofs(state, plan, names, request.terrain):
        for name, sample in roofs.items():
            samples[name].append(sample)
    read = request.settings.read
    shifts = {name: register_surveys(found, read) for name, found in samples.items()}
    for name, shift in shifts.items():
        shift.refuse_other_heights(f"survey {name}")
        shift.warn(f"survey {name}")
    return shifts


def draw_roofs(
    state: Path, plan: WorkPlan, names: tuple[str, ...], terrain: str | None
) -> Iterator[dict[str, SampledRoof]]:
    """Yield the sampled roofs of the newest survey, with the points of every other."""
    chosen = draw_buildings(plan) if len(names) > 1 else set()
    for tile, indices in plan.tiles.items():
        jobs = [plan.jobs[index] for index in indices if index in chosen]
        if not jobs:
            continue
        model = open_terrain(plan, terrain)
        views = {name: Surroundings(load_points(state, tile, name), model, plan) for name in names}
        for job in jobs:
            building, _ = solve_one(plan, job, views[names[0]])
            if building.built is None:
                continue
            with pass_over_failure(job):
                to_local = building.roof.frame.to_local
                points = {
                    name: to_local(select_roof(view, job).points) for name, view in views.items()
                }
                ground = find_ground(views[names[0]], job)
                yield {
                    name: SampledRoof(
                        building.roof,
                        points[names[0]],
                        points[name],
                        compare_ground(ground, views[name], job),
                    )
                    for name in names[1:]
                }


def add_to_record(request: Request, names: tuple[str, ...], shifts: dict[str, SurveyShift]) -> None:
    """Add the surveys to run.json: their clouds, and how they lie to the newest."""
    surveys = {
        name: {
            "clouds": request.epochs.count(name),
            "shift": shifts[name].to_dict() if name in shifts else None,
        }
        for name in names
    }
    extend_run_record(request, {"epochs": surveys})
