"""Building footprints from files and databases: one Footprint or more a feature, none lost."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import shapely
from pyproj import CRS

from ...errors import InputError, warn
from ...frames import Box, Units
from ...geometry.rings import clockwise
from ...log import count_things
from ...masking import remember
from ...model import Footprint
from ...settings import Settings
from ..crs import (
    describe_crs,
    find_units,
    make_transformer,
    names_heights_alone,
    names_place,
    parse_crs,
    read_named_crs,
    same_horizontal,
)
from ..crs.operations import find_operation, warn_if_coarse
from ..crs.positions import format_box, refuse_degrees
from ..names import READING
from ..remote import FilePath
from .attribute_columns import attribute_rows
from .database import is_database, read_table, table_crs
from .geoparquet import is_parquet
from .polygons import Features, Layer, is_surface, simple_polygons

# What GDAL calls the CRSs -1, 0 and 99999 of a GeoPackage, which has to name one.
UNDEFINED_CRS = ("Undefined Cartesian SRS", "Undefined geographic SRS", "Undefined SRS")

SAME_M = 0.01  # m, within which two outlines are the same: footprints are drawn in centimetres

ID_NAMES: list[str] = READING["id_names"]


def read_footprints(
    path: str | Path,
    layer: str | int | None = None,
    id_attribute: str | None = None,
    target_crs: Any = None,
    settings: Settings | None = None,
    where: str | None = None,
    bbox: Box | None = None,
) -> tuple[Footprint, ...]:
    """Read footprints from a file, URL or data source, in world metres of `target_crs` if given.

    `layer` names one of a file's layers, which may be left out where only one holds geometries.
    Multipolygons are split into footprints `ID-1`, `ID-2`, ... whose attribute `part_of` is the
    feature's id; polygons without area stay, with an empty polygon. Rings are clockwise, holes
    counter-clockwise, as in a Shapefile and whatever the file's are. `where` is an SQL condition on
    their attributes; of those, only the ones that meet `bbox` (xmin, ymin, xmax, ymax), in the
    coordinates of `target_crs`, are given. Ids come from `id_attribute`, else from the first usual
    column without gaps or repeats, else they are the feature's number. `settings.read.crs` stands
    in for a `target_crs` that is None, `settings.read.unit` for the unit where there is no CRS.
    Raises InputError for what cannot be read, holds no features or several layers, or names a CRS
    that cannot be transformed.
    """
    read = (settings or Settings()).read
    target = parse_crs(target_crs) or parse_crs(read.crs)
    meta, numbers, geometries, columns = read_features(path, layer, where, bbox, target)
    attributes = attribute_rows(list(meta["fields"]), columns, len(geometries))
    ids = feature_ids(attributes, numbers, id_attribute, path)
    source = plan_crs(meta["crs"], path)
    surfaces = np.array([is_surface(geometry) for geometry in geometries])
    geometries = transform_geometries(geometries, source, target, path)
    units = find_units(target or source, f"the footprints of {path}", read.unit)
    geometries = geometries if units.are_metres else shapely.transform(geometries, units.to_metres)
    footprints = unique_ids(split_features(ids, geometries, surfaces, attributes, path), path)
    warn_overlaps(footprints, path)
    return tuple(f for f in footprints if bbox is None or meets(f.polygon, bbox, units))


def meets(polygon: shapely.Polygon, bbox: Box, units: Units) -> bool:
    """Return whether a polygon in world metres meets a box in `units`."""
    return bool(shapely.intersects(polygon, shapely.box(*units.to_metres(bbox))))


def footprint_crs(path: FilePath, layer: Layer = None) -> CRS | None:
    """Return the CRS that a file names, or None; raises InputError as `read_footprints`."""
    if is_database(path):
        return plan_crs(table_crs(str(path)), path)
    return plan_crs(find_reader(path).read_crs(path, layer), path)


def find_reader(path: FilePath) -> ModuleType:
    """Return the module that reads files of this kind."""
    if is_parquet(path):
        from . import geoparquet

        return geoparquet
    from . import vector_file  # GDAL, which takes long to load

    return vector_file


def plan_crs(text: str | CRS | None, path: FilePath) -> CRS | None:
    """Return a vector file's CRS, None without a plan or for GeoPackage's "undefined"."""
    crs = read_named_crs(text, path)
    return None if crs is None or names_heights_alone(crs) or crs.name in UNDEFINED_CRS else crs


def read_features(
    path: FilePath,
    layer: Layer,
    where: str | None = None,
    bbox: Box | None = None,
    bbox_crs: CRS | None = None,
) -> Features:
    """Read metadata, feature numbers, geometries and columns.

    Metadata are fields and crs. Geometries are shapely's, None where a feature has none. Of a file,
    those around `bbox` in `bbox_crs` are read, and perhaps others.
    """
    remember(str(path))
    if is_database(path):
        return read_table(str(path), where)
    features: Features = find_reader(path).read_features(
        path, layer, where, lambda crs: bbox and box_in(plan_crs(crs, path), bbox, bbox_crs)
    )
    meta, _, geometries, _ = features
    chosen = " and ".join(name for name, by in (("--where", where), ("--bbox", bbox)) if by)
    if not len(geometries) and chosen:
        bounds = meta["total_bounds"]
        lies = "" if bounds is None else f" ({format_box(bounds)})"
        raise InputError(
            f"expected footprints in {path}{lies} that {chosen} let through, got none; relax or "
            "leave out what does not fit"
        )
    if not len(geometries):
        raise InputError(
            f"expected footprints in {path}, got a layer without features; name another file or "
            "layer"
        )
    kinds = {g.geom_type for g in geometries if g is not None}
    if kinds and not any("Polygon" in kind or kind == "GeometryCollection" for kind in kinds):
        raise InputError(
            f"expected polygons in {path}, got {', '.join(sorted(kinds))}; name another layer, or "
            "close the lines first"
        )
    return features


def box_in(crs: CRS | None, bbox: Box, bbox_crs: CRS | None) -> Box:
    """Return a box in `crs` around `bbox` of `bbox_crs`, the same where one is unknown."""
    if crs is None or bbox_crs is None or same_horizontal(crs, bbox_crs):
        return bbox
    if not names_place(crs):
        return tuple(np.array(bbox) * compare_units(bbox_crs, crs))
    return make_transformer(bbox_crs, crs).transform_bounds(*bbox)


def feature_ids(
    rows: list[dict[str, Any]], numbers: np.ndarray, id_attribute: str | None, path: FilePath
) -> list[str]:
    """Return features' ids as text: of the requested or a usual attribute, else numbers."""
    by_number = list(map(str, numbers))
    names = {name.lower(): name for row in rows for name in row}
    if id_attribute is not None:
        name = names.get(id_attribute.lower())
        if name is None:
            raise InputError(
                f"expected the attribute {id_attribute!r} in {path}, got "
                f"{', '.join(names.values()) or 'none at all'}; "
                "name one of these with --id-attribute"
            )
        if any(id_attribute in row for row in rows):  # which may have others in other letters
            name = id_attribute
        ids = [id_text(row.get(name)) for row in rows]
        if missing := ids.count(""):
            warn(
                path,
                f"{count_things(missing, 'feature')} without {name}; the number stands in for it",
            )
        return [id or number for id, number in zip(ids, by_number, strict=True)]
    usual = [names[name] for name in ID_NAMES if name in names]
    for name in usual:
        ids = [id_text(row.get(name)) for row in rows]
        if all(ids) and len(set(ids)) == len(ids):
            return ids
    if usual:
        warn(
            path,
            f"{usual[0]} repeats or is missing, so buildings go by their number; "
            f"--id-attribute {usual[0]} takes it all the same",
        )
    return by_number


