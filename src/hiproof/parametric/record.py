"""The JSON object of one building read by its declared types, and its parts made."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields
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
from ..data_files import Values
from ..errors import InputError
from ..frames import LocalFrame, turn_points
from ..geometry.rings import intersect, repair_polygons
from ..model import Building, Part, Quality, Roof
from ..model.installation import CHIMNEY, ROOF_OBJECT
from ..model.overhang import ROOF_EDGE, WALLS
from ..primitives.catalogue import CATALOGUE
from ..primitives.contract import Parameters
from ..primitives.parameters import refuse_no_shape
from ..read.crs import NAMED_UNITS
from ..read.models.damage import excerpt
from ..status import Change, ChangeKind, Grade, Status
from ..write.attribute_list import TABLES
from ..write.head import UpdateHead

WIDEST_PART_M = 1e5  # of any number of a part, and of heights
# coordinate, m; Gauss-Kruger zones reach 6e7, and a tenth of a millimetre fits float64 up to 1e11
FARTHEST_WORLD_M = 1e8
LARGEST_NUMBER = 1e15  # at which float64 still holds eighths; larger is no number of a building
FAR_M, SLACK_M = 1e4, 0.01  # how far a saw-tooth's outline may reach into the next tooth
FIGURES = tuple(field.name for field in fields(Quality) if field.name != "points")
# Values that a building has as they are read.
KEPT = "ground_source", "objective", "recognised", "types", "shift", "change", "survey_date"
# The values of each type that has a few of them, and what a sentence calls one.
CHOICES: dict[str, tuple[str, Collection[str]]] = {
    "unit": ("a unit", NAMED_UNITS),
    "status": ("a status", [status.code for status in Status]),
    "grade": ("a quality", [grade.code for grade in Grade]),
    "change_class": ("a class of change", [change.code for change in Change]),
    "change_kind": ("a kind of change", [kind.code for kind in ChangeKind]),
    "roof_type": ("a roof type", CATALOGUE),
    "installation_type": ("a kind of installation", (CHIMNEY, ROOF_OBJECT)),
    "walls": ("a kind of walls", ("level", "terrain")),
    "footprint_kind": ("a kind of footprint", (WALLS, ROOF_EDGE)),
}
# What a sentence calls an object of a list; the others are called as their tables are.
LISTED = {
    "change_place": "place {} of the change",
    "ended_model": "model {} of the history",
    "roof_outside": "roof {} of roofs_outside",
}


def read_object(value: Any, table: str, label: str = "") -> Values:
    """Read an object by the types that its table declares, InputError for what is of no such.

    What is left out stays out, unless the table requires it. `label` is what a sentence calls the
    object, empty for one that stands by itself.
    """
    record, names = require_mapping(value, label or f"the {table}"), TABLES[table].names
    other = [str(key)[:40] for key in record if key not in names]
    if other:
        raise InputError(
            f"expected the keys {', '.join(names)} of {label or f'the {table}'}, got also "
            f"{', '.join(other[:8])}; remove them"
        )
    return {
        name: read_value(record.get(name), type, f"the {name} of {label}" if label else name)
        for name, _, _, _, type in TABLES[table].attributes
        if name in record or name in TABLES[table].required
    }


def read_value(value: Any, type: str, label: str) -> Any:
    """Read a value of a type as data/attributes.toml names it."""
    if type in READERS:
        return READERS[type](value, label)
    if type.endswith("?"):
        return None if value is None else read_value(value, type[:-1], label)
    if type.endswith("[]"):
        item = type[:-2]
        called = LISTED.get(item, f"{item} {{}}") if item in TABLES else label
        items = enumerate(as_list([] if value is None else value, label))
        return [read_value(inner, item, called.format(k)) for k, inner in items]
    if type in CHOICES:
        kind, choices = CHOICES[type]
        if not isinstance(value, str) or value not in choices:
            raise InputError(
                f"expected {kind} ({', '.join(choices)}) as {label}, got {excerpt(value)}; choose "
                "one"
            )
        return value
    return read_object(value, type, label)


def read_building(record: Mapping[str, Any]) -> tuple[Building, Roof | None]:
    """Read the building of a JSON object, without a model, and its roof.

    The roof is made of its parts, None where it has none. Raises InputError, one sentence, for an
    object that makes none.
    """
    return make_building(read_object(record, "building"))


def make_building(values: Values) -> tuple[Building, Roof | None]:
    """Make the building of values that were read, and its roof, as `read_building` does."""
    status, parts, outline = choose_status(values), values.get("parts"), values.get("outline")
    roof = make_roof(parts, outline, values.get("origin")) if parts else None
    ground = values.get("z_ground", math.nan)
    if roof is not None:
        ground = measure(None if math.isnan(ground) else ground, "z_ground")
    figures = {**values, **values.get("residuals", {})}
    grades = {grade.code: grade for grade in Grade}
    building = Building(
        id=str(values["id"]),
        status=status,
        detail=values.get("detail", "") if status.code == values.get("status") else "",
        quality=Quality(
            int(values.get("points", 0)),
            **{name: figures[name] for name in FIGURES if name in figures},
        ),
        grade=grades.get(values.get("quality", "")),
        z_ground=round_number(ground, PLAN_DIGITS),
        terrain_intersection=tuple(values.get("terrain_line", ())),
        footprint=outline if roof is None else roof.world_outline,
        attributes=dict(values.get("attributes", {})),
        epochs_used=tuple(values.get("epochs_used", ())),
        **{name: values[name] for name in KEPT if name in values},
    )
    return building, roof


def choose_status(values: Values) -> Status:
    """Return the status; a building with parts by hand has that of a model."""
    status = next((one for one in Status if one.code == values.get("status")), None)
    if values.get("parts"):
        return status if status is not None and status.is_model else Status.MODELLED
    if status is not None and status.is_model:
        raise InputError(
            f"expected parts of a building whose status is {status.code}, got none; give one part "
            "at least"
        )
    return status or Status.NO_POINTS


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


def make_roof(
    parts: list[Values], outline: shapely.Polygon | None, origin: np.ndarray | None
) -> Roof:
    """Return the roof of a building's parts over its outline, about its origin."""
    if outline is None or origin is None:
        raise InputError(
            "expected an outline and an origin of a building with parts, got null; give both"
        )
    refuse_many(parts)
    outline = on_grid(outline)
    created = [make_part(part, outline, f"part {index}") for index, part in enumerate(parts)]
    roof = Roof(tuple(created), outline, LocalFrame(round_values(origin, DIGITS)))
    refuse_wrong_parts(roof)
    return roof


