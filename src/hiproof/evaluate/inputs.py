"""The present place of the files that run.json names as typed, with the folder they were in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..read.models.damage import excerpt
from ..read.plausible import is_place
from ..read.remote import is_url


@dataclass(frozen=True)
class RunSurvey:
    """A survey of a run, named if one of several, its `shift` (3,) (m) taken off points."""

    name: str
    clouds: tuple[str, ...]
    shift: np.ndarray


@dataclass(frozen=True)
class RunInputs:
    """The inputs of a run at their present places.

    An input is None where it was not given or does not exist. `surveys` hold the clouds, the newest
    survey first. `gone` are those of the clouds that are not there, as the run named them.
    `id_attribute`, `where` and `bbox` say how the run read its footprints: read otherwise, ids may
    be those of other buildings.
    """

    surveys: tuple[RunSurvey, ...] = ()
    gone: tuple[str, ...] = ()
    footprints: str | None = None
    layer: str | int | None = None
    id_attribute: str | None = None
    where: str | None = None
    bbox: tuple[float, ...] | None = None
    terrain: str | None = None
    overrides: str | None = None

    @property
    def clouds(self) -> tuple[str, ...]:
        """The clouds of all surveys."""
        return tuple(cloud for survey in self.surveys for cloud in survey.clouds)

    @property
    def local_surveys(self) -> list[RunSurvey]:
        """The surveys with those of their clouds that are files of this machine."""
        local = (
            replace(survey, clouds=tuple(c for c in survey.clouds if not is_url(c)))
            for survey in self.surveys
        )
        return [survey for survey in local if survey.clouds]

    @property
    def footprint_file(self) -> str | None:
        """The footprints, where they are a file here; an address has lost its password."""
        return None if self.footprints is None or is_url(self.footprints) else self.footprints

    @property
    def told_gone(self) -> str:
        """A sentence about clouds that are gone, empty where none is."""
        if not self.gone:
            return ""
        text = f" and {len(self.gone) - 1} more" if len(self.gone) > 1 else ""
        return (
            f"the run's points are gone ({self.gone[0]}{text} {'are' if text else 'is'} not there)"
        )


def found_inputs(record: dict[str, Any], moved_to: Path | None = None) -> RunInputs:
    """Return the inputs that run.json's `record` names.

    Files in the folder `moved_to` go before those where the run found them.

    >>> found = found_inputs({"inputs": {"clouds": ["no/such.laz", "https://example.org/a.laz"]}})
    >>> found.clouds, found.gone, found.footprints
    (('https://example.org/a.laz',), ('no/such.laz',), None)
    """
    inputs = record.get("inputs") or {}
    started_in = inputs.get("started_in")

    def place(path: Any) -> str | None:
        return locate_input(path, started_in, moved_to) if path and isinstance(path, str) else None

    names = [cloud for cloud in inputs.get("clouds") or [] if isinstance(cloud, str)]
    return RunInputs(
        list_surveys(record, [place(cloud) for cloud in names]),
        tuple(cloud for cloud in names if not place(cloud)),
        place(inputs.get("footprints")),
        inputs.get("layer"),
        inputs.get("id_attribute"),
        inputs.get("where"),
        tuple(inputs["bbox"]) if inputs.get("bbox") else None,
        place(inputs.get("terrain")),
        place(inputs.get("overrides")),
    )


def list_surveys(record: dict[str, Any], places: list[str | None]) -> tuple[RunSurvey, ...]:
    """Return the surveys of a run.

    Its clouds now lie at `places`, None for those that are gone. A run of several surveys names its
    clouds survey by survey.
    """
    epochs = record.get("epochs") or {"": {"clouds": len(places), **(record.get("update") or {})}}
    result, start = [], 0
    for name, epoch in epochs.items():
        clouds = places[start : start + epoch["clouds"]]
        shift = (epoch.get("shift") or {}).get("applied", (0.0, 0.0, 0.0))
        result.append(RunSurvey(name, tuple(filter(None, clouds)), np.array(shift, float)))
        start += epoch["clouds"]
    return tuple(survey for survey in result if survey.clouds)


def refuse_other_surveys(record: dict[str, Any]) -> None:
    """Raise InputError where the surveys of the record are not as a run writes them."""
    epochs = record.get("epochs") or {}
    for epoch in (*epochs.values(), record.get("update") or {}):
        if not isinstance(epoch, dict) or not isinstance(epoch.get("shift") or {}, dict):
            raise InputError(f"expected objects with a shift as epochs, got {excerpt(epoch)}")
        shift = (epoch.get("shift") or {}).get("applied", [0.0, 0.0, 0.0])
        if not is_place(shift):
            raise InputError(f"expected three numbers as the applied shift, got {excerpt(shift)}")
    counts = [epoch.get("clouds") for epoch in epochs.values()]
    if not all(type(count) is int for count in counts):
        raise InputError(f"expected numbers of clouds in epochs, got {excerpt(counts)}")


def locate_input(path: str, started_in: str | None, moved_to: Path | None) -> str | None:
    """Return the present place of a file that a run called `path`.

    The run started in the folder `started_in`. Returns None where it does not exist. A whole
    project may have moved, and be worked in as before: so names are also tried as they stand.
    """
    if is_url(path):
        return path
    if "\0" in path:
        return None
    places = [moved_to / Path(path).name] if moved_to else []
    places += [Path(started_in) / path] if started_in else []
    return next((str(place) for place in (*places, Path(path)) if place.exists()), None)
