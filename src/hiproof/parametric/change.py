"""Changes of one part: another type, a ridge or eave height, moved sides.

Parts are JSON objects here.

An edit is an edit of what is written (`write.parameters.part_record`), so whatever a hand may do to
the file a program may do, and the same checks hold.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely

from ..data_files import Values
from ..errors import InputError
from ..geometry.rings import repair_polygons
from ..primitives.catalogue import CATALOGUE
from ..primitives.family import Member, read_member
from ..primitives.parameters import SIDED
from .record import measure, place

PLAN_SIZES = ("width", "length")
USUAL_PITCH = 0.5  # rise by run of a roof made of a flat one
STEEPEST_SLOPE = math.tan(math.radians(85.0))  # rise over run; a steeper plane is a wall


def change_part(part: Values, change: Values, z_origin: float) -> Values:
    """Return a part after a change.

    A change may name `type`, `position` (x, y, z about the origin), `rotation` (degrees),
    `ridge_height` and `eave_height` (world metres, the origin at `z_origin`), `outlines`, and any
    parameter by name. Another type keeps the rectangle, the lowest eave and the ridge's height. A
    part that moves or whose sides do roofs what its rectangle covers, its own outlines left out.
    Raises InputError for what contradicts itself.
    """
    change = {name: value for name, value in change.items() if value is not None}
    part = leave_out(part, "sigma")
    kind = change.pop("type", part["type"])
    if kind != part["type"]:
        sizes = {name: measure(change[name], name) for name in PLAN_SIZES if name in change}
        # Sizes that make no rectangle are left to be refused with the whole part.
        sizes = {name: size for name, size in sizes.items() if size > 0.0}
        part = change_type(with_sizes(part), kind, sizes)
    ridge, eave = (
        measure(change.pop(name), name) if name in change else None
        for name in ("ridge_height", "eave_height")
    )
    placed: Values = {
        name: change.pop(name) for name in ("position", "rotation", "outlines") if name in change
    }
    if SIDED & change.keys():
        part = side_by_side(part)
    moves = placed.keys() & {"position", "rotation"} or change.keys() & set(PLAN_SIZES)
    if moves and "outlines" not in placed:
        part = leave_out(with_sizes(part), "outlines")
    part = from_lowest_eave({**part, **placed, "parameters": {**part["parameters"], **change}})
    if eave is not None:
        part["position"] = [*part["position"][:2], eave - z_origin]
    return part if ridge is None else with_ridge(part, ridge - z_origin)


def leave_out(part: Values, name: str) -> Values:
    return {key: value for key, value in part.items() if key != name}


def from_lowest_eave(part: Values) -> Values:
    """Return the part at its lowest eave, from which all heights of its sides count."""
    parameters = part["parameters"]
    eaves = [name for name in parameters if name in SIDED and name.startswith("eave_")]
    smallest = min((measure(parameters[name], name) for name in eaves), default=0.0)
    if smallest == 0.0:
        return part
    x, y, z = place(part["position"], "position").tolist()
    from_low = {
        name: parameters[name] - smallest for name in (*eaves, "height") if name in parameters
    }
    return {**part, "parameters": {**parameters, **from_low}, "position": [x, y, z + smallest]}


def with_sizes(part: Values) -> Values:
    """Return the part with width and length, else of its outlines' smallest rectangle."""
    if all(name in part["parameters"] for name in PLAN_SIZES):
        return part
    outlines = shapely.union_all([make_polygon(outline) for outline in part["outlines"]])
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(outlines))[:4]
    sides = corners[1:3] - corners[:2]
    lengths = np.hypot(*sides.T)
    along = int(lengths.argmax())
    x, y = corners.mean(axis=0).tolist()
    sizes = {"width": float(lengths[1 - along]), "length": float(lengths[along])}
    rotation = math.degrees(math.atan2(*sides[along][::-1]))
    return {
        **part,
        "parameters": {**part["parameters"], **sizes},
        "position": [x, y, part["position"][2]],
        "rotation": rotation,
    }


def make_polygon(rings: list[Any]) -> shapely.Geometry:
    """Return the area of rings of (x, y), the outer first; a spike without width has none."""
    return repair_polygons(shapely.Polygon(rings[0], rings[1:]))