def id_text(value: Any) -> str:
    """Return an id as text, empty without one, floats that are whole without the point."""
    if value is None or not str(value).strip():
        return ""
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def transform_geometries(
    geometries: np.ndarray, source: CRS | None, target: CRS | None, path: FilePath
) -> np.ndarray:
    """Transform plan geometries; raises InputError where impossible or without numbers."""
    geometries = shapely.force_2d(geometries)
    if source is None or not source.is_geographic:
        advice = "name their CRS in the file (`ogr2ogr -a_srs EPSG:4326`), or reproject them"
        text = "no CRS" if source is None else describe_crs(source)
        refuse_degrees(
            shapely.bounds(geometries), f"the footprints of {path}, which names {text},", advice
        )
    if source is None and target is not None:
        warn(path, f"names no CRS; taken to be in the cloud's, {describe_crs(target)}")
    if source is None or target is None or same_horizontal(source, target):
        return geometries
    if not names_place(source):
        warn(
            path,
            f"names a local CRS, {describe_crs(source)}; taken to be in the cloud's, "
            f"{describe_crs(target)}",
        )
        return shapely.transform(geometries, lambda xy: xy * compare_units(source, target))
    transformer = make_transformer(source, target)
    warn_if_coarse(find_operation(str(path), source, target, find_middle(geometries)))
    moved = shapely.transform(geometries, transformer.transform, interleaved=False)
    if not np.isfinite(shapely.get_coordinates(moved)).any():
        advice = "check which CRS each file names"
        if source.is_geographic:
            advice = (
                "they are no degrees: name their CRS in the file, for a GeoJSON that names none "
                "counts as WGS 84 (`ogr2ogr -a_srs`)"
            )
        raise InputError(
            f"expected footprints of {path} that can be moved from {source.name} to the cloud's "
            f"{target.name}, got coordinates outside that system; {advice}"
        )
    return moved


def compare_units(source: CRS, target: CRS) -> float:
    """Return how many plan units of `target` make one of `source`."""
    return find_units(source, "the footprints").plan / find_units(target).plan


