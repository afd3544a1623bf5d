"""The JSON object of one building checked, in sentences that say where, and its parts made."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from ..compose.readable import refuse_many, refuse_wrong_parts
from ..compose.settle import (
    DIGITS,
    PLAN_DIGITS,
    make_pieces,
    round_number,
    rounded_outline,
    settled_outline,
    settled_sigma,
)
from ..errors import InputError
from ..frames import LocalFrame
from ..geometry.rings import intersect, repair_polygons
from ..model import Building, Part, Quality, Roof
from ..primitives.catalogue import CATALOGUE
from ..primitives.parameters import refuse_no_shape
from ..read.models.damage import excerpt
from ..status import Change, Grade, Status
from ..write.attribute_list import TABLES
from ..write.head import UpdateHead

WIDEST_PART_M = 1e5  # of any number of a part, and of heights
# coordinate, m; Gauss-Kruger zones reach 6e7, and a tenth of a millimetre fits float64 up to 1e11
FARTHEST_WORLD_M = 1e8
LARGEST_NUMBER = 1e15  # at which float64 still holds eighths; larger is no number of a building
FAR_M, SLACK_M = 1e4, 0.01  # how far a saw-tooth's outline may reach into the next tooth
FIGURES = ("density", "nodata_share", "unexplained_area_m2")
RESIDUALS = ("psd_mean", "psd_std", "rmse", "p95", "share_within_20cm", "outline_iou")


def read_building(record: Mapping[str, Any]) -> tuple[Building, Roof | None]:
    """Read the building of a JSON object, without a model, and its roof.

    The roof is made of its parts, None where it has none. Raises InputError, one sentence, for an
    object that makes none.
    """
    refuse_other_keys(record, "building", "the building")
    parts = list_at(record, "parts")
    origin = None if record.get("origin") is None else place(record["origin"], "origin", coordinate)
    outline = None if record.get("outline") is None else polygon(record["outline"], "outline")
    status = read_status(record, bool(parts))
    roof = read_roof(parts, outline, origin) if parts else None
    world = outline if roof is None else roof.world_outline
    ground = (
        figure(record, "z_ground") if roof is None else measure(record.get("z_ground"), "z_ground")
    )
    code, by_code = text_at(record, "quality"), {grade.code: grade for grade in Grade}
    if code:
        require_code(code, by_code, f"a quality ({', '.join(by_code)})", AS_WRITTEN)
    building = Building(
        id=str(record["id"]),
        status=status,
        detail=text_at(record, "detail") if status.code == record.get("status") else "",
        quality=read_quality(record),
        grade=by_code.get(code),
        z_ground=round_number(ground, PLAN_DIGITS),
        ground_source=text_at(record, "ground_source"),
        terrain_intersection=tuple(read_terrain_lines(record)),
        objective=figure(record, "objective"),
        recognised=numbers_by_name(record.get("recognised") or {}, "recognised"),
        types=numbers_by_name(record.get("types") or {}, "types"),
        footprint=world,
        attributes=dict(require_mapping(record.get("attributes") or {}, "attributes")),
        shift=read_shift(record),
        change=read_change(record),
        survey_date=text_at(record, "survey_date"),
        epochs_used=tuple(map(str, list_at(record, "epochs_used"))),
    )
    return building, roof


def read_status(record: Mapping[str, Any], has_parts: bool) -> Status:
    """Read the status; a building with parts by hand has that of a model."""
    code = record.get("status", Status.MODELLED.code if has_parts else Status.NO_POINTS.code)
    by_code = {status.code: status for status in Status}
    require_code(code, by_code, f"a status ({', '.join(by_code)})", AS_WRITTEN)
    if has_parts and not by_code[code].is_model:
        return Status.MODELLED
    if not has_parts and by_code[code].is_model:
        raise InputError(
            f"expected parts of a building whose status is {code}, got none; give one part at least"
        )
    return by_code[code]


def read_outline(record: Mapping[str, Any]) -> shapely.Polygon | None:
    """Read the outline of a building's roof in world coordinates, None where there is none."""
    if not record.get("parts") or record.get("outline") is None or record.get("origin") is None:
        return None
    frame = LocalFrame(round_values(place(record["origin"], "origin"), DIGITS))
    return shapely.transform(on_grid(polygon(record["outline"], "outline")), frame.to_world)


def on_grid(outline: shapely.Polygon) -> shapely.Polygon:
    """Return the outline on the grid of solids; raises InputError where its rings cross."""
    try:
        return settled_outline(outline)
    except shapely.GEOSException as error:
        reason = shapely.is_valid_reason(outline)
        raise InputError(
            f"expected an outline that does not cross itself, got one with {reason}; mend it"
        ) from error


