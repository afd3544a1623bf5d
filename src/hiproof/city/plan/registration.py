"""The common shift of a run's footprints onto its roofs, estimated before there are tiles.

The data set is all footprints of the file within the clouds, whichever of them --where or --bbox
choose, and the roof points in a sample of its squares of CELL_M. The sample follows from the places
of the footprints alone. So a building is moved alike in every run on these files.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import product

import numpy as np
import shapely

from ...errors import InputWarning, raise_interrupt, warn
from ...fit.registration import (
    FARTHEST_SHIFT_M,
    LEAST_FOOTPRINTS,
    Registration,
    register,
)
from ...frames import Box, Units
from ...geometry.grid import number_cells
from ...model import Footprint, PointCloud
from ...read.points.las import is_copc
from ...read.points.lax import read_lax
from ...read.points.pointcloud import PointFileHeader, file_kind, iter_points, list_boxes
from ...settings import ReadSettings, Settings

SAMPLE_CELL_M = 250.0
"""Side (m) of the squares of the world that are sampled: some dozens of houses."""

ENOUGH_FOOTPRINTS, MOST_CELLS, MOST_FILES = 400, 16, 8
"""The sample ends with so many footprints: their mean is known to 0.02 m.

The others bound what is read for it.
"""

SUSPECTED_M, TWO_SIGMAS = 0.5, 2.0
"""Length (m) of an unclear shift, with so many standard deviations, from which on a warning gives
it: sound outlines lie 0.1 to 0.3 m off."""

BORDER_M = 0.5
"""Distance (m) by which footprints may reach beyond the clouds: as far as sparse points lie apart,
also between two files."""

CELL_MARGIN_M = FARTHEST_SHIFT_M + 1.0
"""How far (m) around a square footprints bear on its points."""

HIGH_M, GROUND_CELL_M = 2.5, 2.0
"""Height (m) above the ground from which on points may be of roofs where no class marks these, and
side (m) of the cells in which the ground is looked for."""

Cell = tuple[int, int]
Point = tuple[float, float]


def register_footprints(
    footprints: tuple[Footprint, ...],
    headers: list[PointFileHeader],
    units: Units,
    settings: Settings,
    path: str,
    is_known: Callable[[Point], bool] = lambda _: False,
) -> Registration | None:
    """Estimate the common shift of footprints; warn where it is clear.

    `path` is that of their file. None where it is not looked for. `is_known` says whether something
    other than roofs shows a shift (m), which then few may show.
    """
    if settings.reconstruct.align == "off":
        return None
    registration = find_registration(footprints, headers, units, settings)
    if registration.is_likely and is_known(registration.xy):
        registration = dataclasses.replace(registration, is_confirmed=True)
    warn_if_moved(registration, path)
    return registration


def find_registration(
    footprints: tuple[Footprint, ...],
    headers: list[PointFileHeader],
    units: Units,
    settings: Settings,
) -> Registration:
    """Estimate the common shift of `footprints` onto roof points.

    Points are those of the files with `headers`.
    """
    boxes = units.to_metres(list_boxes(headers))
    # the whole plane where a header knows none
    boxes[~np.isfinite(boxes).all(axis=1)] = [-np.inf, -np.inf, np.inf, np.inf]
    polygons = np.array([f.polygon for f in footprints if not f.polygon.is_empty])
    polygons = polygons[lie_within(polygons, boxes)]
    number_of = footprints_by_cell(polygons)
    cells, files = sample_cells(number_of, boxes)
    points = points_by_cell(cells, [headers[i].path for i in sorted(files)], units, settings.read)
    tree = shapely.STRtree(polygons)
    selected_cells = [cell for cell in cells if cell in points]

    def find_polygons(cell: Cell) -> list[shapely.Polygon]:
        """Return the footprints in and around a cell."""
        indices = tree.query(shapely.box(*expand_cell(cell, CELL_MARGIN_M)))
        return list(polygons[np.sort(indices)])

    result = register((points[cell], find_polygons(cell)) for cell in selected_cells)
    return dataclasses.replace(result, footprints=sum(number_of[cell] for cell in selected_cells))


def is_suspected(registration: Registration) -> bool:
    """Return whether footprints may lie beside their roofs, though they are not moved."""
    largest_m = registration.length + TWO_SIGMAS * max(registration.sigma)
    return (
        not registration.is_clear
        and registration.footprints >= LEAST_FOOTPRINTS
        and registration.squares > 0
        and largest_m >= SUSPECTED_M
    )


def warn_if_moved(registration: Registration, path: str) -> None:
    """Warn (InputWarning) where the footprints at `path` are moved, or perhaps should be."""
    (x, y), sigma = registration.xy, max(registration.sigma)
    if is_suspected(registration):
        lies = f"({-x:.2f}, {-y:.2f}) m with a standard deviation of {sigma:.2f} m"
        found = f"by {lies}" if math.isfinite(sigma) else "but points fit them nowhere better"
        warn(
            path,
            f"all footprints may lie beside their roofs, {found}. The {registration.footprints} "
            "used show too little to tell, so they are not moved all alike; compare them with the "
            "cloud, and check the CRS of both and the classes of the cloud",
        )
    if registration.is_clear:
        warn(
            path,
            f"all footprints lie beside their roofs and are moved by ({x:.2f}, {y:.2f}) m, with a "
            f"standard deviation of {sigma:.2f} m; check the CRS of footprints and clouds, or keep "
            "them in place with --align off",
        )


def lie_within(polygons: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Return which polygons lie wholly within the `boxes` (n, 4) of the clouds.

    A roof that the border of the clouds cuts fits its footprint in many places.
    """
    if not np.isfinite(boxes).all():
        return np.ones(len(polygons), bool)
    clouds = shapely.union_all(shapely.box(*(boxes + [-BORDER_M, -BORDER_M, BORDER_M, BORDER_M]).T))
    shapely.prepare(clouds)
    return shapely.covers(clouds, polygons)


