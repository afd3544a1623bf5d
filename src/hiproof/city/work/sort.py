"""Sorting of points into work tiles.

Each point file is read once, in chunks, and each tile gets the points that its buildings may need.

Roof points are those of the building classes in the whole-metre box of a building; terrain points
those of the ground classes in the wider box around it; of all others the lowest a cell is kept, in
case there is no ground class, and of noise what lies where roof points may, in case it is a spire.
What a building gets out of them depends on its own area alone, not on tiles, files or chunks.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ...errors import OutputError, raise_interrupt
from ...frames import Units
from ...geometry.point_grid import PointGrid
from ...model import PointCloud
from ...read.points.las import is_copc
from ...read.points.lax import read_lax
from ...read.points.pointcloud import as_input_error, file_kind, iter_points, read_header
from ...settings import ReadSettings
from ...write.files import atomic_file
from ..plan.overrides import REDO, load_redo
from ..plan.work_plan import PLAN_FILE, WorkPlan, enclose, grow_boxes, load_plan
from .ground import lowest_in_cells
from .noted import load_run_boxes, noted_file, save_run_boxes

NOISE_CLASSES = (7, 18)  # of ASPRS: low and high noise
POINT_KINDS = ("roof", "ground", "low", "noise")
ROOF, GROUND, OTHER, NOISE = range(4)  # kinds of points, by what a work tile needs them for
# points of a chunk are grouped by squares of this side, so that a tile looks at its own alone
SQUARE_M = 50.0
HELD_POINTS = 4_000_000  # about 100 MB: beyond it what was gathered goes to disk
MASKS_KEPT = 200  # tiles whose mask stays in memory; 100 kB each make 20 MB
QUERY_M = 500.0  # side of the boxes in which an indexed file is asked for its points


@dataclass(frozen=True)
class Reach:
    """The whole-metre boxes (m, 4) in which points of a tile's buildings may lie."""

    roof_boxes: np.ndarray
    terrain_boxes: np.ndarray

    @cached_property
    def bounds(self) -> np.ndarray:
        """(xmin, ymin, xmax, ymax) of all boxes."""
        return enclose(np.vstack([self.terrain_boxes, self.roof_boxes]))

    @cached_property
    def mask(self) -> np.ndarray:
        """A byte a whole-metre cell (columns, rows).

        Bit 0 is in a roof box, bit 1 in a terrain box.
        """
        lower, upper = self.bounds[:2], self.bounds[2:]
        mask = np.zeros((upper - lower).astype(int), np.uint8)
        for bit, boxes in ((1, self.roof_boxes), (2, self.terrain_boxes)):
            for xmin, ymin, xmax, ymax in (boxes - np.tile(lower, 2)).astype(int):
                mask[xmin:xmax, ymin:ymax] |= bit
        return mask

    def bits(self, xy: np.ndarray, index: np.ndarray) -> np.ndarray:
        """Return the mask (k,) at points `xy[index]`, 0 outside the bounds and on upper sides."""
        column, row = np.floor(xy[index, :2] - self.bounds[:2]).astype(np.int64).T
        columns, rows = self.mask.shape
        is_on = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        return np.where(is_on, self.mask[column.clip(0, columns - 1), row.clip(0, rows - 1)], 0)


class Reaches:
    """The reach of every work tile that needs points, by place, made once a process.

    Where `only` names tiles, and of each the buildings that points are wanted for, it is the reach
    of these alone.
    """

    def __init__(self, plan: WorkPlan, only: Mapping[str, Sequence[int]] | None = None):
        bounds = shapely.bounds([job.area for job in plan.jobs])  # NaN where an area is empty
        self.roof_boxes = plan.roof_boxes
        self.terrain_boxes = grow_boxes(bounds, plan.terrain_reach_m)
        self.is_partial = only is not None
        self.members = {
            tile: with_area
            for tile, members in (plan.tiles if only is None else only).items()
            if (with_area := [i for i in members if not plan.jobs[i].area.is_empty])
        }
        self.names = list(self.members)
        self.bounds = np.array([self.of(tile).bounds for tile in self.names]).reshape(-1, 4)
        self.tree = shapely.STRtree(shapely.box(*self.bounds.T))

    def near(self, box: Iterable[float]) -> np.ndarray:
        """Return the tiles (t,) whose reach meets a box, in plan order, as places in `names`.

        `box` is (xmin, ymin, xmax, ymax).
        """
        return np.sort(self.tree.query(shapely.box(*box)))

    def of(self, tile: str) -> Reach:
        members = self.members[tile]
        return Reach(self.roof_boxes[members], self.terrain_boxes[members])


