"""The best survey of each building, and the buildings of a work tile made of it.

The newest survey counts that covers a building well enough. Others join it where their points lie
on the same roof by the test of an update: then all points make the model.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np

from ..city.folder.ledger import Outcome
from ..city.plan.overrides import load_overrides
from ..city.plan.work_plan import Job, WorkPlan, load_plan
from ..city.work.solve import (
    KeepFailure,
    open_terrain,
    solve_buildings,
    solve_one,
)
from ..city.work.surveys import SurveyPoints
from ..fit.bare_ground import LEAST_LOST_M2
from ..geometry.grid import count_cells
from ..model import Building
from ..parametric.override import Override
from ..read.numbers import read_year
from ..stages.remarks import add_remark
from ..status import Change
from ..write.fragments import Fragments
from ..write.run_files import fragments
from .epochs import select_points, select_roof
from .ground import Ground
from .judge import judge_building
from .register import SurveyShift
from .request import SIGNIFICANCE

EPOCHS_FILE = "epochs.json"  # shifts of the surveys, in the folder of a run

COVER_CELL_M = 2.0
"""Side (m) of the cells in which coverage is compared: at half a point a square metre most hold a
point, so a sparse survey covers a roof as well as a dense one."""

WELL_COVERED = 0.8
"""Share of the cells of the survey that covers most, from which on a survey covers a roof well."""


def solve_best_tile(
    names: tuple[str, ...],
    folder: str,
    tile: str,
    terrain: str | None = None,
    avoid: tuple[int, ...] = (),
) -> list[Outcome]:
    """Reconstruct the buildings of `tile` from the surveys `names`, the newest first.

    The other arguments are those of `solve_tile`.
    """
    root = Path(folder)
    plan, overrides, shifts = load_plan(root), load_overrides(root), load_shifts(root)
    steps = {name: shifts.get(name, SurveyShift()).clear_xyz for name in names}
    surveys = SurveyPoints.load(root, tile, open_terrain(plan, terrain), steps, plan)

    def solve(job: Job, keep: KeepFailure) -> tuple[Building, Fragments]:
        return solve_best(plan, job, surveys, shifts, overrides.get(job.index), keep)

    return solve_buildings(root, plan, tile, solve, lambda: surveys.unite(names).points, avoid)


def load_shifts(state: Path) -> dict[str, SurveyShift]:
    """Load the shifts of the surveys, by name, without that of the newest."""
    record = json.loads((state / EPOCHS_FILE).read_text(encoding="utf-8"))
    return {name: SurveyShift.from_dict(shift) for name, shift in record.items()}


def is_same(
    building: Building, old: np.ndarray, new: np.ndarray, shifts: list[SurveyShift]
) -> bool:
    """Return whether the `new` points (n, 3) show the roof that the `old` ones made.

    `shifts` are those of both surveys, as far as they were estimated.
    """
    roof = building.roof
    shift = max(shifts, key=lambda shift: shift.noise.roof, default=SurveyShift())
    verdict = judge_building(
        roof,
        roof.frame.to_local(old),
        roof.frame.to_local(new),
        Ground.under(building, roof.frame),
        shift,
        SIGNIFICANCE,
    )
    return verdict.change is Change.UNCHANGED


def solve_best(
    plan: WorkPlan,
    job: Job,
    surveys: SurveyPoints,
    shifts: dict[str, SurveyShift],
    override: Override | None,
    keep: KeepFailure,
) -> tuple[Building, Fragments]:
    """Return a building made of its best survey, and of those that agree."""
    attributes = job.footprint.attributes if job.footprint else {}
    year = read_year(attributes.get(plan.settings.read.year_column))
    known = [name for name in surveys.points if year is None or int(name[:4]) >= year]
    remark = "" if known else f"its year, {year}, is after that of every survey"
    views = {name: surveys.unite((name,)) for name in known or surveys.points}
    roofs = {name: select_roof(view, job).points for name, view in views.items()}
    points = {name: select_points(view, job) for name, view in views.items()}
    first = choose_survey(roofs, points)
    building, texts = solve_one(plan, job, views[first], override, keep)
    if building.built is None:
        return building, texts
    used = [first]
    for name in views:
        steps = [shifts[survey] for survey in (first, name) if survey in shifts]
        is_other = name != first and len(roofs[name]) > 0
        if is_other and is_same(building, points[first], points[name], steps):
            used.append(name)
    if len(used) > 1:
        united, _ = solve_one(plan, job, surveys.unite(tuple(used)), override, keep)
        is_worse = united.built is None or adds_roof(united, building)
        building, used = (building, used[:1]) if is_worse else (united, used)
    result = dataclasses.replace(building, survey_date=first, epochs_used=tuple(sorted(used)))
    return fragments(add_remark(result, remark), plan.list_names(job), plan.head)


def adds_roof(united: Building, building: Building) -> bool:
    """Return whether older points bring back what the newest survey shows as bare ground."""
    areas = [other.roof.outline.area for other in (united, building)]
    return areas[0] - areas[1] > LEAST_LOST_M2


def choose_survey(roofs: dict[str, np.ndarray], points: dict[str, np.ndarray]) -> str:
    """Return the newest survey that shows a building well, or that it was pulled down.

    Both hold points (n, 3) by survey, the newest first: those of `roofs`, and all that lie on a
    roof or on bare ground inside the outline.
    """
    least = WELL_COVERED * max(count_cells(xyz[:, :2] // COVER_CELL_M) for xyz in roofs.values())
    return next(
        name for name, xyz in points.items() if count_cells(xyz[:, :2] // COVER_CELL_M) >= least
    )