def read_roof(parts: list[Any], outline: shapely.Polygon | None, origin: np.ndarray | None) -> Roof:
    """Return the roof of a building's parts over its outline, about its origin."""
    if outline is None or origin is None:
        raise InputError(
            "expected an outline and an origin of a building with parts, got null; give both"
        )
    refuse_many(parts)
    outline = on_grid(outline)
    created = [read_part(part, outline, f"part {index}") for index, part in enumerate(parts)]
    roof = Roof(tuple(created), outline, LocalFrame(round_values(origin, DIGITS)))
    refuse_wrong_parts(roof)
    return roof


def read_part(record: Any, outline: shapely.Polygon, label: str) -> Part:
    """Read a part with its planes, over the building's outline if it has none of its own."""
    refuse_other_keys(record, "part", label)
    kind = text_at(record, "type")
    parameters = numbers_by_name(record.get("parameters") or {}, f"the parameters of {label}")
    refuse_no_shape(kind, parameters, label)
    parameters = {name: round_number(value) for name, value in parameters.items()}
    position, kappa = read_position(record, label)
    outlines = read_part_outlines(record, parameters, position, kappa, outline, label)
    if kind == "shed":
        outlines = by_teeth(outlines, parameters, position, kappa)
    outlines = [rounded_outline(o) for o in outlines]
    pieces = make_pieces(kind, parameters, kappa, position, outlines)
    sigma = numbers_by_name(record.get("sigma") or {}, f"the standard deviations of {label}")
    sigma = {
        ("kappa" if n == "rotation" else n): (math.radians(s) if n == "rotation" else s)
        for n, s in sigma.items()
    }
    return Part(kind, pieces, parameters, kappa, position, settled_sigma(sigma))


def read_position(record: Mapping[str, Any], label: str) -> tuple[np.ndarray, float]:
    """Read where a part or an installation lies (3,) about the origin, and its rotation in rad."""
    position = place(record.get("position"), f"position of {label}", measure)
    rotation = number(record.get("rotation", 0.0), f"rotation of {label}")
    return round_values(position, DIGITS), math.radians(round_number(rotation))


def read_part_outlines(
    record: Mapping[str, Any],
    parameters: Mapping[str, float],
    position: np.ndarray,
    kappa: float,
    outline: shapely.Polygon,
    label: str,
) -> list[shapely.Polygon]:
    """Return the outlines given of a part, else what its plan covers of the building's outline."""
    if record.get("outlines") is not None:
        return [polygon(rings, f"an outline of {label}") for rings in list_at(record, "outlines")]
    if "width" not in parameters or "length" not in parameters:
        raise InputError(
            f"expected width and length, or outlines, of {label}, got neither; give the rectangle"
        )
    half = 0.5 * np.array([parameters["length"], parameters["width"]])
    rim = np.array(CATALOGUE[record["type"]].variant(parameters).rim) * half
    return clip(place_plan(rim, position, kappa), outline)


def place_plan(uv: np.ndarray, position: np.ndarray, kappa: float) -> shapely.Polygon:
    """Return the polygon of corners (n, 2) along and across a part, about the origin."""
    c, s = math.cos(kappa), math.sin(kappa)
    return shapely.Polygon(uv @ np.array([[c, s], [-s, c]]) + position[:2])


def clip(area: shapely.Polygon, outline: shapely.Polygon) -> list[shapely.Polygon]:
    """Return the polygons that an area covers of an outline."""
    covered = intersect(area, repair_polygons(outline), 1e-4)
    return [g for g in shapely.get_parts(covered) if g.geom_type == "Polygon"]


def by_teeth(
    outlines: list[shapely.Polygon],
    parameters: Mapping[str, float],
    position: np.ndarray,
    kappa: float,
) -> list[shapely.Polygon]:
    """Return the outlines of a saw-tooth, cut between teeth."""
    teeth, across = round(parameters["teeth"]), (-math.sin(kappa), math.cos(kappa))
    edges = parameters["width"] * (np.arange(teeth + 1) / teeth - 0.5)
    edges[[0, -1]] = -FAR_M, FAR_M
    cut = []
    for outline in outlines:
        v = (shapely.get_coordinates(outline) - position[:2]) @ across
        strips = [
            np.array([(-FAR_M, start), (FAR_M, start), (FAR_M, end), (-FAR_M, end)])
            for start, end in pairwise(edges)
            if v.max() > start + SLACK_M and v.min() < end - SLACK_M
        ]
        if len(strips) < 2:
            cut.append(outline)
            continue
        for strip in strips:
            cut += clip(place_plan(strip, position, kappa), outline)
    return cut


