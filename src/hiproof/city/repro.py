"""Run a building again that a run failed on, from the bundle that the run kept of it."""

from __future__ import annotations

from pathlib import Path

from ..model import Building
from ..write.run_files import join_fragments
from .bundles import load_bundle
from .merge import whole_files
from .solve import Surroundings, solve_one


def solve_bundle(folder: Path, out: Path) -> tuple[Building, str]:
    """Solve the building of a bundle and write the files of a run to `out`.

    Returns the building and the traceback of its failure, empty where it did not fail. Raises
    InputError for a folder that is no bundle and OutputError for one that cannot be written.
    """
    plan, points, terrain, override = load_bundle(Path(folder))
    traces: list[str] = []
    surroundings = Surroundings(points, terrain, plan)
    building, texts = solve_one(
        plan, plan.jobs[0], surroundings, override, keep=lambda job, trace, terrain: traces.append(trace)
    )
    join_fragments(whole_files(plan, Path(out)), [texts], plan.head)
    return building, "\n".join(traces)
