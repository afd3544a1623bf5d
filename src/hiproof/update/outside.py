"""Roofs outside all outlines: new buildings, extensions, and others.

Both surveys are compared in cells of a metre, wherever the clouds have points of the building
classes. Cells along outlines and along roofs of the other survey start nothing, since gutters and
misfits lie there. In clouds without building classes, level cells high above the ground are roofs.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..city.plan.work_plan import WorkPlan, load_plan
from ..city.work.sort import sort_cloud
from ..geometry.components import label_components
from ..geometry.grid import KEY_OF_CELL, number_cells
from ..model import PointCloud
from ..settings import ReadSettings
from ..status import ChangeKind
from ..write.files import atomic, atomic_file
from ..write.parameters import outline_record
from .clusters import ROUGH_M, is_strip, link_neighbours, measure_roughness
from .plan import EARLIER_FOLDER

OUTSIDE_FILE, CELLS_FOLDER = "outside.json", "cells"
BESIDE_M = 1.0
"""Distance (m) from an outline within which roofs belong to it: gutters, and outlines drawn within
some decimetres."""

FEWEST_OUTSIDE = 8
"""Cells of 1 m2 that a roof has beyond that: a shed of 3 by 3 m has them."""

MOSTLY = 0.5
"""Share of the cells that show what stood there in the other survey."""

NOISE_AND_WATER = (7, 9, 18)  # classes of ASPRS: noise and water
LEVEL_M = 0.5
"""Scatter (m) of the heights of a cell below which they lie on a roof: one of 60 degrees has it,
crowns have metres."""

HIGH_OVER_GROUND_M = 2.0
"""Height (m) of a roof over the nearest ground: cars and hedges are lower."""

GROUND_AROUND_M = 3.0
"""Distance (m) around a roof within which the ground counts that its height is measured from."""

BLOCK_M, BLOCK_REACH_M = 1000.0, 200.0
"""Side (m) of the squares that are searched one after the other, and how far around each cells are
loaded: roofs that are longer are cut."""

ROUNDING_M = 1e-6  # far above the errors of a mean, far below the millimetres of coordinates

AROUND = np.array([(u, v) for u in (-1, 0, 1) for v in (-1, 0, 1)])


class SurveyCells:
    """The roof and the ground of a survey in cells of a metre."""

    def __init__(self, read: ReadSettings):
        roofs = tuple(set(range(256)) - set(read.ground_classes) - set(NOISE_AND_WATER))
        self.classes = {
            "roof": read.building_classes if read.by_class else roofs,
            "ground": read.ground_classes,
        }
        self.has_classes = read.by_class
        self.found: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {"roof": [], "ground": []}

    def add(self, cloud: PointCloud) -> None:
        """Take the points of a chunk."""
        for kind, classes in self.classes.items():
            is_kind = np.zeros(256, bool)
            is_kind[list(classes)] = True
            points = cloud.xyz.compress(is_kind[cloud.classes], axis=0)
            if len(points):
                squared = np.column_stack([points, points[:, 2] ** 2])
                self.found[kind].append(average_cells(squared))

    def save(self, path: Path) -> None:
        """Write the cells of a file."""
        path.parent.mkdir(parents=True, exist_ok=True)
        arrays: dict[str, Any] = {"has_classes": self.has_classes}
        for kind, chunks in self.found.items():
            means, counts = join_cells(chunks)
            arrays |= {kind: means, f"{kind}_count": counts}
        x, y = np.concatenate([arrays["roof"], arrays["ground"]])[:, :2].T
        if len(x):
            arrays["bounds"] = [x.min(), y.min(), x.max(), y.max()]
        with atomic_file(path) as file:
            np.savez(file, **arrays)


def sort_survey(folder: str, number: int, address: str, epoch: str = "") -> dict:
    """Sort a point file of a survey, and keep where its roofs and its ground lie.

    `epoch` is the name of the survey where it is one of several.
    """
    cells = SurveyCells(load_plan(Path(folder)).settings.read)
    result = sort_cloud(folder, number, address, cells.add, epoch)
    cells.save(Path(folder) / CELLS_FOLDER / f"{number}.npz")
    return result


def average_cells(
    points: np.ndarray, counts: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean (k, 4) and the number of points (k,) of each cell.

    `points` (n, 4), x y z and the square of z, stand for so many points, `counts` (n,), each; None
    is for one.
    """
    offset, number = points.min(axis=0), number_cells(find_cells(points))[1]
    total = np.bincount(number, weights=counts)
    columns = (values - low for values, low in zip(points.T, offset, strict=True))
    weights = columns if counts is None else (counts * values for values in columns)
    sums = [np.bincount(number, weights=values) for values in weights]
    return np.column_stack(sums) / total[:, None] + offset, total.astype(float)