@functools.lru_cache(maxsize=1)
def load_reaches(root: Path, stamp: int) -> Reaches:
    """Load the reaches of the plan in `root`.

    Its file has the time `stamp`. Where buildings are redone, they are theirs alone.
    """
    return Reaches(load_plan(root), load_redo(root) or None)


class Gatherer:
    """A collector of a file's points by tile, written to `folder` as often as memory asks."""

    def __init__(self, reaches: Reaches, read: ReadSettings, folder: Path, number: int):
        self.folder, self.number, self.read = folder, number, read
        self.reach_of = functools.lru_cache(maxsize=MASKS_KEPT)(reaches.of)
        self.names, self.near = reaches.names, reaches.near
        self.low_kinds = (OTHER, ROOF) if read.roofs == "shape" else (OTHER,)
        self.found: dict[str, dict[str, list[np.ndarray]]] = {}
        self.classes: Counter[int] = Counter()
        self.points = self.held = self.flushes = 0

    def add(self, cloud: PointCloud) -> None:
        """Take from a chunk what any tile needs."""
        self.points += len(cloud)
        classes = cloud.classes
        self.classes.update({int(c): int(n) for c, n in enumerate(np.bincount(classes)) if n})
        kinds = self.classify_las_classes()[classes]
        grid = PointGrid(cloud.xyz, SQUARE_M)
        for tile in map(self.names.__getitem__, self.near(grid.bounds)):
            reach = self.reach_of(tile)
            candidates = grid.candidates(reach.bounds)
            bits = reach.bits(cloud.xyz, candidates)
            candidates, bits = candidates[bits > 0], bits[bits > 0]
            kind, in_roof_box, in_box = kinds[candidates], bits & 1 > 0, bits & 2 > 0
            for name, mask in (
                ("roof", in_roof_box & (kind == ROOF)),
                ("ground", in_box & (kind == GROUND)),
                ("noise", in_roof_box & (kind == NOISE)),
                ("low", in_box & np.isin(kind, self.low_kinds)),
            ):
                points = cloud.xyz.take(candidates[mask], axis=0)
                points = lowest_in_cells(points) if name == "low" else points
                if len(points):
                    self.found.setdefault(tile, {}).setdefault(name, []).append(points)
                    self.held += len(points)
        if self.held > HELD_POINTS:
            self.flush()

    def classify_las_classes(self) -> np.ndarray:
        """Return ROOF, GROUND, OTHER or NOISE (256,) by LAS class.

        A class that is both counts as roof.
        """
        kinds = np.full(256, OTHER, np.uint8)
        for classes, kind in (
            (NOISE_CLASSES, NOISE),
            (self.read.ground_classes, GROUND),
            (self.read.building_classes, ROOF),
        ):
            kinds[list(classes)] = kind
        return kinds

    def flush(self) -> None:
        """Write what is held, a file a tile.

        Done again after a kill, it writes the same files.
        """
        for tile, result in sorted(self.found.items()):
            with atomic_file(self.folder / tile / f"{self.number}-{self.flushes}.npz") as file:
                arrays: dict[str, Any] = {
                    kind: np.concatenate(items) for kind, items in result.items()
                }
                np.savez(file, **arrays)
        self.found, self.held, self.flushes = {}, 0, self.flushes + 1