def find_middle(geometries: np.ndarray) -> tuple[float, float]:
    """Return the middle (x, y) of geometries' boxes by medians, (0, 0) without any."""
    boxes = shapely.bounds(geometries)
    boxes = boxes[np.isfinite(boxes).all(axis=1)]
    x, y = np.median((boxes[:, :2] + boxes[:, 2:]) / 2, axis=0) if len(boxes) else (0.0, 0.0)
    return float(x), float(y)


def split_features(
    ids: list[str],
    geometries: np.ndarray,
    surfaces: np.ndarray,
    attributes: list[dict[str, Any]],
    path: FilePath,
) -> list[Footprint]:
    """Make footprints of features, several where polygons stand apart; `surfaces` do not."""
    footprints, mended, empty, split = [], 0, 0, []
    invalid = ~(shapely.is_valid(geometries) | shapely.is_missing(geometries) | surfaces)
    for id, geometry, is_one, row, was_invalid in zip(
        ids, geometries, surfaces, attributes, invalid, strict=True
    ):
        polygons = [clockwise(polygon) for polygon in simple_polygons(geometry, is_one)]
        mended += bool(was_invalid and not polygons[0].is_empty)
        empty += polygons[0].is_empty
        if len(polygons) == 1:
            footprints.append(Footprint(id, polygons[0], row))
            continue
        split.append(len(polygons))
        for number, polygon in enumerate(polygons, start=1):
            footprints.append(Footprint(f"{id}-{number}", polygon, {**row, "part_of": id}))
    several = f"became {sum(split)} buildings, named by its id and -1, -2, ..."
    for count, thing, what in (
        (len(split), "feature", f" of several polygons {several}"),
        (
            int(surfaces.sum()),
            "feature",
            " of faces in space; the area that they cover from above is the outline",
        ),
        (mended, "invalid footprint", " repaired"),
        (
            empty,
            "feature",
            " with no area that a building could have; such get no model, but a status",
        ),
    ):
        if count:
            warn(path, f"{count_things(count, thing)}{what}")
    return footprints


def unique_ids(footprints: Sequence[Footprint], path: FilePath) -> list[Footprint]:
    """Make ids unique by `_2`, `_3`; copies of a polygon name it in `copy_of`."""
    ids = {footprint.id for footprint in footprints}
    in_use: set[str] = set()
    result: list[Footprint] = []
    renamed = 0
    originals = find_copies(np.array([footprint.polygon for footprint in footprints]))
    for number, footprint in enumerate(footprints):
        id, suffix = footprint.id, 2
        while id in in_use or (suffix > 2 and id in ids):
            id, suffix = f"{footprint.id}_{suffix}", suffix + 1
        renamed += id != footprint.id
        in_use.add(id)
        attributes = footprint.attributes
        if number in originals:
            attributes = {**attributes, "copy_of": result[originals[number]].id}
        result.append(Footprint(id, footprint.polygon, attributes))
    for count, what in (
        (renamed, "with the id of an earlier one got a suffix such as _2"),
        (len(originals), "with the polygon of another; see the attribute copy_of"),
    ):
        if count:
            warn(path, f"{count_things(count, 'footprint')} {what}")
    return result


def find_copies(polygons: np.ndarray) -> dict[int, int]:
    """Return the first of the polygons (n,) that each copy is one of.

    Copies lie within SAME_M of each other, whatever their last bits.

    >>> square = shapely.box(0, 0, 9, 9)
    >>> find_copies(np.array([square, shapely.box(1e-9, 0, 9, 9), shapely.box(0, 0, 9, 8)]))
    {1: 0}
    """
    centroids = shapely.centroid(polygons)
    pairs = shapely.STRtree(centroids).query(centroids, predicate="dwithin", distance=SAME_M)
    second, original = pairs[:, pairs[0] > pairs[1]]
    apart = shapely.area(shapely.symmetric_difference(polygons[second], polygons[original]))
    is_copy = apart <= SAME_M * shapely.length(polygons[second])
    # the first comes last, and stays
    copies = zip(second[is_copy].tolist(), original[is_copy].tolist(), strict=True)
    return dict(sorted(copies, reverse=True))


def warn_overlaps(footprints: Sequence[Footprint], path: FilePath) -> None:
    """Warn once of footprints on larger ones, whose models of the same points overlap."""
    polygons = np.array([footprint.polygon for footprint in footprints])
    pairs = shapely.STRtree(polygons).query(shapely.point_on_surface(polygons), predicate="within")
    pairs = pairs[:, pairs[0] != pairs[1]]
    is_copy = np.array(["copy_of" in footprint.attributes for footprint in footprints])
    pairs = pairs[:, ~is_copy[pairs].any(axis=0)]  # of copies is told elsewhere
    if pairs.size:
        smaller, larger = np.take_along_axis(
            pairs, np.argsort(shapely.area(polygons[pairs]), axis=0), axis=0
        )
        warn(
            path,
            f"{count_things(len(np.unique(smaller)), 'footprint')} on top of a larger one "
            f"({footprints[smaller[0]].id} on {footprints[larger[0]].id}): models of both have "
            "the same points and overlap; keep one of them",
        )