def footprints_by_cell(polygons: np.ndarray) -> dict[Cell, int]:
    """Count the footprints with their lower left corner in each square.

    Squares that footprints only reach into have 0: without them roofs on a border would be cut, and
    half a roof fits its footprint in many places.
    """
    bounds = np.floor(shapely.bounds(polygons).reshape(-1, 4) / SAMPLE_CELL_M).astype(np.int64)
    number_of: Counter[Cell] = Counter()
    for column, row, last_column, last_row in bounds.tolist():
        for cell in product(range(column, last_column + 1), range(row, last_row + 1)):
            number_of[cell] += cell == (column, row)
    return number_of


def sample_cells(number_of: dict[Cell, int], boxes: np.ndarray) -> tuple[list[Cell], set[int]]:
    """Sample squares, and return the numbers of the files that hold them.

    A hash of their place draws them.

    `number_of` counts the footprints of each square, `boxes` (n, 4) are those of the files.
    """
    cells: list[Cell] = []
    files: set[int] = set()
    footprints = 0
    for cell in sorted(number_of, key=hash_cell):
        meeting = set(np.flatnonzero(meets(boxes, expand_cell(cell))).tolist())
        if not meeting or len(files | meeting) > max(MOST_FILES, len(meeting)):
            continue
        files |= meeting
        cells.append(cell)
        footprints += number_of[cell]
        if footprints >= ENOUGH_FOOTPRINTS or len(cells) >= MOST_CELLS:
            break
    return cells, files


def hash_cell(cell: Cell) -> bytes:
    """Return a number as good as a draw, the same on every machine."""
    return hashlib.blake2b(f"{cell[0]} {cell[1]}".encode(), digest_size=8).digest()


def expand_cell(cell: Cell, around_m: float = 0.0) -> Box:
    """Return the square of a cell with a margin: (xmin, ymin, xmax, ymax)."""
    x, y = SAMPLE_CELL_M * cell[0], SAMPLE_CELL_M * cell[1]
    return x - around_m, y - around_m, x + SAMPLE_CELL_M + around_m, y + SAMPLE_CELL_M + around_m


def meets(boxes: np.ndarray, box: Box) -> np.ndarray:
    """Return which of `boxes` (n, 4) meet `box`."""
    return np.all(boxes[:, :2] <= box[2:], axis=1) & np.all(boxes[:, 2:] >= box[:2], axis=1)


def points_by_cell(
    cells: list[Cell], paths: list[str], units: Units, read: ReadSettings
) -> dict[Cell, np.ndarray]:
    """Return the roof points (n, 2) of the `cells`, of all readable files.

    Where no class marks roofs, they are the points high above the ground. The step that sorts
    points names the files that cannot be read.
    """
    by_height = read.roofs == "shape"
    classes = read.building_classes + read.ground_classes * by_height
    result: dict[Cell, list[np.ndarray]] = {}
    boxes = np.array([expand_cell(cell) for cell in cells])
    for path in paths:
        for cloud in readable_chunks(path, boxes, units):
            xyz = cloud.xyz[np.isin(cloud.classes, classes), : 3 if by_height else 2]
            places, number = number_cells(np.floor(xyz[:, :2] / SAMPLE_CELL_M))
            for k, (i, j) in enumerate(places.tolist()):
                if (i, j) in cells:
                    result.setdefault((i, j), []).append(xyz[number == k])
    select = select_high if by_height else np.asarray
    return {cell: select(np.concatenate(parts)) for cell, parts in result.items()}


def select_high(xyz: np.ndarray) -> np.ndarray:
    """Return where (n, 2) points (n, 3) lie high above the ground: trees fit no shift."""
    from ...classify.ground import ground_grid  # with scipy.ndimage

    height = xyz[:, 2] - ground_grid(xyz, GROUND_CELL_M).height_at(xyz)
    return xyz[height > HIGH_M, :2]


def readable_chunks(path: str, boxes: np.ndarray, units: Units) -> Iterator[PointCloud]:
    """Yield the chunks of a file that may hold points in `boxes` (n, 4), to where it breaks off.

    Of one with a spatial index it is only what lies near them.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InputWarning)  # the step that sorts points says them
        try:
            is_las = file_kind(path) == "las"
            if is_las and is_copc(path):
                for box in boxes:
                    yield from iter_points(path, box=box, units=units)
                return
            index = read_lax(path) if is_las else None
            near = units.from_metres(boxes.reshape(-1, 2)).reshape(-1, 4)
            runs = None if index is None else index.find_runs(near)
            yield from iter_points(path, runs=runs, units=units)
        except MemoryError:
            raise
        except Exception as error:
            raise_interrupt(error)