def sort_cloud(
    folder: str,
    number: int,
    address: str,
    watch: Callable[[PointCloud], None] | None = None,
    epoch: str = "",
) -> dict:
    """Sort the point file at `address`, file `number` of the plan in `folder`.

    Returns {"points": read, "classes": {class: count}}. Of a file that breaks off, or is not what
    its header says, nothing is kept. Raises InputError for whatever reading it comes to, so that a
    file's failure is that file's alone; what writing comes to passes through. With `watch`, which
    is called with each chunk, the whole file is read. The points of an `epoch` stand in a folder of
    their own.
    """
    root = Path(folder)
    stamps = [
        (root / name).stat().st_mtime_ns for name in (PLAN_FILE, REDO) if (root / name).exists()
    ]
    plan, reaches = load_plan(root), load_reaches(root, max(stamps))
    gatherer = Gatherer(reaches, plan.settings.read, root / "points" / epoch, number)
    noted = noted_file(root, number)
    result: list[np.ndarray] = []
    try:
        is_whole = watch is not None
        for cloud in wanted_points(address, reaches, plan.units, noted, result, is_whole):
            gatherer.add(cloud)
            if watch is not None:
                watch(cloud)
    except (MemoryError, OutputError):
        raise
    except Exception as error:
        for written in gatherer.folder.glob(f"*/{number}-*.npz"):  # of this file
            written.unlink(missing_ok=True)
        raise_interrupt(error)
        raise as_input_error(error, address) from error
    gatherer.flush()
    if result:
        save_run_boxes(noted, result, read_header(address).count)
    return {"points": gatherer.points, "classes": dict(gatherer.classes)}


def wanted_points(
    path: str,
    reaches: Reaches,
    units: Units,
    noted: Path,
    result: list[np.ndarray] | None = None,
    is_whole: bool = False,
) -> Iterator[PointCloud]:
    """Yield the chunks of a file in `units` that may be needed.

    All chunks are, unless the file has a spatial index, or the places of its points are in the file
    `noted`: then only those around buildings, if it is not `is_whole`. Where it is read from end to
    end, `result` gets these places (noted.py).
    """
    if file_kind(path) != "las":
        return iter_points(path, units=units)
    header = read_header(path)
    box = units.to_metres(np.array(header.bounds)[[0, 1, 3, 4]])
    if is_whole:
        return iter_points(path, units=units, noted=None if is_copc(path) else result)
    if reaches.is_partial and np.isfinite(box).all() and not len(reaches.near(box)):
        return iter(())
    if is_copc(path):
        return points_by_squares(path, reaches, units)
    index = read_lax(path) or load_run_boxes(noted, header.count)
    if index is None:
        return iter_points(path, units=units, noted=result)
    boxes = units.from_metres(reaches.bounds)
    return iter_points(path, runs=index.find_runs(boxes), units=units)


def points_by_squares(path: str, reaches: Reaches, units: Units) -> Iterator[PointCloud]:
    """Yield a COPC file's points in the boxes around buildings.

    The boxes are squares of QUERY_M, so that memory stays bounded; of the octree only nodes at
    their common borders are decoded twice. A point on a border may come twice, as in files that
    overlap.
    """
    box = units.to_metres(np.reshape(read_header(path).bounds, (2, 3))[:, :2])
    bounds = reaches.bounds[reaches.near(box.ravel())].reshape(-1, 2, 2)
    corners = np.floor(np.clip(bounds, *box) / QUERY_M).astype(np.int64)
    squares = {
        square
        for (left, lower), (right, upper) in corners.tolist()
        for square in product(range(left, right + 1), range(lower, upper + 1))
    }
    for column, row in sorted(squares):
        square = QUERY_M * np.array([column, row, column + 1, row + 1])
        nearby = reaches.bounds[reaches.near(square)]
        if len(nearby):
            around = enclose(nearby)
            part = (*np.maximum(square[:2], around[:2]), *np.minimum(square[2:], around[2:]))
            yield from iter_points(path, box=part, units=units)


def load_points(root: Path, tile: str, epoch: str = "") -> dict[str, np.ndarray]:
    """Load points (n, 3) of a tile, or of an `epoch`, as "roof", "ground", "low" and "noise"."""
    # a name that starts with a dot is what a killed worker left unfinished
    return load_files(sorted((root / "points" / epoch / tile).glob("[!.]*.npz")))


def load_files(files: Iterable[Path], kinds: Sequence[str] = POINT_KINDS) -> dict[str, np.ndarray]:
    """Load the points (n, 3) of some kinds from files of a work tile."""
    result: dict[str, list[np.ndarray]] = {kind: [np.zeros((0, 3))] for kind in kinds}
    for path in files:
        with np.load(path) as part:
            for kind in result.keys() & set(part.files):
                result[kind].append(part[kind])
    return {kind: np.concatenate(arrays) for kind, arrays in result.items()}
