"""The tasks of an update by name, for processes that have imported nothing yet."""

from __future__ import annotations

from pathlib import Path

from ..city.folder.ledger import Outcome


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


def solve_best_tile(
    names: tuple[str, ...],
    folder: str,
    tile: str,
    terrain: str | None = None,
    avoid: tuple[int, ...] = (),
) -> list[Outcome]:
    """Reconstruct a work tile from several surveys; see best.py."""
    from . import best

    return best.solve_best_tile(names, folder, tile, terrain, avoid)


def update_tile(
    folder: str, tile: str, terrain: str | None = None, avoid: tuple[int, ...] = ()
) -> list[Outcome]:
    """Bring a work tile up to date; see solve.py."""
    from . import solve

    return solve.update_tile(folder, tile, terrain, avoid)


def judge_tile(folder: str, tile: str, terrain: str | None = None) -> list[float]:
    """Return the chances of a work tile's buildings that were tested; see solve.py."""
    from . import solve

    return solve.judge_tile(folder, tile, terrain)
