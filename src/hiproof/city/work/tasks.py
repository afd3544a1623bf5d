"""What tasks of a run have in common."""

from __future__ import annotations

from typing import Any, TypeAlias

Arguments: TypeAlias = tuple[Any, ...]
"""Arguments of a task's function."""
TaskOutcome: TypeAlias = tuple[Arguments, Any, Exception | None]
"""Arguments, result and error of a task."""


class WorkerLost(Exception):
    """The process that ran the task died (killed, out of memory)."""
