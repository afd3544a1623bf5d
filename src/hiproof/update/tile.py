"""The tasks of an update by name, for processes that have imported nothing yet."""

from __future__ import annotations

import functools
from pathlib import Path

from ..city.work.tasks import call


def sort_survey(folder: str, number: int, address: str, epoch: str = "") -> dict:
    """Sort a point file of a survey, and keep where its roofs and its ground lie.

    `epoch` is the name of the survey where it is one of several.
    """
    from ..city.plan.work_plan import load_plan
    from ..city.work.sort import sort_cloud
    from .outside import CELLS_FOLDER, SurveyCells

    cells = SurveyCells(load_plan(Path(folder)).settings.read)
    result = sort_cloud(folder, number, address, cells.add, epoch)
    cells.save(Path(folder) / CELLS_FOLDER / f"{number}.npz")
    return result


def sort_epoch(epochs: tuple[str, ...], folder: str, number: int, address: str) -> dict:
    """Sort a point file of a run of several surveys.

    It is file `number` of those in `epochs`.
    """
    from ..city.work.sort import sort_cloud

    return sort_cloud(folder, number, address, epoch=epochs[number])


def sort_earlier_cloud(epochs: tuple[str, ...], folder: str, number: int, address: str) -> dict:
    """Sort a point file of the earlier run, file `number` of those in `epochs`.

    The newest survey comes first, and is the one whose roofs and ground the new survey is compared
    with.
    """
    if epochs[number] == epochs[0]:
        return sort_survey(folder, number, address, epochs[0])
    return sort_epoch(epochs, folder, number, address)


solve_best_tile = functools.partial(call, "update.best.solve_best_tile")
update_tile = functools.partial(call, "update.solve.update_tile")
judge_tile = functools.partial(call, "update.solve.judge_tile")
