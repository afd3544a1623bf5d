"""Footprints of an Overture Maps release, kept as a GeoPackage and read like any file.

Overture deletes its old releases, so that what a run was made from is only known where it is kept.
"""

from __future__ import annotations

import dataclasses
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pyproj import CRS

from ...errors import InputError, OutputError, SettingsError
from ...log import LOGGER, count_things
from ...masking import masked_values
from ...read.crs import make_transformer, names_place, parse_crs
from ...read.outlines.overture import TYPES, OvertureFootprints, is_overture, read_overture
from ...read.points.pointcloud import PointFileHeader, common_crs
from ...write.files import STATE_FOLDER, atomic
from ..request import Request
from .frame import plan_bounds

KEPT_FILE = "overture.gpkg"
"""The file in a run's own folder."""

SOURCE = "hiproof_source"
"""The entry of a GeoPackage's metadata that tells where its footprints come from, as JSON."""

HALF_TURN_DEG = 180.0  # degrees of longitude that no clouds extend over on one side of the meridian
SIDE_PARTS = 16  # of each side of a cloud's box: its sides are curves in longitude and latitude


def with_overture(request: Request, headers: list[PointFileHeader]) -> Request:
    """Return `request` with Overture's footprints fetched and kept in the run's own folder."""
    if not is_overture(request.footprints):
        return request
    path = choose_footprints(request)
    keep_footprints(request, headers, Path(str(path)))
    return dataclasses.replace(request, footprints=path, layer=None)


def choose_footprints(request: Request) -> str | None:
    """Return the footprints of a run: those it fetches and keeps, else those it names."""
    kept = str(Path(request.out) / STATE_FOLDER / KEPT_FILE)
    return kept if is_overture(request.footprints) else request.footprints


def keep_footprints(request: Request, headers: list[PointFileHeader], path: Path) -> dict[str, Any]:
    """Write the footprints of Overture's release in the clouds' extent to a GeoPackage.

    The layer of `request` names one of Overture's types. Returns where they come from. Raises
    SettingsError for another layer, InputError for clouds without a CRS and where the release
    cannot be read.
    """
    kind = request.layer or TYPES[0]
    if kind not in TYPES:
        raise SettingsError(
            f"expected --layer to be one of Overture's types {' and '.join(TYPES)}, got {kind!r}; "
            "without it buildings are read"
        )
    catalogue = request.settings.read.overture_catalogue
    fetched = read_overture(catalogue, compute_extent(request, headers), kind)
    write_geopackage(fetched, path)
    LOGGER.info(
        "%s of Overture's release %s",
        count_things(len(fetched.table), "footprint"),
        fetched.note["release"],
    )
    return fetched.note


def compute_extent(request: Request, headers: list[PointFileHeader]) -> shapely.Geometry:
    """Return the boxes of the point files in longitude and latitude as one geometry.

    Raises InputError where no file names a CRS, and for an extent across the 180th meridian.
    """
    read = request.settings.read
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it is said when the frame is settled
        crs = common_crs({h.path: h.crs for h in headers}, parse_crs(read.crs), read.unit)
    if not names_place(crs):
        raise InputError(
            f"expected clouds that name their CRS with --footprints overture, got {headers[0].path}"
            " without one; name it with --crs"
        )
    transformer = make_transformer(crs, CRS("OGC:CRS84"))
    bounds = plan_bounds(headers)
    sides = np.maximum(bounds[:, 2:] - bounds[:, :2], 1e-6).max(axis=1)
    boxes = shapely.segmentize(shapely.box(*bounds.T), sides / SIDE_PARTS)
    extent = shapely.union_all(
        shapely.transform(boxes, lambda xy: np.column_stack(transformer.transform(*xy.T)))
    )
    west, _, east, _ = extent.bounds
    if not east - west < HALF_TURN_DEG:
        raise InputError(
            f"expected clouds on one side of the 180th meridian with --footprints overture, got "
            f"clouds from {west:.2f} to {east:.2f} degrees; run each side alone"
        )
    return extent


def write_geopackage(fetched: OvertureFootprints, path: Path) -> None:
    """Write footprints with their source; the file appears whole or not at all."""
    import pyogrio

    options: dict[str, Any] = {
        "layer": fetched.note["type"],
        "driver": "GPKG",
        "geometry_name": "geometry",
        "geometry_type": "Unknown",
        "crs": "EPSG:4326",
        "dataset_metadata": {SOURCE: json.dumps(masked_values(fetched.note))},
    }
    with atomic(path) as beside:
        try:
            pyogrio.raw.write_arrow(fetched.table, str(beside), **options)
        except RuntimeError as error:  # the base of pyogrio's own
            raise OutputError(
                f"expected to write {path}, got: {error}; check the path and the space left"
            ) from error


def read_source(path: str | None) -> dict[str, Any] | None:
    """Return the source of a GeoPackage's footprints, None if there is none or no file."""
    if not path or not path.endswith(".gpkg") or not Path(path).is_file():
        return None
    import pyogrio

    try:
        metadata = pyogrio.read_info(path)["dataset_metadata"] or {}
        return dict(json.loads(metadata[SOURCE]))
    except (pyogrio.errors.DataSourceError, pyogrio.errors.DataLayerError, KeyError, ValueError):
        return None
