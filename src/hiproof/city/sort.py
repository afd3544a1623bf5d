"""Read each point file once, in chunks, and leave for each work tile the points its buildings need.

Roof points are those of the building classes inside a building's area; terrain points those of the ground classes in the
whole-metre box around it; of all others (noise excepted) the lowest a cell is kept, in case there is no ground class.
What a building gets depends on its own area alone, not on tiles, files or chunks.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import shapely

from ..read.assign import PointGrid
from ..read.pointcloud import iter_points
from ..read.thin import rank_in_cells
from ..write.files import atomic_file
from .plan import Plan, neighbourhood

GROUND_REACH_M = 10.0
NOISE_CLASSES = (7, 18)
KINDS = ("roof", "ground", "low")


class Chunks:
    """Collects the points of one file by work tile."""

    def __init__(self, plan: Plan):
        self.plan = plan
        self.areas = [job.area for job in plan.jobs]
        self.tree = shapely.STRtree(self.areas)
        self.tile_of_job = {job: tile for tile, members in plan.tiles.items() for job in members}
        self.boxes = {
            tile: np.array([neighbourhood(plan.jobs[i], GROUND_REACH_M) for i in members if not self.areas[i].is_empty])
            for tile, members in plan.tiles.items()
        }
        self.found: dict[str, dict[str, list[np.ndarray]]] = {}
        self.classes: Counter[int] = Counter()

    def add(self, xyz: np.ndarray, classification: np.ndarray | None) -> None:
        if not len(xyz):
            return
        if classification is None:
            classification = np.zeros(len(xyz), np.uint8)
        self.classes.update({int(c): int(n) for c, n in enumerate(np.bincount(classification)) if n})
        read = self.plan.settings.read
        is_roof = np.isin(classification, read.building_classes)
        is_ground = np.isin(classification, read.ground_classes)
        is_other = ~(is_roof | is_ground | np.isin(classification, NOISE_CLASSES))
        self.add_roof(xyz[is_roof])
        self.add_terrain("ground", xyz[is_ground])
        self.add_terrain("low", lowest_in_cells(xyz[is_other]))

    def add_roof(self, xyz: np.ndarray) -> None:
        """Roof points with the number of their building in a fourth column."""
        if not len(xyz):
            return
        grid = PointGrid(xyz[:, :2])
        for job in np.sort(self.tree.query(shapely.box(*xyz[:, :2].min(0), *xyz[:, :2].max(0)))).tolist():
            members = grid.inside(self.areas[job])
            if len(members):
                self.keep(self.tile_of_job[job], "roof", np.column_stack([xyz[members], np.full(len(members), job)]))

    def add_terrain(self, kind: str, xyz: np.ndarray) -> None:
        if not len(xyz):
            return
        low, high = xyz[:, :2].min(0), xyz[:, :2].max(0)
        for tile, boxes in self.boxes.items():
            if len(boxes) and (boxes[:, :2].min(0) <= high).all() and (boxes[:, 2:].max(0) >= low).all():
                self.keep(tile, kind, xyz[in_any_box(xyz[:, :2], boxes)])

    def keep(self, tile: str, kind: str, points: np.ndarray) -> None:
        if len(points):
            self.found.setdefault(tile, {}).setdefault(kind, []).append(points)


def lowest_in_cells(xyz: np.ndarray) -> np.ndarray:
    """The lowest height of each whole-metre cell, at the cell's centre: the lowest of lowest is the same however cut."""
    lowest = rank_in_cells(xyz, 1.0, np.zeros_like)
    return np.column_stack([np.floor(lowest[:, :2]) + 0.5, lowest[:, 2]])


def in_any_box(xy: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Which points (n, 2) lie in at least one of the whole-metre boxes (m, 4), upper sides excluded."""
    low, high = boxes[:, :2].min(0), boxes[:, 2:].max(0)
    wanted = np.zeros((high - low).astype(int), bool)
    for xmin, ymin, xmax, ymax in (boxes - np.tile(low, 2)).astype(int):
        wanted[xmin:xmax, ymin:ymax] = True
    inside = np.all((xy >= low) & (xy < high), axis=1)
    cell = np.floor(xy[inside] - low).astype(int)
    inside[inside] = wanted[cell[:, 0], cell[:, 1]]
    return inside


def sort_cloud(folder: str, number: int) -> dict:
    """Sort point file `number` of the plan in `folder`. Returns {"points": read, "classes": {class: count}}.

    Chunks read before a damaged file breaks off are kept; the InputError is raised after they are on disk.
    """
    root = Path(folder)
    plan = Plan.load(root / "plan.pickle")
    chunks, broken, points = Chunks(plan), None, 0
    try:
        for cloud in iter_points(plan.clouds[number]):
            points += len(cloud)
            chunks.add(cloud.xyz, cloud.classification)
    except Exception as error:
        broken = error
    for tile, found in sorted(chunks.found.items()):
        save_points(root / "points" / tile / f"{number}.npz", found)
    if broken is not None:
        raise broken
    return {"points": points, "classes": dict(chunks.classes)}


def save_points(path: Path, found: dict[str, list[np.ndarray]]) -> None:
    with atomic_file(path) as file:
        np.savez(file, **{kind: np.concatenate(arrays) for kind, arrays in found.items()})


def load_points(root: Path, tile: str) -> dict[str, np.ndarray]:
    """Points of a work tile from all files, by kind: "roof" (n, 4) with the building's number, "ground", "low" (n, 3)."""
    parts = [np.load(path) for path in sorted((root / "points" / tile).glob("*.npz"))]
    return {
        kind: np.concatenate(
            [part[kind] for part in parts if kind in part] or [np.zeros((0, 4 if kind == "roof" else 3))]
        )
        for kind in KINDS
    }