def read_terrain_lines(record: Mapping[str, Any]) -> list[np.ndarray]:
    """Read the terrain's lines (m, 3) along the outline."""
    lines = [
        read_places(as_list(line, "a line of terrain_line"), "a point of terrain_line")
        for line in as_list(record.get("terrain_line") or [], "terrain_line")
    ]
    return [round_values(line, PLAN_DIGITS) for line in lines if len(line)]


def read_places(rows: list[Any], label: str) -> np.ndarray:
    """Read places (n, 3), one by one only where one of them is wrong."""
    if all(isinstance(row, list) and len(row) == 3 for row in rows):
        values = [value for row in rows for value in row]
        if {float, int}.issuperset(map(type, values)):
            result = np.array(values, float).reshape(-1, 3)
            if (np.abs(result) < LARGEST_NUMBER).all():
                return result
    return np.array([place(row, label) for row in rows])


def read_change(record: Mapping[str, Any]) -> dict[str, Any] | None:
    """Read what the last update found, None where there is nothing."""
    if record.get("change") is None:
        return None
    code = require_mapping(record["change"], "the change").get("class")
    codes = [change.code for change in Change]
    as_written = "; leave it as the update wrote it"
    require_code(code, codes, f"a class of change ({', '.join(codes)})", as_written)
    change = require_values(record["change"], "change", "the change")
    lists = ("places", "lineage", "predecessors", "history")
    values = {**change, **{name: list_at(change, name) for name in lists}}
    names = TABLES["change"].names
    return {name: values.get(name) for name in names if name != "history" or values[name]}


def read_update(record: Any) -> UpdateHead:
    """Read what an update found beside its buildings."""
    update, names = require_values(record, "update", "update"), TABLES["roof_outside"].names
    roofs = [{name: roof.get(name) for name in names} for roof in list_at(update, "roofs_outside")]
    return UpdateHead(text_at(update, "survey"), tuple(roofs))


# What a sentence calls one of the objects of a list.
LISTED = {
    "change_place": "place {} of the change",
    "ended_model": "model {} of the history",
    "roof_outside": "roof {} of roofs_outside",
}


def require_values(record: Any, table: str, label: str) -> Mapping[str, Any]:
    """Check an object that is kept as it is, with the keys and types of a table."""
    refuse_other_keys(record, table, label)
    refuse_other_types(record, table, label)
    return record


def refuse_other_types(record: Mapping[str, Any], table: str, label: str = "") -> None:
    """Raise InputError where values are not of the types that the table declares for them."""
    if table == "roof_outside":
        number(record.get("area"), f"area of {label}")
    for attribute in TABLES[table].attributes:
        name, type, value = attribute.name, attribute.type, record.get(attribute.name)
        if attribute.kind == "text":
            text_at(record, name)
        elif type.endswith("[]"):
            for k, item in enumerate(list_at(record, name)):
                if type == "polygon[]":
                    polygon(item, f"an outline of {label}")
                elif type[:-2] in LISTED:
                    require_values(item, type[:-2], LISTED[type[:-2]].format(k))
        elif type == "shares":
            numbers_by_name(value or {}, name)
        elif type == "number":
            measure(value, f"{name} of {label}")
        elif type == "polygon":
            polygon(value, f"the {name} of {label}")
        elif value is not None:
            if type == "number?":
                number(value, name)
            elif type == "place?":
                place(value, name, coordinate)
            elif type == "polygon?":
                polygon(value, name)
    if table == "change_place" and len(list_at(record, "parts")) not in (0, 2):
        raise InputError(
            f"expected the earlier and the new part of {label}, got {excerpt(record['parts'])}; "
            "write null for none"
        )


def read_quality(record: Mapping[str, Any]) -> Quality:
    """Read the figures that were measured at the reconstruction."""
    residuals = require_mapping(record.get("residuals") or {}, "residuals")
    figures = {name: figure(residuals, name) for name in RESIDUALS} | {
        name: figure(record, name) for name in FIGURES
    }
    points = number(record.get("points", 0), "points")
    return Quality(points=int(points), **figures)


def refuse_other_kinds(record: Mapping[str, Any]) -> None:
    """Raise InputError where a value is of another kind than a run writes, without geometry."""
    parts = [
        require_mapping(part, f"part {index}")
        for index, part in enumerate(list_at(record, "parts"))
    ]
    read_status(record, bool(parts))
    refuse_other_types(record, "building")
    read_quality(record)
    for index, part in enumerate(parts):
        label = f"part {index}"
        require_code(
            text_at(part, "type"), CATALOGUE, f"a roof type ({', '.join(CATALOGUE)}) in {label}"
        )
        read_position(part, label)
        for name in ("parameters", "sigma"):
            numbers_by_name(part.get(name) or {}, f"{name} of {label}")


