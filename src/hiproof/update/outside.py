"""Roofs outside all outlines: new buildings, extensions, and others.

Both surveys are compared in cells of a metre, wherever the clouds have points of the building
classes. Cells along outlines, and along roofs of the other survey away from these, start nothing,
since gutters and misfits lie there. In clouds without building classes, level cells high above the
ground are roofs.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..city.plan.work_plan import WorkPlan, load_plan
from ..city.work.sort import sort_cloud
from ..errors import InputWarning
from ..geometry.grid import AROUND_KEYS, KEY_OF_CELL, number_cells
from ..model import PointCloud
from ..settings import ReadSettings
from ..status import ChangeKind
from ..write.files import atomic_file, save_text
from ..write.parameters import outline_record
from .cells import predict_occupancy
from .clusters import ROUGH_M, is_strip, label_cells, measure_roughness
from .kinds import draw_cells
from .plan import EARLIER_FOLDER

OUTSIDE_FILE, CELLS_FOLDER = "outside.json", "cells"
BESIDE_M = 1.0
"""Distance (m) from an outline within which roofs belong to it: gutters, and outlines drawn within
some decimetres."""

EAVES_M = 0.5
"""Depth (m) of eaves that the other survey shows between an outline and a new roof beside it."""

FEWEST_OUTSIDE, FEWEST_BEYOND = 8, 2
"""Cells of 1 m2 that a roof has, and that it has beyond that distance: a shed of 3 by 3 m has them,
and what fills a gap of 5 m between neighbours."""

SPARSE = 0.9
"""Share of the cells of a roof that hold points, below which chance parts a roof into pieces, so
cells belong together that lie up to two cells apart: 1.6 points/m2."""

TWO_AROUND_KEYS = np.unique(AROUND_KEYS[:, None] + AROUND_KEYS)

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


class SurveyCells:
    """The roof and the ground of a survey in cells of a metre.

    A cell (5,) has the mean x, y and z of its points, that of the squares of z, and their number.
    """

    def __init__(self, read: ReadSettings):
        roofs = tuple(set(range(256)) - set(read.ground_classes) - set(NOISE_AND_WATER))
        self.classes = {
            "roof": read.building_classes if read.by_class else roofs,
            "ground": read.ground_classes,
        }
        self.has_classes = read.by_class
        self.found: dict[str, list[np.ndarray]] = {"roof": [], "ground": []}

    def add(self, cloud: PointCloud) -> None:
        """Take the points of a chunk."""
        for kind, classes in self.classes.items():
            is_kind = np.zeros(256, bool)
            is_kind[list(classes)] = True
            points = cloud.xyz.compress(is_kind[cloud.classes], axis=0)
            if len(points):
                rows = np.column_stack([points, points[:, 2] ** 2, np.ones(len(points))])
                self.found[kind].append(average_cells(rows))

    def save(self, path: Path) -> None:
        """Write the cells of a file, the corners (2, 2) of their box, and squares with roofs."""
        path.parent.mkdir(parents=True, exist_ok=True)
        arrays: dict[str, Any] = {kind: join_cells(found) for kind, found in self.found.items()}
        xy = np.concatenate(list(arrays.values()))[:, :2]
        box = [xy.min(axis=0, initial=np.inf), xy.max(axis=0, initial=-np.inf)]
        with atomic_file(path) as file:
            squares = find_squares(find_cells(arrays["roof"]))
            np.savez(file, **arrays, box=box, squares=squares, has_classes=self.has_classes)


def sort_survey(folder: str, number: int, address: str, epoch: str = "") -> dict:
    """Sort a point file of a survey, and keep where its roofs and its ground lie.

    `epoch` is the name of the survey where it is one of several.
    """
    cells = SurveyCells(load_plan(Path(folder)).settings.read)
    result = sort_cloud(folder, number, address, cells.add, epoch)
    cells.save(Path(folder) / CELLS_FOLDER / f"{number}.npz")
    return result


def average_cells(rows: np.ndarray) -> np.ndarray:
    """Return one row a cell of rows (n, 5) as in SurveyCells, each for so many points."""
    values, counts = rows[:, :4], rows[:, 4]
    offset, number = values.min(axis=0), number_cells(find_cells(values))[1]
    total = np.bincount(number, weights=counts)
    sums = [np.bincount(number, weights=counts * column) for column in (values - offset).T]
    return np.column_stack([np.column_stack(sums) / total[:, None] + offset, total])


def find_cells(points: np.ndarray) -> np.ndarray:
    """Return the cell (k, 2) of each of the points (k, 2 or more).

    A mean of points on the lower side of a cell stays in it.
    """
    return np.floor(points[:, :2] + ROUNDING_M).astype(np.int64)


def find_keys(points: np.ndarray) -> np.ndarray:
    """Return the cell (k,) of each of the points (k, 2 or more) as one number."""
    return np.asarray(find_cells(points) @ KEY_OF_CELL)


def join_cells(chunks: list[np.ndarray]) -> np.ndarray:
    """Join the cells of several chunks."""
    if len(chunks) == 1:
        return chunks[0]
    return average_cells(np.concatenate(chunks)) if chunks else np.zeros((0, 5))


def load_survey(
    folder: Path, low: np.ndarray, high: np.ndarray, shift: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    """Load the roof and ground cells (k, 5) of a survey between two corners (2,).

    A `shift` (3,) is taken off them.
    """
    chunks: dict[str, list[np.ndarray]] = {"roof": [], "ground": []}
    has_classes = True
    for path in list_files(folder):
        with np.load(path) as arrays:
            if (arrays["box"][0] > high).any() or (arrays["box"][1] < low).any():
                continue
            has_classes &= bool(arrays["has_classes"])
            for kind, found in chunks.items():
                cells = arrays[kind]
                inside = ((cells[:, :2] >= low) & (cells[:, :2] <= high)).all(axis=1)
                if inside.any():
                    found.append(move_cells(cells[inside], shift))
    result = {kind: join_cells(found) for kind, found in chunks.items()}
    if not has_classes:
        result["roof"] = result["roof"][is_level_and_high(**result)]
    return result


def move_cells(rows: np.ndarray, shift: np.ndarray | None) -> np.ndarray:
    """Return the cells of rows (k, 5) once a shift (3,) is taken off."""
    if shift is None or not shift.any():
        return rows
    squares = rows[:, 3] - 2 * shift[2] * rows[:, 2] + shift[2] ** 2
    return average_cells(np.column_stack([rows[:, :3] - shift, squares, rows[:, 4]]))


def list_files(folder: Path) -> list[Path]:
    return sorted(folder.glob("[0-9]*.npz"))


def is_level_and_high(roof: np.ndarray, ground: np.ndarray) -> np.ndarray:
    """Return whether (k,) cells (k, 5) are level and high above the ground (m, 5)."""
    if not len(ground):
        return np.zeros(len(roof), bool)
    from scipy.spatial import KDTree  # only where classes mark no roofs

    scatter = np.sqrt(np.maximum(roof[:, 3] - roof[:, 2] ** 2, 0.0))
    nearest = KDTree(ground[:, :2]).query(roof[:, :2])[1]
    return (scatter < LEVEL_M) & (roof[:, 2] - ground[nearest, 2] > HIGH_OVER_GROUND_M)


def save_roofs_outside(state: Path, plan: WorkPlan, has_earlier: bool, shift: np.ndarray) -> None:
    """Find the roofs outside all outlines, and keep them in the folder `state`.

    The `shift` (3,) of the new survey is taken off. A roof belongs to the square in which the lower
    left corner of its place lies.
    """
    folders = state / CELLS_FOLDER, state / EARLIER_FOLDER / CELLS_FOLDER
    jobs = [job for job in plan.jobs if not job.area.is_empty]
    outlines, names = shapely.STRtree([job.area for job in jobs]), [job.id for job in jobs]
    found, files = [], [list_files(folder) for folder in folders]
    for name, paths in zip(("new", "earlier")[: 1 + has_earlier], files, strict=False):
        if not any(len(np.load(path)["ground"]) for path in paths):
            warnings.warn(
                f"the {name} survey has no points of a ground class, so roofs outside all "
                "outlines, such as extensions and new buildings, are not found; add classes with "
                "`hiproof classify`",
                InputWarning,
            )
    squares = [np.load(path)["squares"] for paths in files for path in paths]
    for square in np.unique(np.concatenate([np.empty((0, 2)), *squares]), axis=0):
        low = square * BLOCK_M - BLOCK_REACH_M
        high = (square + 1) * BLOCK_M + BLOCK_REACH_M
        new = load_survey(folders[0], low, high, shift)
        old = load_survey(folders[1], low, high)
        roofs = find_unmapped(new, old["roof"] if has_earlier else None, outlines)
        if has_earlier:
            roofs += find_fresh(new["roof"], old, outlines, names, ChangeKind.BUILT)
            roofs += find_fresh(old["roof"], new, outlines, [], ChangeKind.DEMOLISHED)
        for place, roof in roofs:
            if (find_squares(np.array([place.bounds[:2]])) == square).all():
                polygons = [outline_record(polygon) for polygon in shapely.get_parts(place)]
                found.append(roof | {"outlines": polygons})
    save_text(state / OUTSIDE_FILE, json.dumps(found) + "\n")


def find_squares(cells: np.ndarray) -> np.ndarray:
    """Return the squares (k, 2) of BLOCK_M in which cells (n, 2) lie."""
    return np.unique(np.floor(cells / BLOCK_M), axis=0)


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
) -> list[tuple[shapely.Geometry, dict[str, Any]]]:
    """Return roofs that stand on what is bare ground in the other survey.

    `roofs` (k, 5) are the cells of one survey, `other` those of the other one. A roof beside a
    building extends it where `names` of the buildings are known.
    """
    known = find_keys(other["roof"])
    points = roofs[~np.isin(find_keys(roofs), known)]
    points = points[~touches(points, outlines, 0.0)]
    around = find_keys(points)[:, None] + AROUND_KEYS
    away = other["roof"][np.isin(known, around)]
    away = find_keys(away[~touches(away, outlines, BESIDE_M)])
    near = touches(points, outlines, BESIDE_M) | np.isin(around, away).any(axis=1)
    on_ground = np.isin(find_keys(points), find_keys(other["ground"]))
    filled = predict_occupancy(roofs[:, 4])
    found = describe_roofs(points, filled, ~near, on_ground, other["ground"], outlines, kind)
    extended = ChangeKind.EXTENDED.code
    return [
        (place, roof | {"id": names[beside[0]], "kind": extended} if len(beside) else roof)
        for place, beside, roof in found
        if names or not len(beside)
    ]


def find_unmapped(
    survey: dict[str, np.ndarray], other: np.ndarray | None, outlines: shapely.STRtree
) -> list[tuple[shapely.Geometry, dict[str, Any]]]:
    """Return roofs of a survey away from all outlines, which the roof cells of the other show, too.

    Without an `other` survey, all are returned.
    """
    points, is_steady = survey["roof"], None
    points = points[~touches(points, outlines, BESIDE_M)]
    if other is not None:
        _, here, there = np.intersect1d(find_keys(points), find_keys(other), return_indices=True)
        points = points[here]
        is_steady = np.abs(points[:, 2] - other[there, 2]) < LEVEL_M
    every, ground = np.ones(len(points), bool), survey["ground"]
    filled, kind = predict_occupancy(survey["roof"][:, 4]), ChangeKind.UNMAPPED
    found = describe_roofs(points, filled, every, is_steady, ground, outlines, kind)
    return [(place, roof) for place, beside, roof in found if not len(beside)]


def describe_roofs(
    points: np.ndarray,
    filled: float,
    is_core: np.ndarray,
    is_sure: np.ndarray | None,
    ground: np.ndarray,
    outlines: shapely.STRtree,
    kind: ChangeKind,
) -> Iterator[tuple[shapely.Geometry, np.ndarray, dict[str, Any]]]:
    """Yield each roof among cells (k, 5): its place, buildings beside it, its record.

    A share `filled` of a roof's cells holds points. The building that it adjoins most comes first.
    Its confidence is the share of its cells that are sure (k,), of a roof of one survey MOSTLY at
    least. That is None where they are unknown, as is its height without `ground` (m, 5) near it.
    """
    known = predict_occupancy(ground[:, 4])
    for members in group_cells(points, is_core, filled):
        share = None if is_sure is None else float(is_sure[members].mean())
        if share is not None and kind is not ChangeKind.UNMAPPED:
            share = min(1.0, share / known)  # some cells of bare ground hold no points
            if share < MOSTLY:
                continue
        place = draw_cells(find_cells(points[members]), 1.0)
        height = measure_height(points[members], ground)
        record = {
            "id": None,
            "kind": kind.code,
            "area": round(len(members) / filled, 1),
            "height": height if height is None else round(height, 2),
            "confidence": share if share is None else round(share, 2),
        }
        reach = BESIDE_M + (EAVES_M if kind is ChangeKind.BUILT else 0.0)
        beside = outlines.query(place, predicate="dwithin", distance=reach)
        around = shapely.buffer(place, 2 * BESIDE_M)
        shared = shapely.area(shapely.intersection(outlines.geometries[beside], around))
        yield place, beside[np.argsort(-shared, kind="stable")], record


def measure_height(points: np.ndarray, ground: np.ndarray) -> float | None:
    """Return how high (m) a roof lies over the ground around it.

    `points` (k, 5) and `ground` (m, 5) are cells; the result is None where no ground is near.
    """
    low = points[:, :2].min(axis=0) - GROUND_AROUND_M
    high = points[:, :2].max(axis=0) + GROUND_AROUND_M
    middles = find_cells(ground) + 0.5
    heights = ground[((middles >= low) & (middles <= high)).all(axis=1), 2]
    return float(np.median(points[:, 2]) - np.median(heights)) if len(heights) else None


def group_cells(points: np.ndarray, is_core: np.ndarray, filled: float) -> Iterator[np.ndarray]:
    """Yield the members of each roof among cells `points` (k, 5), of which a share is `filled`.

    It has FEWEST_BEYOND of the core (k,) side by side, and FEWEST_OUTSIDE with the cells beside
    these, that form a surface. In sparse surveys empty cells do not part it.
    """
    core, keys = np.flatnonzero(is_core), find_keys(points)
    beside = KEY_OF_CELL if filled > SPARSE else TWO_AROUND_KEYS
    labels = label_cells(keys[core], beside)
    for label in np.flatnonzero(np.bincount(labels) >= FEWEST_BEYOND):
        members = core[labels == label]
        grown = np.isin(keys, keys[members, None] + AROUND_KEYS) & ~is_core
        place = np.union1d(members, np.flatnonzero(grown))
        if len(place) < FEWEST_OUTSIDE * filled or is_strip(points[place], 1.0):
            continue
        if measure_roughness(points[place, :3]) <= ROUGH_M:
            yield place


def touches(points: np.ndarray, outlines: shapely.STRtree, distance_m: float) -> np.ndarray:
    """Return whether (k,) points (k, 2 or more) lie in an outline or so near to one."""
    xy = shapely.points(points[:, :2])
    near = outlines.query(xy, predicate="dwithin", distance=distance_m)[0]
    return np.isin(np.arange(len(points)), near)
