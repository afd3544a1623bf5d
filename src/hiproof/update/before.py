"""What an update does before its work tiles.

Earlier points are sorted, and the surveys registered.
"""

from __future__ import annotations

import dataclasses
import functools
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..city.plan.work_plan import WorkPlan
from ..city.work.queue import make_absolute
from ..city.work.solve import pass_over_failure
from ..errors import InputError
from ..evaluate.inputs import RunSurvey
from ..log import LOGGER
from ..parametric.record import read_building
from .earlier import EarlierRun
from .epochs import (
    JUDGING_FILE,
    SURVEYS_FILE,
    Epochs,
    Surveys,
    compare_ground,
    save_shifts,
    sort_epoch,
)
from .members import load_members
from .outside import save_roofs_outside, sort_survey
from .plan import EARLIER_FOLDER, save_earlier_plan
from .register import SampledRoof, draw_buildings, register_surveys
from .request import WHOLE_CITY, UpdateRequest
from .solve import judge_tile
from .texts import find_texts


def find_largest_chance(chances: np.ndarray, significance: float) -> float:
    """Return the chance (exclusive) below which a building counts as changed.

    `chances` (n,) bound the probabilities that the buildings look like this unchanged. Of the
    buildings called changed, a share of `significance` at most is expected to be unchanged.

    >>> find_largest_chance(np.array([0.001, 0.02, 0.9, 0.8]), 0.05)
    0.025
    >>> find_largest_chance(np.array([0.9, 0.8]), 0.05)
    0.025
    """
    if not len(chances):
        return significance
    ranks = np.arange(1, len(chances) + 1)
    below = ranks[np.sort(chances) < ranks * significance / len(chances)]
    return float(below.max(initial=1) * significance / len(chances))


def judge_city(state: Path, plan: WorkPlan, terrain: str | None, executor: Any) -> np.ndarray:
    """Return the chances (n,) of all buildings that were tested, tile by tile.

    The surveys in the folder `state` say what a tile is judged by.
    """
    tasks = ((str(state.absolute()), tile, terrain) for tile in plan.tiles)
    chances: list[float] = []
    for _, found, error in executor.run(judge_tile, tasks):
        if error is not None:
            raise error
        chances += found
    return np.array(chances)


SORTED_MARK = "sorted"  # file in the earlier folder: its points are complete


def prepare_surveys(
    request: UpdateRequest,
    earlier: EarlierRun,
    date: str,
    state: Path,
    plan: WorkPlan,
    executor: Any,
) -> None:
    """Sort the earlier points and register the surveys.

    What an interrupted update did is kept.
    """
    if not (state / EARLIER_FOLDER / SORTED_MARK).exists():
        remove_earlier_points(state)
        save_earlier_plan(state, plan, earlier)
        sort_earlier(earlier.surveys, state / EARLIER_FOLDER, executor)
        (state / EARLIER_FOLDER / SORTED_MARK).touch()
    if (state / SURVEYS_FILE).exists():
        return
    samples = draw_samples(state, plan, request.terrain)
    shift = register_surveys(samples, request.settings.read)
    shift.refuse_other_heights(f"survey of {date}")
    shift.warn(f"survey of {date}")
    LOGGER.info("the new survey lies beside the earlier one by %s", shift.to_dict())
    save_roofs_outside(state, plan, bool(earlier.clouds), shift.clear_xyz)
    texts = find_texts(request.run, plan)
    surveys = Surveys(
        shift,
        date,
        request.significance,
        bool(earlier.clouds),
        texts,
        request.history,
        request.significance_over,
        request.significance,
        request.refine,
    )
    if request.significance_over == WHOLE_CITY:
        surveys.save(state / JUDGING_FILE)
        chances = judge_city(state, plan, request.terrain, executor)
        largest = find_largest_chance(chances, request.significance)
        surveys = dataclasses.replace(surveys, largest_chance=largest)
    surveys.save(state / SURVEYS_FILE)


def remove_earlier_points(state: Path) -> None:
    """Remove the earlier points of an update that ended."""
    shutil.rmtree(state / EARLIER_FOLDER, ignore_errors=True)


def sort_earlier(surveys: tuple[RunSurvey, ...], folder: Path, executor: Any) -> None:
    """Sort the clouds of the earlier surveys, and keep the shifts of these.

    Raises InputError for a cloud that cannot be read.
    """
    save_shifts(folder, {survey.name: survey.shift for survey in surveys})
    names = tuple(survey.name for survey in surveys for _ in survey.clouds)
    clouds = (cloud for survey in surveys for cloud in survey.clouds)
    tasks = ((str(folder.absolute()), i, make_absolute(cloud)) for i, cloud in enumerate(clouds))
    for task, _, error in executor.run(functools.partial(sort_earlier_cloud, names), tasks):
        if error is not None:
            raise InputError(
                f"expected to read {task[2]}, of which the earlier run was made, got: {error}; "
                "restore it, or move all of the run's clouds away to compare with its models alone"
            ) from error


def sort_earlier_cloud(epochs: tuple[str, ...], folder: str, number: int, address: str) -> dict:
    """Sort a point file of the earlier run, file `number` of those in `epochs`.

    The newest survey comes first, and is the one whose roofs and ground the new survey is compared
    with.
    """
    if epochs[number] == epochs[0]:
        return sort_survey(folder, number, address, epochs[0])
    return sort_epoch(epochs, folder, number, address)


def draw_samples(state: Path, plan: WorkPlan, terrain: str | None) -> Iterator[SampledRoof]:
    """Yield the points and roofs of sampled buildings, tile by tile.

    They are those of squares that a hash of their place draws, up to ENOUGH_ROOFS.
    """
    members, chosen = load_members(state), draw_buildings(plan)
    for tile, indices in plan.tiles.items():
        inside = [index for index in indices if index in chosen and members[index]["record"]]
        if not inside:
            continue
        epochs = Epochs(state, tile, terrain, np.zeros(3))
        for index in inside:
            job = plan.jobs[index]
            with pass_over_failure(job):
                record = members[index]["record"]
                roof = read_building(record | {"terrain_line": []})[1]
                if roof is None:
                    continue
                old, new = epochs.select_roofs(job, record)
                ground = compare_ground(epochs.find_ground(job, record), epochs.new, job)
                to_local = roof.frame.to_local
                local = None if old is None else to_local(old)
                yield SampledRoof(roof, local, to_local(new), ground)
