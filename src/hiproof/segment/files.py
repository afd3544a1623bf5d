"""Files of `hiproof segment`: labelled points, and a table of types."""

from __future__ import annotations

import csv
from pathlib import Path

import laspy
import numpy as np

from ..errors import FitError, InputError, OutputError
from ..frames import METRES, Units
from ..read.points.pointcloud import read_points
from ..settings import Settings
from .inference import SHIPPED_WEIGHTS, Segmentation, load, segment

# The number of a building, its file, its points (n, 3) and what was found of them.
Labelled = tuple[int, Path, np.ndarray, Segmentation]
EXTRA_DIMENSIONS = (("roof_type", "uint8"), ("not_roof", "float32"), ("building", "uint32"))


def segment_files(clouds: list[Path], out: Path, settings: Settings) -> dict[Path, str]:
    """Label each cloud of `clouds` as one building.

    Points go to `out` (LAZ or LAS) and types to a CSV of the same name. Returns why, by file, where
    a building could not be labelled. Raises InputError if none could, and for weights that cannot
    be used; OutputError if `out` cannot be written.
    """
    out = Path(out)
    if out.suffix.lower() not in (".laz", ".las"):
        raise OutputError(
            f"expected --out to name a .laz or .las file, got {out}; the table is written beside it"
        )
    model = load(settings.segment.weights or str(SHIPPED_WEIGHTS), settings.segment.device)
    labelled, failures, crs, units = [], {}, None, METRES
    for number, path in enumerate(clouds, start=1):
        try:
            cloud = read_points(path, settings=settings)
            labelled.append((number, path, cloud.xyz, segment(cloud.xyz, settings)))
            crs, units = crs or cloud.crs, units if crs else cloud.units
        except (FitError, InputError) as error:
            failures[path] = str(error)
    if not labelled:
        text = "; ".join(f"{path}: {reason}" for path, reason in failures.items())
        raise InputError(f"expected at least one building to label, got none ({text})")
    write_points(out, labelled, crs, units)
    write_table(out.with_suffix(".csv"), labelled, model.types)
    return failures


def write_points(out: Path, labelled: list[Labelled], crs, units: Units) -> None:
    """Write points in `units`, to a thousandth, with their extra dimensions."""
    xyz = units.from_metres(np.concatenate([points for _, _, points, _ in labelled]))
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales, header.offsets = np.full(3, 0.001), np.floor(xyz.min(axis=0))
    header.add_extra_dims([laspy.ExtraBytesParams(name, kind) for name, kind in EXTRA_DIMENSIONS])
    if crs is not None:
        header.add_crs(crs)
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.roof_type = np.concatenate([result.labels + 1 for *_, result in labelled]).astype(np.uint8)
    las.not_roof = np.concatenate([result.not_roof for *_, result in labelled]).astype(np.float32)
    las.building = np.concatenate(
        [np.full(len(points), number) for number, _, points, _ in labelled]
    )
    las.classification = np.where(las.roof_type > 0, 6, 1)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        las.write(out)
    except OSError as error:
        raise OutputError(f"expected to write {out}, got: {error}; choose another --out") from error


def write_table(path: Path, labelled: list[Labelled], types) -> None:
    """Write a row a building: number, file, points, roof share, type, all probabilities."""
    try:
        with open(path, "w", newline="", encoding="utf-8") as file:
            table = csv.writer(file)
            table.writerow(["building", "file", "points", "roof_share", "type", *types])
            for number, source, points, result in labelled:
                probabilities = [f"{result.types[name]:.4f}" for name in types]
                share = f"{result.is_roof.mean():.3f}"
                table.writerow([number, source, len(points), share, result.type, *probabilities])
    except OSError as error:
        raise OutputError(
            f"expected to write {path}, got: {error}; choose another --out"
        ) from error
