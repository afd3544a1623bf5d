"""`hiproof classify`: points of a LAS or LAZ file get classes, all else stays as it is."""

from __future__ import annotations

from pathlib import Path

import laspy
import numpy as np

from ..errors import InputError, OutputError
from ..frames import Units
from ..read.crs import find_units, parse_crs
from ..read.crs.positions import refuse_degrees
from ..read.points.las import read_checked_facts, translate_errors
from ..read.points.las_crs import las_crs
from ..read.points.pointcloud import common_crs, file_kind, refuse_implausible
from ..settings import Settings
from ..write.files import atomic, refuse_overwriting
from .buildings import BUILDING, GROUND_CLASS, UNKNOWN, classify

LEFT_ALONE = (7, 9, 17, 18)  # classes that stay as they are: noise, water, bridges


def classify_file(path: Path, out: Path, settings: Settings) -> dict[str, int]:
    """Write `path` to `out` with ground as class 2 and buildings as class 6.

    Returns the numbers of "points", "ground" and "building". Raises InputError for a file that
    cannot be read or holds nothing but noise, water and bridges, OutputError for one that cannot be
    written.
    """
    path, out = Path(path), Path(out)
    if out.suffix.lower() not in (".laz", ".las"):
        raise OutputError(f"expected a .laz or .las file to write, got {out}; name one")
    refuse_overwriting([out], [path])
    las = read_whole(path)
    units = units_in(las, path, settings)
    classification = np.asarray(las.classification, np.uint8)
    mask = ~np.isin(classification, LEFT_ALONE) & ~np.asarray(las.withheld, bool)
    if not mask.any():
        raise InputError(
            f"expected points that may be ground or buildings in {path}, got "
            f"{len(classification):,} of noise, water or bridges alone; check the file's classes"
        )
    result = classify(units.to_metres(np.asarray(las.xyz)[mask]))
    las.classification[mask] = merge_classes(classification[mask], result)
    write_whole(las, out)
    counts = {
        "points": len(classification),
        "ground": (result == GROUND_CLASS).sum(),
        "building": (result == BUILDING).sum(),
    }
    return {name: int(count) for name, count in counts.items()}


def units_in(las: laspy.LasData, path: Path, settings: Settings) -> Units:
    """Return the file's units; raises InputError for degrees, also those of no CRS."""
    crs = common_crs(
        {str(path): las_crs(read_checked_facts(path).projection)},
        parse_crs(settings.read.crs),
        settings.read.unit,
    )
    if crs is None:
        box = np.r_[las.header.mins[:2], las.header.maxs[:2]].reshape(1, 4)
        refuse_degrees(
            box,
            str(path),
            "reproject it to the UTM zone or the national grid of the place (`pdal translate`)",
        )
    return find_units(crs, str(path), settings.read.unit)


def merge_classes(previous: np.ndarray, result: np.ndarray) -> np.ndarray:
    """Merge classes (n,) of the file, `previous`, with the classes found.

    A point that is neither ground nor building keeps its class, unless it was one of these.
    """
    classes = np.where(np.isin(previous, (GROUND_CLASS, BUILDING)), UNKNOWN, previous)
    return np.where(result == UNKNOWN, classes, result).astype(np.uint8)


def read_whole(path: Path) -> laspy.LasData:
    """Read everything in the file; raises InputError where it is unreadable, empty or no LAS."""
    if file_kind(path) != "las":
        raise InputError(
            f"expected a LAS, LAZ or COPC file at {path}, got another kind of point cloud; convert "
            "it first"
        )
    if not read_checked_facts(path).count:
        raise InputError(f"expected points in {path}, got none; copy or download it again")
    with translate_errors(path):
        las = laspy.read(path)
        refuse_implausible(np.asarray(las.xyz), path)
        return las


def write_whole(las: laspy.LasData, out: Path) -> None:
    """Write the file whole or not at all, without an octree of COPC, as the copy has none."""
    header = las.header
    header.vlrs = [record for record in header.vlrs if record.user_id != "copc"]
    header.evlrs = [record for record in header.evlrs or [] if record.user_id != "copc"]
    with atomic(out) as temporary, open(temporary, "wb") as file:
        las.write(file, do_compress=out.suffix.lower() == ".laz")
