"""An update of a run: plan, sort, register, judge, refit and merge."""

from __future__ import annotations

import dataclasses
import shutil
import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..city.folder.marks import hold_folder
from ..city.folder.resume import open_state
from ..city.plan.checks import refuse_unusable
from ..city.plan.from_cloud import Progress
from ..city.plan.work_plan import WorkPlan
from ..city.run import Steps, Summary, extend_run_record, reconstruct_in_folder
from ..errors import InputError, InputWarning, OutputError, SettingsError
from ..evaluate.run import list_run_inputs
from ..formats import list_requested_files
from ..garbage import collect_rarely
from ..masking import mask
from ..read.remote import locate
from ..settings import Changes
from ..status import Change
from ..write.files import refuse_overwriting
from ..write.head import FileHead, UpdateHead
from .before import prepare_surveys, remove_earlier_points
from .change_tables import write_changes
from .dates import find_survey_date
from .earlier import choose_read_settings, read_earlier
from .epochs import SURVEYS_FILE, Surveys
from .outside import CELLS_FOLDER, load_roofs_outside, sort_survey
from .plan import make_update_plan
from .register import read_shift
from .request import EACH_BUILDING, WHOLE_CITY, UpdateRequest
from .solve import update_tile

MANY_CHANGED = 8
"""Buildings that have to count as changed for a warning that most do."""


@dataclass(frozen=True)
class UpdateSummary:
    """The result of an update, with buildings by class and kind of change.

    `outside` counts roofs outside all outlines by kind. `files` are changes.csv and changes.gpkg.
    """

    run: Summary
    surveys: Surveys
    by_change: dict[str, int]
    by_kind: dict[str, int]
    outside: dict[str, int]
    files: tuple[Path, ...]


def update_area(
    request: UpdateRequest,
    changes: Changes | None = None,
    progress: Progress = lambda *_: None,
) -> UpdateSummary:
    """Bring the models of `request.run` up to date in `request.out`.

    `changes` are settings that differ from the run's, by section. Raises InputError, SettingsError
    or OutputError (full sentences) when the update cannot start or go on; the same call goes on.
    """
    if not 0 < request.significance < 1:
        raise SettingsError(
            f"expected --significance between 0 and 1, got {request.significance}; 0.001 is usual"
        )
    if request.significance_over not in (EACH_BUILDING, WHOLE_CITY):
        raise SettingsError(
            f"expected --significance-over {EACH_BUILDING} or {WHOLE_CITY}, got "
            f"{request.significance_over}; choose one"
        )
    earlier = read_earlier(request.run)
    if Path(request.out).resolve().is_relative_to(Path(request.run).resolve()):
        raise OutputError(
            f"expected a folder outside that of the run with --out, got {request.out}; an update "
            "never changes its run"
        )
    if request.refine and not earlier.clouds:
        raise InputError(
            f"expected the clouds of {request.run} with --refine, which takes the points of both "
            "surveys, got none; restore them where run.json names them, or leave out --refine"
        )
    refuse_same_clouds(request.clouds, earlier.clouds)
    settings = choose_read_settings(earlier.settings).replace(changes or {})
    read_shift(settings.read.shift)  # one that is none is refused before work is spent
    date = find_survey_date(request.clouds, request.date, earlier.date, earlier.clouds)
    request = dataclasses.replace(
        request, settings=settings, date=date, overrides=request.overrides or earlier.overrides
    )
    refuse_unusable(request)
    outputs = list_requested_files(settings, Path(request.out)).values()
    refuse_overwriting(outputs, list_run_inputs(Path(request.run)))
    state = open_state(request.out)

    def make_plan(_: Any, __: Progress) -> WorkPlan:
        (state / SURVEYS_FILE).unlink(missing_ok=True)
        remove_earlier_points(state)
        shutil.rmtree(state / CELLS_FOLDER, ignore_errors=True)
        return make_update_plan(request, earlier, state)

    def prepare(plan: WorkPlan, executor: Any, _: Progress) -> None:
        prepare_surveys(request, earlier, date, state, plan, executor)

    def make_head(plan: WorkPlan) -> FileHead:
        update = UpdateHead(date, tuple(load_roofs_outside(state)))
        return dataclasses.replace(plan.head, update=update)

    may_be_bare = settings.read.roofs == "class"  # where all was pulled down
    steps = Steps(make_plan, update_tile, sort_survey, prepare, make_head, may_be_bare)
    with hold_folder(state), collect_rarely():
        summary = reconstruct_in_folder(request, state, progress, steps)
        remove_earlier_points(state)
        return report_changes(request, state, summary)


def refuse_same_clouds(clouds: tuple[str, ...], earlier: tuple[str, ...]) -> None:
    """Raise InputError where a cloud is one of the `earlier` ones, whatever it holds now."""
    known = set(map(locate, earlier))
    for cloud in clouds:
        if locate(cloud) in known:
            raise InputError(
                f"expected clouds of a new survey, got {mask(cloud)}, of which the run was made; "
                "name others, and where a new survey replaced this file, move it to another folder"
            )


def report_changes(request: UpdateRequest, state: Path, summary: Summary) -> UpdateSummary:
    """Write the tables of changes and complete run.json."""
    surveys, out = Surveys.load(state / SURVEYS_FILE), Path(request.out)
    found, files = write_changes(out)
    outside = load_roofs_outside(state)
    by_change = Counter(change.record["change"]["class"] for change in found)
    n_changed = by_change[Change.CHANGED.code] + by_change[Change.GONE.code]
    if n_changed >= MANY_CHANGED and 2 * n_changed > summary.buildings:
        warnings.warn(
            f"{n_changed} of {summary.buildings} buildings count as changed, more than a town has. "
            "The survey may lie aside or be in another CRS or unit: look at some of them with "
            "`hiproof report`, and pass its shift with --shift EAST,NORTH,UP",
            InputWarning,
        )
    if by_change[Change.NOT_COVERED.code] == summary.buildings:
        warnings.warn(
            f"expected new clouds that cover buildings of {request.run}, got clouds that cover none"
            "; check their place and CRS, and the class of their roofs (--building-class)",
            InputWarning,
        )
    by_change[Change.UNCHANGED.code] = summary.buildings - len(found)
    by_kind = Counter(
        change.record["change"]["places"][0]["kind"]
        for change in found
        if change.record["change"]["places"]
    )
    result = UpdateSummary(
        summary,
        surveys,
        {c.code: by_change[c.code] for c in Change if by_change[c.code]},
        dict(sorted(by_kind.items())),
        dict(sorted(Counter(roof["kind"] for roof in outside).items())),
        files,
    )
    add_to_record(request, result)
    return result


def add_to_record(request: UpdateRequest, result: UpdateSummary) -> None:
    """Add what is peculiar to an update to run.json."""
    surveys = result.surveys
    entries = {
        "run": str(request.run),
        "survey_date": surveys.date,
        "significance": surveys.significance,
        "significance_over": surveys.over,
        "largest_chance": surveys.largest_chance,
        "compared_with": "points" if surveys.has_earlier else "models",
        "shift": surveys.shift.to_dict(),
        "by_change": result.by_change,
        "by_kind": result.by_kind,
        "roofs_outside": result.outside,
    }
    extend_run_record(request, {"update": entries})
