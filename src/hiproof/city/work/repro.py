"""Running a building again on which a run failed, from its bundle."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import shapely

from ...classify.split import split_buildings
from ...formats import list_requested_files
from ...model import Building, PointCloud
from ...write.run_files import join_fragments
from ..plan.work_plan import WorkPlan
from .bundles import load_bundle
from .solve import Surroundings, solve_one


def solve_bundle(folder: Path, out: Path) -> tuple[Building, str]:
    """Solve the building of a bundle and write the files of a run to `out`.

    Returns the building and the traceback of its failure, empty where it did not fail. Raises
    InputError for a folder that is no bundle and OutputError for one that cannot be written.
    """
    plan, points, terrain, override = load_bundle(Path(folder))
    plan = search_again(plan, points)
    traces: list[str] = []
    surroundings = Surroundings(points, terrain, plan)
    building, texts = solve_one(
        plan,
        plan.jobs[0],
        surroundings,
        override,
        keep=lambda job, trace, terrain: traces.append(trace),
    )
    join_fragments(list_requested_files(plan.settings, Path(out)), [texts], plan.head)
    return building, "\n".join(traces)


def search_again(plan: WorkPlan, points: dict[str, np.ndarray]) -> WorkPlan:
    """Search for buildings again in the area where the search of a bundle failed.

    `points` (n, 3) by kind are those of the bundle.
    """
    (job,), read = plan.jobs, plan.settings.read
    if job.error is None:
        return plan
    kinds = {"roof": read.building_classes[0], "ground": read.ground_classes[0]}
    xyz = np.concatenate([points[kind] for kind in kinds])
    classes = np.repeat(
        np.array([*kinds.values()], np.uint8), [len(points[kind]) for kind in kinds]
    )
    inside = shapely.intersects_xy(job.area, xyz[:, :2])
    buildings = split_buildings(PointCloud(xyz[inside], classes[inside]), plan.settings)
    error = next((building.error for building in buildings if building.error), None)
    return dataclasses.replace(plan, jobs=(dataclasses.replace(job, error=error),))
