"""RoofN3D (Wichmann et al.

2018): `roofn3d_buildings.csv` and the labels in `roofn3d_surfacegrowing.csv`, streamed.

The points' WKT has no inner parentheses and fields run to megabytes, so coordinates are parsed as
one run of numbers.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from ..errors import InputError, warn
from ..log import count_things
from .remote import FilePath

# Our catalogue's name of each RoofN3D class.
ROOFN3D_TYPES = {"saddleback roof": "gable", "two-sided hip roof": "hip", "pyramid roof": "pyramid"}

FIELD_LIMIT = 1 << 30  # bytes of a field; csv's own limit is below a large roof's points
UNASSIGNED = -1  # label of a point on no surface
ROOFN3D_UNITS_PER_M = 1000  # points are matched to surfaces by their millimetres: the file rounds


@dataclass(frozen=True)
class RoofN3DRecord:
    """One building of RoofN3D.

    `type` is a name of our catalogue (None for an unknown class, which `class_name` names),
    `points` (n, 3) are in metres of EPSG:26918, and `outline` is the plan polygon, empty where the
    file has none.
    """

    id: str
    type: str | None
    class_name: str
    points: np.ndarray
    outline: shapely.Polygon


def read_roofn3d(path: FilePath) -> Iterator[RoofN3DRecord]:
    """Yield the buildings of `roofn3d_buildings.csv`, each id once.

    The first row of an id counts. One row is in memory at a time. Raises InputError for a file of
    another layout and for coordinates that are no numbers, naming the row.
    """
    visited: set[str] = set()
    repeated = 0
    for number, row in rows(path, ("id", "class", "points", "outline")):
        if row["id"] in visited:
            repeated += 1
            continue
        visited.add(row["id"])
        try:
            points, outline = coordinates(row["points"]), polygon(row["outline"])
        except (ValueError, shapely.errors.ShapelyError) as error:
            raise InputError(
                f"expected WKT coordinates in row {number} of {path}, got: {error}; the file may "
                "be cut off: download it again"
            ) from error
        class_name = row["class"].strip()
        yield RoofN3DRecord(
            row["id"], ROOFN3D_TYPES.get(class_name.lower()), class_name, points, outline
        )
    if repeated:
        warn(path, f"{count_things(repeated, 'row')} with the id of an earlier one left out")


def read_roofn3d_labels(
    path: FilePath, records: Iterator[RoofN3DRecord]
) -> Iterator[tuple[RoofN3DRecord, np.ndarray]]:
    """Yield each record with its points' labels (n,).

    A label is the number of a surface (0, 1, ...), -1 where no surface has the point. `path` is
    `roofn3d_surfacegrowing.csv`; it has no label per point, so points are matched by their
    coordinates, to the millimetre. Surfaces count in the order of the file. Only where the surfaces
    lie in the file is kept in memory.
    """
    offsets = surface_offsets(path)
    with open(path, "rb") as file:
        column = split_line(file.readline()).index("points")
        for record in records:
            labels = np.full(len(record.points), UNASSIGNED)
            for label, offset in enumerate(offsets.get(record.id, ())):
                file.seek(offset)
                surface = coordinates(split_line(file.readline())[column])
                labels[np.isin(point_keys(record.points), point_keys(surface))] = label
            yield record, labels


def surface_offsets(path: FilePath) -> dict[str, list[int]]:
    """Return where (bytes) each building's rows start: rows are lines without breaks."""
    # refuses another layout before the pass over the whole file
    next(rows(path, ("points", "fk_buildings")), None)
    offsets: dict[str, list[int]] = {}
    with open(path, "rb") as file:
        column = split_line(file.readline()).index("fk_buildings")
        start = file.tell()
        for line in iter(file.readline, b""):
            values = split_line(line)
            if len(values) > column:
                offsets.setdefault(values[column].strip(), []).append(start)
            start = file.tell()
    return offsets


def split_line(line: bytes) -> list[str]:
    return next(csv.reader([line.decode("utf-8-sig")]), [])


def rows(path: FilePath, required: tuple[str, ...]) -> Iterator[tuple[int, dict[str, str]]]:
    """Number rows (the header is 1) with fields by name; InputError without a needed one."""
    csv.field_size_limit(FIELD_LIMIT)
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file)
            names = reader.fieldnames or []
            if not set(required) <= set(names):
                got = ", ".join(name[:30] for name in names[:8]) or "an empty file"
                raise InputError(
                    f"expected RoofN3D's columns {', '.join(required)} in {path}, got {got}; "
                    "name roofn3d_buildings.csv or roofn3d_surfacegrowing.csv as downloaded"
                )
            for number, row in enumerate(reader, start=2):
                yield number, {name: (value or "") for name, value in row.items() if name}
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"expected a CSV file of RoofN3D at {path}, got: {error}; check the file"
        ) from error


def coordinates(wkt: str) -> np.ndarray:
    """Return points (n, 3) of `MULTIPOINT Z (x y z,x y z,...)`.

    Inner parentheses are optional. An empty field gives (0, 3). Raises what shapely does.

    >>> coordinates("MULTIPOINT Z (1 2 3,4 5 6.5)").tolist()
    [[1.0, 2.0, 3.0], [4.0, 5.0, 6.5]]
    """
    return shapely.get_coordinates(shapely.from_wkt(wkt.strip() or "POINT EMPTY"), include_z=True)


def polygon(wkt: str) -> shapely.Polygon:
    """Return the largest polygon of a WKT field, empty for an empty field."""
    from .outlines.polygons import simple_polygons

    parts = simple_polygons(shapely.from_wkt(wkt.strip() or "POLYGON EMPTY"))
    return max(parts, key=lambda part: part.area)


def point_keys(points: np.ndarray) -> np.ndarray:
    """Return a comparable value (n,) for points (n, 3), to the millimetre."""
    units = np.ascontiguousarray(np.rint(points * ROOFN3D_UNITS_PER_M).astype(np.int64))
    return units.view([("", np.int64)] * 3).ravel()