def find_cells(points: np.ndarray) -> np.ndarray:
    """Return the cell (k, 2) of each of the points (k, 2 or 3).

    A mean of points on the lower side of a cell stays in it.
    """
    return np.floor(points[:, :2] + ROUNDING_M).astype(np.int64)


def join_cells(chunks: Sequence[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Join the cells of several chunks."""
    if not chunks:
        return np.zeros((0, 4)), np.zeros(0)
    if len(chunks) == 1:
        return chunks[0]
    return average_cells(*(np.concatenate(arrays) for arrays in zip(*chunks, strict=True)))


def load_survey(folder: Path, box: shapely.Polygon) -> dict[str, np.ndarray]:
    """Load the roof and ground cells (k, 3) of a survey in a box, as mean points."""
    chunks: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {"roof": [], "ground": []}
    has_classes, (west, south, east, north) = True, box.bounds
    for path in list_files(folder, box):
        with np.load(path) as arrays:
            has_classes &= bool(arrays["has_classes"])
            for kind, found in chunks.items():
                means, counts = arrays[kind], arrays[f"{kind}_count"]
                x, y = means[:, :2].T
                inside = (x >= west) & (x <= east) & (y >= south) & (y <= north)
                if inside.any():
                    found.append((means[inside], counts[inside]))
    roof, ground = (join_cells(found)[0] for found in chunks.values())
    if not has_classes:
        roof = roof[is_level_and_high(roof, ground)]
    return {"roof": roof[:, :3], "ground": ground[:, :3]}


def list_files(folder: Path, box: shapely.Polygon | None = None) -> list[Path]:
    """Return the files of a survey's cells, those that meet a box."""
    paths = sorted(folder.glob("[0-9]*.npz"))
    return [path for path in paths if box is None or shapely.intersects(read_box(path), box)]


def read_box(path: Path) -> shapely.Polygon:
    """Return the box around the cells of a file, which may be empty."""
    with np.load(path) as arrays:
        return shapely.box(*arrays["bounds"]) if "bounds" in arrays else shapely.Polygon()


def is_level_and_high(cells: np.ndarray, ground: np.ndarray) -> np.ndarray:
    """Return whether (k,) cells (k, 4) are level and high above the ground (m, 4)."""
    if not len(ground):
        return np.zeros(len(cells), bool)
    from scipy.spatial import KDTree  # only where classes mark no roofs

    scatter = np.sqrt(np.maximum(cells[:, 3] - cells[:, 2] ** 2, 0.0))
    nearest = KDTree(ground[:, :2]).query(cells[:, :2])[1]
    return (scatter < LEVEL_M) & (cells[:, 2] - ground[nearest, 2] > HIGH_OVER_GROUND_M)


@dataclass(frozen=True)
class RoofOutside:
    """A roof outside all outlines; `id` is the building that it extends, if any.

    `height_m` is that over the ground. `confidence` is the share of its cells that lie bare in the
    other survey, or for an unmapped roof the share that lie as high there. Both are None where they
    are unknown.
    """

    kind: ChangeKind
    area_m2: float
    place: shapely.Geometry
    height_m: float | None
    confidence: float | None
    id: str | None = None

    def to_record(self) -> dict[str, Any]:
        """Return the roof for JSON."""
        polygons = [outline_record(polygon) for polygon in shapely.get_parts(self.place)]
        return {
            "id": self.id,
            "kind": self.kind.code,
            "area": self.area_m2,
            "height": None if self.height_m is None else round(self.height_m, 2),
            "confidence": None if self.confidence is None else round(self.confidence, 2),
            "outlines": polygons,
        }


def save_roofs_outside(state: Path, plan: WorkPlan, has_earlier: bool) -> None:
    """Find the roofs outside all outlines, and keep them in the folder `state`."""
    folders = state / CELLS_FOLDER, state / EARLIER_FOLDER / CELLS_FOLDER
    jobs = [job for job in plan.jobs if not job.area.is_empty]
    outlines, names = shapely.STRtree([job.area for job in jobs]), [job.id for job in jobs]
    found = []
    for corner in list_corners([*list_files(folders[0]), *list_files(folders[1])]):
        box = shapely.box(*(corner - BLOCK_REACH_M), *(corner + BLOCK_M + BLOCK_REACH_M))
        new, old = (load_survey(folder, box) for folder in folders)
        roofs = find_unmapped(new, old["roof"] if has_earlier else None, outlines)
        if has_earlier:
            roofs += find_fresh(new["roof"], old, outlines, names, ChangeKind.BUILT)
            roofs += find_fresh(old["roof"], new, outlines, [], ChangeKind.DEMOLISHED)
        square = np.array([corner, corner + BLOCK_M])
        found += [roof for roof in roofs if begins_in(square, roof.place)]
    with atomic(state / OUTSIDE_FILE) as temporary:
        records = [roof.to_record() for roof in found]
        Path(temporary).write_text(json.dumps(records) + "\n", encoding="utf-8")


def list_corners(files: list[Path]) -> list[np.ndarray]:
    """Return the lower left corners (2,) of the squares that hold all cells."""
    bounds = shapely.total_bounds([read_box(path) for path in files])
    if not np.isfinite(bounds).all():
        return []
    first = np.floor(bounds[:2])
    columns, rows = np.floor((bounds[2:] - first) / BLOCK_M).astype(int) + 1
    return [first + BLOCK_M * np.array([i, j]) for i in range(columns) for j in range(rows)]


def begins_in(square: np.ndarray, place: shapely.Geometry) -> bool:
    """Return whether the lower left corner of a place lies in a square (2, 2)."""
    corner = np.array(place.bounds[:2])
    return bool((square[0] <= corner).all() and (corner < square[1]).all())


def load_roofs_outside(state: Path) -> list[dict[str, Any]]:
    """Load what `save_roofs_outside` kept."""
    path = state / OUTSIDE_FILE
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else []


def find_fresh(
    roofs: np.ndarray,
    other: dict[str, np.ndarray],
    outlines: shapely.STRtree,
    names: list[str],
    kind: ChangeKind,
) -> list[RoofOutside]:
    """Return roofs that stand on what is bare ground in the other survey.

    `roofs` (k, 3) are the cells of one survey, `other` those of the other one. A roof beside a
    building extends it where `names` of the buildings are known.
    """
    points = roofs[~is_among(find_cells(roofs), find_cells(other["roof"]))]
    points = points[~touches(points, outlines, 0.0)]
    near = touches(points, outlines, BESIDE_M) | is_beside(points, other["roof"])
    on_ground = is_among(find_cells(points), find_cells(other["ground"]))
    result = []
    for members in group_cells(points, ~near):
        if on_ground[members].mean() < MOSTLY:
            continue
        place = draw_places(points[members])
        height = measure_height(points[members], other["ground"])
        found = float(len(members)), place, height, float(on_ground[members].mean())
        beside = outlines.query(place, predicate="dwithin", distance=BESIDE_M)
        if len(beside) and names:
            id = names[int(outlines.query_nearest(place, all_matches=False)[0])]
            result.append(RoofOutside(ChangeKind.EXTENDED, *found, id))
        elif not len(beside):
            result.append(RoofOutside(kind, *found))
    return result


def find_unmapped(
    survey: dict[str, np.ndarray], other: np.ndarray | None, outlines: shapely.STRtree
) -> list[RoofOutside]:
    """Return roofs of a survey away from all outlines, which the roof cells of the other show, too.

    Without an `other` survey, all are returned.
    """
    points = survey["roof"][~touches(survey["roof"], outlines, BESIDE_M)]
    is_steady = None
    if other is not None:
        keys = [find_cells(cells) @ KEY_OF_CELL for cells in (points, other)]
        _, here, there = np.intersect1d(*keys, return_indices=True)
        points = points[here]
        is_steady = np.abs(points[:, 2] - other[there, 2]) < LEVEL_M
    result = []
    for members in group_cells(points, np.ones(len(points), bool)):
        place, height = (
            draw_places(points[members]),
            measure_height(points[members], survey["ground"]),
        )
        confidence = None if is_steady is None else float(is_steady[members].mean())
        if not len(outlines.query(place, predicate="dwithin", distance=BESIDE_M)):
            roof = RoofOutside(ChangeKind.UNMAPPED, float(len(members)), place, height, confidence)
            result.append(roof)
    return result


def measure_height(points: np.ndarray, ground: np.ndarray) -> float | None:
    """Return how high (m) a roof lies over the ground around it.

    `points` (k, 3) and `ground` (m, 3) are cells; the result is None where no ground is near.
    """
    low, high = (f(points[:, :2], axis=0) for f in (np.min, np.max))
    low, high = low - GROUND_AROUND_M, high + GROUND_AROUND_M
    middles = find_cells(ground) + 0.5
    heights = ground[((middles >= low) & (middles <= high)).all(axis=1), 2]
    return float(np.median(points[:, 2]) - np.median(heights)) if len(heights) else None


def group_cells(points: np.ndarray, is_core: np.ndarray) -> list[np.ndarray]:
    """Return the members of each roof among cells `points` (k, 3).

    It has FEWEST_OUTSIDE of the core (k,) side by side that form a surface, and the cells beside
    these.
    """
    core = np.flatnonzero(is_core)
    cells = find_cells(points)
    labels = label_components(len(core), link_neighbours(cells[core]))
    numbers, sizes = np.unique(labels, return_counts=True)
    result = []
    for label in numbers[sizes >= FEWEST_OUTSIDE]:
        members = core[labels == label]
        if is_strip(points[members]) or measure_roughness(points[members]) > ROUGH_M:
            continue
        around = (cells[members][:, None] + AROUND).reshape(-1, 2)
        grown = is_among(cells, around) & ~is_core
        result.append(np.union1d(members, np.flatnonzero(grown)))
    return result


def touches(points: np.ndarray, outlines: shapely.STRtree, distance_m: float) -> np.ndarray:
    """Return whether (k,) points (k, 3) lie in an outline or so near to one."""
    result = np.zeros(len(points), bool)
    xy = shapely.points(points[:, :2])
    result[outlines.query(xy, predicate="dwithin", distance=distance_m)[0]] = True
    return result


def is_beside(points: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return whether (k,) cells have one of `others` around them."""
    around = (find_cells(points)[:, None] + AROUND).reshape(-1, 2)
    is_known = is_among(around, find_cells(others)).reshape(-1, len(AROUND))
    return np.asarray(is_known.any(axis=1))


def is_among(cells: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return whether (k,) `cells` (k, 2) are among `others` (m, 2)."""
    return np.isin(cells @ KEY_OF_CELL, others @ KEY_OF_CELL)


def draw_places(points: np.ndarray) -> shapely.Geometry:
    """Return the outline of the cells of points (k, 3)."""
    low = find_cells(points)
    return shapely.union_all(shapely.box(*low.T, *(low + 1).T))
