"""The earlier run: its buildings, settings and clouds.

All are read and checked before work is spent.
"""

from __future__ import annotations

import dataclasses
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import HiproofError, InputError, InputWarning
from ..evaluate.inputs import RunSurvey, found_inputs
from ..evaluate.run import run_record
from ..formats import FORMATS
from ..parametric.file import opened_parameters
from ..parametric.record import refuse_other_kinds
from ..settings import ReadSettings, Settings
from ..write.head import FileHead
from .dates import date_by_points

RUN_PARAMETERS = FORMATS["parameters"].file


@dataclass(frozen=True)
class EarlierRun:
    """The buildings of a run (objects of parameters.jsonl).

    Its head and settings come with them.

    `surveys` are those that the run was made of, the newest first, empty where not all of their
    clouds exist. `overrides` is the file of its overrides, and `date` the day or year of its newest
    survey, "" where nothing tells.
    """

    head: FileHead
    records: tuple[dict[str, Any], ...]
    settings: Settings
    surveys: tuple[RunSurvey, ...]
    overrides: str | None = None
    date: str = ""

    @property
    def clouds(self) -> tuple[str, ...]:
        """The clouds of all surveys."""
        return tuple(cloud for survey in self.surveys for cloud in survey.clouds)


def find_parameters(folder: Path) -> Path:
    """Return the parameters of the run in `folder`.

    Raises InputError where there are none.
    """
    path = Path(folder) / RUN_PARAMETERS
    if not path.is_file():
        raise InputError(
            f"expected the folder of a finished run with {RUN_PARAMETERS}, got {folder}; name the "
            "--out of `hiproof reconstruct`"
        )
    return path


def read_earlier(folder: Path) -> EarlierRun:
    """Read the run in `folder`.

    Raises InputError for one that is damaged, naming the building.
    """
    path, record = find_parameters(folder), run_record(folder)
    with opened_parameters(path) as (head, rows):
        records = tuple(rows)
    if not records:
        raise InputError(f"expected buildings in {path}, got none; name another run")
    for row in records:
        try:
            refuse_other_kinds(row)  # its geometry is made by the workers
        except HiproofError as error:
            raise InputError(f"building {row['id']:.80} in {path}: {error}") from error
    settings = dataclasses.replace(
        Settings.from_dict(record.get("settings") or {}), compose=head.compose, write=head.write
    )
    inputs = found_inputs(record)
    surveys = () if inputs.gone else inputs.surveys
    if not surveys:
        warnings.warn(
            f"{folder}: the clouds of this run are not there, so the new points are compared with "
            "its models alone; changes that the models leave out are not told from their errors",
            InputWarning,
        )
    named = str((record.get("update") or {}).get("survey_date") or "")
    date = named or max(record.get("epochs") or [""]) or date_by_points(inputs.clouds)
    return EarlierRun(head, records, settings, surveys, find_overrides(folder, record), date)


def find_overrides(folder: Path, record: dict[str, Any]) -> str | None:
    """Return the file of the run's overrides, None where it had none or lost it."""
    named, found = (record.get("inputs") or {}).get("overrides"), found_inputs(record).overrides
    if named and not found:
        warnings.warn(
            f"{folder}: the overrides of this run, {named}, are not there; buildings that changed "
            "are fitted without them",
            InputWarning,
        )
    return found


def choose_read_settings(settings: Settings) -> Settings:
    """Return settings to read new clouds.

    Their classes and their shift need not be those of the earlier ones.
    """
    usual = ReadSettings()
    names = ("building_classes", "ground_classes", "roofs", "shift")
    read = dataclasses.replace(settings.read, **{name: getattr(usual, name) for name in names})
    return dataclasses.replace(settings, read=read)
