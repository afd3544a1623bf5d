"""Read each point file once, in chunks, and leave for each work tile the points its buildings need.

Roof points are those of the building classes inside a building's area; terrain points those of the ground classes in the
whole-metre box around it. What a building gets depends on its own area alone, not on tiles, files or chunks.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import shapely

from ..read import iter_points
from ..read.split import points_of_footprints
from ..write.files import atomic
from .plan import Plan, neighbourhood

GROUND_REACH_M = 10.0


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
        self.roof: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
        self.ground: dict[str, list[np.ndarray]] = {}
        self.classes: Counter[int] = Counter()

    def add(self, xyz: np.ndarray, classification: np.ndarray | None) -> None:
        if not len(xyz):
            return
        if classification is None:
            classification = np.zeros(len(xyz), np.uint8)
        self.classes.update({int(c): int(n) for c, n in enumerate(np.bincount(classification)) if n})
        read = self.plan.settings.read
        self.add_roof(xyz[np.isin(classification, read.building_classes)])
        if self.plan.terrain is None:
            self.add_ground(xyz[np.isin(classification, read.ground_classes)])

    def add_roof(self, xyz: np.ndarray) -> None:
        if not len(xyz):
            return
        near = np.sort(self.tree.query(shapely.box(*xyz[:, :2].min(0), *xyz[:, :2].max(0))))
        for job, members in zip(near.tolist(), points_of_footprints(xyz, [self.areas[i] for i in near]), strict=True):
            if len(members):
                owner = np.full(len(members), job, np.int32)
                self.roof.setdefault(self.tile_of_job[job], []).append((owner, xyz[members]))

    def add_ground(self, xyz: np.ndarray) -> None:
        if not len(xyz):
            return
        low, high = xyz[:, :2].min(0), xyz[:, :2].max(0)
        for tile, boxes in self.boxes.items():
            if not len(boxes) or (boxes[:, :2].min(0) > high).any() or (boxes[:, 2:].max(0) < low).any():
                continue
            kept = xyz[in_any_box(xyz[:, :2], boxes)]
            if len(kept):
                self.ground.setdefault(tile, []).append(kept)


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
    for tile in sorted(set(chunks.roof) | set(chunks.ground)):
        save_points(root / "points" / tile / f"{number}.npz", chunks.roof.get(tile, []), chunks.ground.get(tile, []))
    if broken is not None:
        raise broken
    return {"points": points, "classes": dict(chunks.classes)}


def save_points(path: Path, roof: list[tuple[np.ndarray, np.ndarray]], ground: list[np.ndarray]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    none = np.zeros((0, 3))
    with atomic(path) as beside, open(beside, "wb") as file:
        np.savez(
            file,
            owner=np.concatenate([o for o, _ in roof] or [np.zeros(0, np.int32)]),
            roof=np.concatenate([p for _, p in roof] or [none]),
            ground=np.concatenate(ground or [none]),
        )


def load_points(root: Path, tile: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(owner (n,), roof points (n, 3), ground points (m, 3)) of a work tile, from all files."""
    parts = [np.load(path) for path in sorted((root / "points" / tile).glob("*.npz"))]
    if not parts:
        return np.zeros(0, np.int32), np.zeros((0, 3)), np.zeros((0, 3))
    return tuple(np.concatenate([part[name] for part in parts]) for name in ("owner", "roof", "ground"))
