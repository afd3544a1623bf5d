"""The surveys of an update, and the points of both in a work tile."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..city.plan.work_plan import Job, load_plan, neighbourhood
from ..city.work.found import FoundRoof
from ..city.work.ground import BareAround
from ..city.work.other_classes import find_bare_cells, find_low_cells
from ..city.work.solve import Surroundings, open_terrain
from ..city.work.sort import load_points, sort_cloud
from ..city.work.surveys import SurveyPoints
from ..geometry.thin import without_repeats
from ..parametric.record import read_terrain_lines
from ..read.terrain import TerrainChain
from .plan import EARLIER_FOLDER
from .register import SurveyShift
from .request import EACH_BUILDING, SIGNIFICANCE

SURVEYS_FILE, JUDGING_FILE = "surveys.json", "surveys.judging.json"
"""The surveys for the workers, and what they are before all buildings were judged together."""

SHIFTS_FILE = "shifts.json"  # of the earlier surveys, in the folder of their points


@dataclass(frozen=True)
class Surveys:
    """The shift of the two surveys, the new one's date and the significance.

    Of chances below `largest_chance` buildings count as changed. `over` says what the significance
    holds for. `texts` is the state folder of the earlier run, "" where its texts cannot be kept.
    `history` says whether models that ended are kept, `refine` whether unchanged buildings are
    estimated anew.
    """

    shift: SurveyShift
    date: str
    significance: float
    has_earlier: bool
    texts: str = ""
    history: bool = False
    over: str = EACH_BUILDING
    largest_chance: float = SIGNIFICANCE
    refine: bool = False

    def save(self, path: Path) -> None:
        """Write the surveys for the workers."""
        record = dataclasses.asdict(self) | {"shift": self.shift.to_dict()}
        path.write_text(json.dumps(record) + "\n", encoding="utf-8")

    @staticmethod
    def load(path: Path) -> Surveys:
        """Read what `save` wrote."""
        record = json.loads(path.read_text(encoding="utf-8"))
        return Surveys(**record | {"shift": SurveyShift.from_dict(record["shift"])})


def save_shifts(folder: Path, shifts: dict[str, np.ndarray]) -> None:
    """Keep what is taken off the points of each survey, by name, the newest first."""
    record = {name: shift.tolist() for name, shift in shifts.items()}
    (folder / SHIFTS_FILE).write_text(json.dumps(record) + "\n", encoding="utf-8")


class Epochs:
    """The points of both surveys in a work tile, looked up building by building."""

    def __init__(self, root: Path, tile: str, terrain: str | None, shift: np.ndarray):
        self.root, self.plan = root, load_plan(root)
        points = {kind: xyz - shift for kind, xyz in load_points(root, tile).items()}
        self.new = Surroundings(points, open_terrain(self.plan, terrain), self.plan)
        self.old = load_earlier(root / EARLIER_FOLDER, tile)

    def select(self, job: Job, record: dict[str, Any]) -> tuple[np.ndarray | None, np.ndarray]:
        """Return the old and new points (n, 3) of a building, roof and bare ground alike.

        `record` is its object of the earlier parameters.jsonl. The old points are None where the
        earlier survey shows nothing.
        """
        old = None if self.old is None else select_points(self.old.choose(record), job)
        return old if old is not None and len(old) else None, select_points(self.new, job)

    def select_roofs(
        self, job: Job, record: dict[str, Any]
    ) -> tuple[np.ndarray | None, np.ndarray]:
        """Return the old and new roof points (n, 3) of a building."""
        old = None if self.old is None else select_roof(self.old.choose(record), job).points
        return old, select_roof(self.new, job).points

    def find_ground(self, job: Job, record: dict[str, Any]) -> np.ndarray:
        """Return the earlier ground (n, 3) around a building.

        Without the earlier points it is where the model meets the terrain.
        """
        if self.old is None:
            return np.concatenate([np.zeros((0, 3)), *read_terrain_lines(record)])
        return find_ground(self.old.choose(record), job)


def load_earlier(folder: Path, tile: str) -> SurveyPoints | None:
    """Return the points of the earlier surveys, None where there are none."""
    if not any((folder / "points").iterdir()):
        return None
    record = json.loads((folder / SHIFTS_FILE).read_text(encoding="utf-8"))
    shifts = {name: np.array(shift) for name, shift in record.items()}
    return SurveyPoints.load(folder, tile, None, shifts, load_plan(folder))


def sort_epoch(epochs: tuple[str, ...], folder: str, number: int, address: str) -> dict:
    """Sort a point file of a run of several surveys.

    It is file `number` of those in `epochs`.
    """
    return sort_cloud(folder, number, address, epoch=epochs[number])


def select_points(surroundings: Surroundings, job: Job) -> np.ndarray:
    """Return the points (n, 3) of a roof and of bare ground in its outline, each once.

    All points of bare ground count, as all of the roof do: where one of both were thinned, what is
    lost would weigh less than what is there. So do points of other classes that lie on the ground,
    in cells with nothing else.
    """
    roof = select_roof(surroundings, job)
    grid = surroundings.ground_grid
    bare = without_repeats(grid.xy.take(grid.inside(job.area), axis=0))
    by_class = surroundings.select_other_points(job)
    if by_class is not None:
        low = fill_cells(find_low_cells(by_class, np.concatenate([roof.points, bare])))
        bare = np.concatenate([find_bare_cells(dataclasses.replace(by_class, ground=bare)), low])
    by_shape = roof.ground[shapely.intersects_xy(job.area, roof.ground[:, :2])]
    return np.concatenate([roof.points, by_shape, bare])


def fill_cells(points: np.ndarray) -> np.ndarray:
    """Return points (4 n, 3) every half metre of the whole-metre cells of which `points` are.

    One point a cell would weigh less than the roof points that it stands beside.
    """
    xy = np.floor(points[:, None, :2]) + [[0.25, 0.25], [0.25, 0.75], [0.75, 0.25], [0.75, 0.75]]
    return np.column_stack([xy.reshape(-1, 2), np.repeat(points[:, 2], 4)])


def select_roof(surroundings: Surroundings, job: Job) -> FoundRoof:
    """Return the roof of a building, with the points inside its outline."""
    if surroundings.plan.settings.read.by_class:
        inside = surroundings.grid.inside(job.area)
        return FoundRoof(without_repeats(surroundings.roof.take(inside, axis=0)))
    found = surroundings.select_roof_points(job)
    points = without_repeats(found.points)
    inside = shapely.intersects_xy(job.area, points[:, :2])
    return dataclasses.replace(found, points=points[inside])


def find_ground(surroundings: Surroundings, job: Job) -> np.ndarray:
    """Return the ground (n, 3) around a building, at most one point a cell of a metre."""
    box = neighbourhood(job, surroundings.plan.terrain_reach_m)
    points = surroundings.ground.inside(box)
    if not len(points):
        points = BareAround(lambda: surroundings.low, box).bare.cells.inside(box)
    return points[~shapely.intersects_xy(job.area, points[:, :2])]


def compare_ground(ground: np.ndarray, new: Surroundings, job: Job) -> np.ndarray:
    """Return places of the ground, how much higher it lies now, and its slope (m, 5).

    `ground` (n, 3) is the earlier one. The terrain model of an update is that of no survey, so it
    does not count.
    """
    rise = TerrainChain(new.without_model().find_grounds(job)).height_at(ground) - ground[:, 2]
    known = np.isfinite(rise)
    xyz = ground[known] - ground[known].mean(axis=0) if known.any() else ground[:0]
    slope = np.linalg.lstsq(xyz[:, :2], xyz[:, 2], rcond=None)[0]
    return np.column_stack([ground[known, :2], rise[known], np.tile(slope, (len(xyz), 1))])