def change_type(part: Values, kind: str, sizes: dict[str, float]) -> Values:
    """Return the part as another type of the same eave, rise and rectangle, or `sizes`."""
    if not isinstance(kind, str) or kind not in CATALOGUE:
        raise InputError(f"expected a roof type ({', '.join(CATALOGUE)}), got {kind!r}; choose one")
    width, length = (sizes.get(name, part["parameters"][name]) for name in PLAN_SIZES)
    rise = measure_rise(part) or 0.5 * USUAL_PITCH * width
    return {**part, "type": kind, "parameters": CATALOGUE[kind].typical(width, length, rise)}


def side_by_side(part: Values) -> Values:
    """Return the part with pitches and eaves of sides; raises InputError where it has none."""
    parameters = part["parameters"]
    if SIDED & parameters.keys():
        return part
    if not CATALOGUE[part["type"]].is_of_family or part["type"] == "flat":
        raise InputError(
            "expected a roof with pitches of its own sides, got the roof type "
            f"{part['type']}; change its type first"
        )
    return {
        **part,
        "parameters": read_member(part["type"], parameters, 0.0, np.zeros(3)).side_by_side()[0],
    }


def measure_rise(part: Values) -> float:
    """Return the height of the part's ridge or top over its lowest eave [m]."""
    if part["type"] == "flat":
        return 0.0
    if not CATALOGUE[part["type"]].is_of_family:
        return part["parameters"]["height"]
    return measure_member_rise(read_member(part["type"], part["parameters"], 0.0, np.zeros(3)))


def measure_member_rise(member: Member) -> float:
    """Return a member's greatest height in its rectangle without skews and cants."""
    reach = []
    for axis in (0, 1):
        sides = [side for side in (2 * axis, 2 * axis + 1) if member.has[side]]
        if len(sides) == 2:
            reach.append(
                member.apex(axis) if member.slopes[sides].any() else member.eaves[sides].min()
            )
        reach += [
            member.eaves[s] + 2.0 * member.slopes[s] * member.half[axis]
            for s in sides
            if len(sides) == 1
        ]
    return float(min(*reach, member.top, math.inf) - member.base)


def with_ridge(part: Values, z_ridge: float) -> Values:
    """Return the part with its ridge or top at `z_ridge` about the origin; eaves stay."""
    if part["type"] == "flat":
        return {**part, "position": [*part["position"][:2], z_ridge]}
    if not measure_rise(part) > 0.0:  # a roof without any slope has none that could be made steeper
        part = change_type(with_sizes(part), part["type"], {})
    parameters, rise = part["parameters"], z_ridge - part["position"][2]
    if not rise > 0.0:
        raise InputError(
            f"expected a ridge above the eave, got one {-rise:.2f} m below it; lower the eave too "
            "(eave_height)"
        )
    if not SIDED & parameters.keys():
        scale = rise / measure_rise(part)
        heights = {
            n: scale * h for n, h in parameters.items() if n.endswith("height") or n == "eave_step"
        }
        return {**part, "parameters": {**parameters, **heights}}
    if "height" not in parameters:
        return {**part, "parameters": parameters | scale_pitches(parameters, part["type"], rise)}
    steeper = rise / parameters["height"]  # a level top keeps its size
    pitches = {n: steeper_by(steeper, v) for n, v in parameters.items() if n.startswith("pitch_")}
    return {**part, "parameters": {**parameters, **pitches, "height": rise}}


def steeper_by(factor: float, pitch_deg: float) -> float:
    """Return the pitch [degrees] whose slope is `factor` times as much."""
    return math.degrees(math.atan(factor * math.tan(math.radians(pitch_deg))))


def scale_pitches(parameters: dict[str, float], kind: str, rise: float) -> dict[str, float]:
    """Return pitches, changed by one factor, with the ridge at `rise` over the lowest eave."""
    arguments = {name: value for name, value in parameters.items() if name.startswith("pitch_")}

    def pitches(factor: float) -> dict[str, float]:
        return {name: steeper_by(factor, pitch) for name, pitch in arguments.items()}

    lower, upper = 0.0, STEEPEST_SLOPE / max(math.tan(math.radians(max(arguments.values()))), 1e-9)
    for _ in range(60):  # the rise grows with the factor
        middle = 0.5 * (lower + upper)
        member_rise = measure_member_rise(
            read_member(kind, parameters | pitches(middle), 0.0, np.zeros(3))
        )
        lower, upper = (middle, upper) if member_rise < rise else (lower, middle)
    return pitches(0.5 * (lower + upper))