def make_part(values: Values, outline: shapely.Polygon, label: str) -> Part:
    """Make a part with its planes, over the building's outline if it has none of its own."""
    kind = values["type"]
    refuse_no_shape(kind, values["parameters"], label)
    parameters = {name: round_number(value) for name, value in values["parameters"].items()}
    position, kappa = read_position(values, label)
    outlines = values.get("outlines")
    if outlines is None:
        outlines = cut_plan(kind, parameters, position, kappa, outline, label)
    if kind == "shed":
        outlines = by_teeth(outlines, parameters, position, kappa)
    outlines = [rounded_outline(o) for o in outlines]
    pieces = make_pieces(kind, parameters, kappa, position, outlines)
    sigma = {
        ("kappa" if n == "rotation" else n): (math.radians(s) if n == "rotation" else s)
        for n, s in values.get("sigma", {}).items()
    }
    return Part(kind, pieces, parameters, kappa, position, settled_sigma(sigma))


def read_position(values: Values, label: str) -> tuple[np.ndarray, float]:
    """Read where a part or an installation lies (3,) about the origin, and its rotation in rad."""
    position = np.array([measure(value, f"position of {label}") for value in values["position"]])
    return round_values(position, DIGITS), math.radians(round_number(values.get("rotation", 0.0)))


def cut_plan(
    kind: str,
    parameters: Parameters,
    position: np.ndarray,
    kappa: float,
    outline: shapely.Polygon,
    label: str,
) -> list[shapely.Polygon]:
    """Return what the plan of a part covers of the building's outline."""
    if "width" not in parameters or "length" not in parameters:
        raise InputError(
            f"expected width and length, or outlines, of {label}, got neither; give the rectangle"
        )
    half = 0.5 * np.array([parameters["length"], parameters["width"]])
    rim = np.array(CATALOGUE[kind].variant(parameters).rim) * half
    return clip(place_plan(rim, position, kappa), outline)


def place_plan(uv: np.ndarray, position: np.ndarray, kappa: float) -> shapely.Polygon:
    """Return the polygon of corners (n, 2) along and across a part, about the origin."""
    return shapely.Polygon(turn_points(uv, kappa) + position[:2])