def refuse_other_keys(record: Any, table: str, label: str) -> None:
    """Raise InputError for what is no object, or has keys that a table does not declare."""
    allowed = TABLES[table].names
    other = [str(key)[:40] for key in require_mapping(record, label) if key not in allowed]
    if other:
        raise InputError(
            f"expected the keys {', '.join(allowed)} of {label}, got also {', '.join(other[:8])}; "
            "remove them"
        )


AS_WRITTEN = "; leave it as the run wrote it"


def require_code(value: Any, codes: Collection[str], expected: str, advice: str = "") -> None:
    """Raise InputError for what is none of the `codes`, which `expected` names."""
    if not isinstance(value, str) or value not in codes:
        raise InputError(f"expected {expected}, got {excerpt(value)}{advice}")


def require_mapping(value: Any, label: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"expected an object as {label}, got {excerpt(value)}; write {{...}}")
    return value


def as_list(value: Any, label: str) -> list[Any]:
    if not isinstance(value, list):
        raise InputError(f"expected a list as {label}, got {excerpt(value)}; write [...]")
    return value


def list_at(record: Mapping[str, Any], name: str) -> list[Any]:
    return as_list(record.get(name) if record.get(name) is not None else [], name)


def text_at(record: Mapping[str, Any], name: str) -> str:
    value = record.get(name)
    if not (value is None or isinstance(value, str)):
        raise InputError(f"expected text as {name}, got {excerpt(value)}; put it in quotes")
    return value or ""


def number(value: Any, label: str) -> float:
    """Check a finite number that a building can have."""
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not abs(value) < LARGEST_NUMBER:
        raise InputError(
            f"expected a number as {label}, got {excerpt(value)}; give metres, or degrees for "
            "angles"
        )
    return float(value)


def measure(value: Any, label: str) -> float:
    """Check a size, a height or an angle that something on Earth can have.

    >>> measure(1e9, "z_ground")
    Traceback (most recent call last):
    hiproof.errors.InputError: expected z_ground within 100000, got 1e+09; check its unit
    """
    result = number(value, label)
    if abs(result) > WIDEST_PART_M:
        raise InputError(
            f"expected {label} within {WIDEST_PART_M:g}, got {result:g}; check its unit"
        )
    return result


def coordinate(value: Any, label: str) -> float:
    """Check a coordinate of a place on Earth."""
    result = number(value, label)
    if abs(result) > FARTHEST_WORLD_M:
        raise InputError(
            f"expected {label} on Earth, within {FARTHEST_WORLD_M:g} m of its CRS's origin, got "
            f"{result:g}; check its unit"
        )
    return result


def round_values(values: np.ndarray, digits: int) -> np.ndarray:
    return np.array([round_number(v, digits) for v in values.ravel()]).reshape(values.shape)


def figure(record: Mapping[str, Any], name: str) -> float:
    """Read a number, NaN where it is null or left out."""
    return math.nan if record.get(name) is None else number(record[name], name)


def numbers_by_name(values: Any, label: str) -> dict[str, float]:
    return {
        str(name): measure(value, f"{name} in {label}")
        for name, value in require_mapping(values, label).items()
    }


def read_shift(record: Mapping[str, Any]) -> tuple[float, float]:
    """Read how far the footprint was moved; one made by hand was not."""
    value = record.get("shift", [0.0, 0.0])
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(f"expected two numbers [x, y] as shift, got {excerpt(value)}; give metres")
    return number(value[0], "shift"), number(value[1], "shift")


def place(value: Any, label: str, read: Callable[[Any, str], float] = number) -> np.ndarray:
    """Read three numbers (3,), each by `read`."""
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(
            f"expected three numbers [x, y, z] as {label}, got {excerpt(value)}; give metres"
        )
    return np.array([read(v, label) for v in value])


def polygon(rings: Any, label: str) -> shapely.Polygon:
    """Read a polygon of rings, the outer first."""
    result = []
    for ring in as_list(rings, label):
        corners = as_list(ring, label)
        if len(corners) < 3 or not all(isinstance(xy, list) and len(xy) == 2 for xy in corners):
            raise InputError(
                f"expected rings of three or more [x, y] as {label}, got {excerpt(ring)}; close "
                "the ring"
            )
        result.append([(coordinate(x, label), coordinate(y, label)) for x, y in corners])
    if not result:
        raise InputError(
            f"expected rings, the outer first, as {label}, got none; write null for no outline"
        )
    return shapely.Polygon(result[0], result[1:])
