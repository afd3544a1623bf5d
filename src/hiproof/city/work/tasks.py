"""What tasks of a run have in common."""

from __future__ import annotations

from typing import Any, TypeAlias

MAIN_JOB = ("moves", "planes", "single", "solid", "points")
"""Pieces of compiled code (warm_pieces.py) that every run needs, the longest first."""

WITHOUT_FOOTPRINTS = (*MAIN_JOB, "outlines")
"""Those of runs without footprints."""

Arguments: TypeAlias = tuple[Any, ...]
"""Arguments of a task's function."""
TaskOutcome: TypeAlias = tuple[Arguments, Any, Exception | None]
"""Arguments, result and error of a task."""


class WorkerLost(Exception):
    """The process that ran the task died (killed, out of memory)."""
