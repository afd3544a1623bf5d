"""CPU time of a run over Delft by stage.

usage: python -m benchmarks.budget [--data ../shared/data/delft]

One process runs Delft twice. The second run is measured, so that imports and loaded code do not
count. Every stage is timed without the stages inside it; "other" is the rest of the run. The table
ends with the total, measured around the run. The stages have to sum to it within MOST_OTHER.
"""

from __future__ import annotations

import functools
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from pkgutil import resolve_name
from typing import Any
from unittest.mock import patch

from hiproof.city.run import Request, Summary, reconstruct_area

from .judging import DELFT, list_files
from .tables import FigureTable, make_parser

STAGES = {
    "find the common shift of footprints": "hiproof.city.plan.prepare.jobs_from_footprints",
    "make the rest of the plan": "hiproof.city.run.resume_or_plan",
    "sort points into tiles": "hiproof.city.run.sort_cloud",
    "load the points of a tile": "hiproof.city.work.solve.load_points",
    "move rows of footprints": "hiproof.city.work.solve.Surroundings.move",
    "gather the points of a building": "hiproof.city.work.solve.Surroundings.select_roof_points",
    "use the points inside the footprint": "hiproof.method.usable",
    "look at the ground inside the footprint": "hiproof.method.look_at_ground",
    "drop points on neighbours' roofs": "hiproof.method.drop_neighbour_roofs",
    "fit": "hiproof.method.fit",
    "find the ground around": "hiproof.method.find_ground",
    "compose the solid": "hiproof.method.solid_or_simpler",
    "judge": "hiproof.method.judge",
    "look at points of other classes": "hiproof.city.work.solve.Surroundings.inspect",
    "make the texts of all files": "hiproof.city.work.solve.fragments",
    "keep the texts of a tile": "hiproof.city.work.solve.save_fragments",
    "join the files": "hiproof.city.run.merge",
}

MOST_OTHER = 0.05
"""Largest share of the total that no stage counts; a new step of a run belongs to a stage."""


class Clock:
    """Seconds by stage, each without the stages that it calls. `read` tells the time (s)."""

    def __init__(self, read: Callable[[], float] = time.process_time) -> None:
        self.read = read
        self.seconds: Counter[str] = Counter()
        self.inside = 0.0

    def time_stage(self, stage: str, function: Callable) -> Callable:
        """Return `function` as it is, but that its seconds count for a stage."""

        @functools.wraps(function)
        def run(*args: Any, **kwargs: Any) -> Any:
            outer, self.inside, start = self.inside, 0.0, self.read()
            try:
                return function(*args, **kwargs)
            finally:
                spent = self.read() - start
                self.seconds[stage] += spent - self.inside
                self.inside = outer + spent

        return run


def measure(run: Callable[[], Summary]) -> tuple[Clock, float, int]:
    """Return CPU seconds of a run by stage and in total, and its buildings."""
    clock = Clock()
    with ExitStack() as patched:
        for stage, place in STAGES.items():
            timed = clock.time_stage(stage, resolve_name(place))
            patched.enter_context(patch(place, timed))
        start = time.process_time()
        summary = run()
        return clock, time.process_time() - start, summary.buildings


def refuse_incomplete(clock: Clock, total: float) -> None:
    """End with an error where the stages do not sum to the total (s)."""
    counted = sum(clock.seconds.values())
    if not (1 - MOST_OTHER) * total <= counted <= (1 + MOST_OTHER) * total:
        raise SystemExit(
            f"Expected stages that sum to {total:.2f} s within {MOST_OTHER:.0%}, got "
            f"{counted:.2f} s. Add what is missing to STAGES."
        )


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--data", type=Path, default=DELFT, help="folder with Delft's files")
    a = parser.parse_args()
    clouds, footprints = list_files(a.data)
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as out:
        request = Request(clouds, Path(out), footprints, restart=True, processes=1)
        reconstruct_area(request)
        clock, total, buildings = measure(lambda: reconstruct_area(request))
    rows = [(stage, clock.seconds[stage]) for stage in STAGES]
    rows += [("other", total - sum(clock.seconds.values())), ("total", total)]
    with FigureTable(a.record, "stage", "CPU, ms a building", "share, %") as table:
        for stage, seconds in rows:
            share = f"{100 * seconds / total:.1f}"
            table.add(stage, f"{1000 * seconds / buildings:.2f}", share)
        refuse_incomplete(clock, total)


if __name__ == "__main__":
    main()
