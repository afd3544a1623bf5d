"""What the user asked for: a run, new clouds, and options."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ..city.request import FILES_FIELD, NO_MATTER, Request

SIGNIFICANCE = 0.001
"""Probability with which an unchanged building may be called changed."""

EACH_BUILDING, WHOLE_CITY = "buildings", "city"
"""What the significance holds for: each unchanged building, or all changes that are reported."""


@dataclass(frozen=True)
class UpdateRequest(Request):
    """An update of the models in the folder `run` with new `clouds`, written to `out`.

    `footprints` replace the outlines of the run, None to keep them. `run_parameters` is the run's
    parameters.jsonl, whose state decides whether an interrupted update may resume. `date` is that
    of the survey, "" to read it from the clouds. `history` keeps models that ended.
    `significance_over` is EACH_BUILDING or WHOLE_CITY. With `refine`, points of both surveys
    estimate the parameters of unchanged buildings anew.
    """

    footprints: str | None = field(default=None, metadata=FILES_FIELD)
    run: Path = field(default=Path(), metadata=NO_MATTER)
    run_parameters: str = field(default="", metadata=FILES_FIELD)
    significance: float = SIGNIFICANCE
    significance_over: str = EACH_BUILDING
    refine: bool = False
    date: str = ""
    history: bool = False