def clip(area: shapely.Polygon, outline: shapely.Polygon) -> list[shapely.Polygon]:
    """Return the polygons that an area covers of an outline."""
    covered = intersect(area, repair_polygons(outline), 1e-4)
    return [g for g in shapely.get_parts(covered) if g.geom_type == "Polygon"]


def by_teeth(
    outlines: list[shapely.Polygon],
    parameters: Parameters,
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


def read_terrain_lines(record: Values) -> list[np.ndarray]:
    """Read the terrain's lines (m, 3) along the outline of a building's object."""
    return read_lines(record.get("terrain_line"), "terrain_line")


def read_lines(value: Any, label: str) -> list[np.ndarray]:
    """Read lines (m, 3), none where there are none."""
    lines = [
        read_places(as_list(line, f"a line of {label}"), f"a point of {label}")
        for line in as_list(value or [], label)
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


def read_change(record: Values) -> Values | None:
    """Read what the last update found of a building, None where there is nothing."""
    change = record.get("change")
    return None if change is None else check_change(change, "change")


def check_change(change: Any, label: str) -> Values:
    """Check what an update found of a building, which is kept as it is written."""
    values = read_object(change, "change")
    for k, place in enumerate(values.get("places", ())):
        if len(place.get("parts", ())) not in (0, 2):
            raise InputError(
                f"expected the earlier and the new part of {LISTED['change_place'].format(k)}, got "
                f"{excerpt(place['parts'])}; write null for none"
            )
    names, lists = TABLES["change"].names, ("places", "lineage", "predecessors", "history")
    kept = {**change, **{name: list_at(change, name) for name in lists}}
    return {name: kept.get(name) for name in names if name != "history" or kept[name]}


def read_update(record: Any) -> UpdateHead:
    """Read what an update found beside its buildings."""
    update, names = read_object(record, "update"), TABLES["roof_outside"].names
    roofs = list_at(record, "roofs_outside")
    for k, roof in enumerate(roofs):
        number(roof["area"], f"the area of {LISTED['roof_outside'].format(k)}")
    outside = ({name: roof.get(name) for name in names} for roof in roofs)
    return UpdateHead(update["survey"], tuple(outside))


def refuse_other_kinds(record: Values) -> None:
    """Raise InputError where a value is of another kind than a run writes."""
    choose_status(read_object(record, "building"))


def require_mapping(value: Any, label: str) -> Values:
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
    return read_text(record.get(name), name)


def read_text(value: Any, label: str) -> str:
    if not (value is None or isinstance(value, str)):
        raise InputError(f"expected text as {label}, got {excerpt(value)}; put it in quotes")
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


def read_figure(value: Any, label: str) -> float:
    """Read a number, NaN where it is null."""
    return math.nan if value is None else number(value, label)


def numbers_by_name(values: Any, label: str) -> dict[str, float]:
    return {
        str(name): measure(value, f"{name} in {label}")
        for name, value in require_mapping(values or {}, label).items()
    }


def read_figures(values: Any, label: str) -> dict[str, float]:
    mapping = require_mapping(values or {}, label)
    return {name: read_figure(value, name) for name, value in mapping.items()}


def read_shift(record: Values) -> tuple[float, float]:
    """Read how far the footprint was moved; one made by hand was not."""
    return read_pair(record.get("shift", [0.0, 0.0]), "shift")


def read_pair(value: Any, label: str) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise InputError(
            f"expected two numbers [x, y] as {label}, got {excerpt(value)}; give metres"
        )
    return number(value[0], label), number(value[1], label)


def place(value: Any, label: str) -> np.ndarray:
    """Read three coordinates (3,)."""
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(
            f"expected three numbers [x, y, z] as {label}, got {excerpt(value)}; give metres"
        )
    return np.array([coordinate(v, label) for v in value])


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


# How values of a type are read; all others are lists, choices and objects of a table.
READERS: dict[str, Callable[[Any, str], Any]] = {
    **dict.fromkeys(("text", "text?"), read_text),
    **dict.fromkeys(("parameters", "box", "numbers", "shares"), numbers_by_name),
    **dict.fromkeys(("integer", "length", "natural"), number),
    "number": measure,
    "number?": read_figure,
    "figures": read_figures,
    "pair": read_pair,
    "place": place,
    "polygon": polygon,
    "place[][]": read_lines,
    "object": lambda value, label: require_mapping(value or {}, label),
    "change": lambda value, label: None if value is None else check_change(value, label),
}
