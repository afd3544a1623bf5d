"""Changes of a building between two surveys, with known truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import shapely

from hiproof.model import Part
from hiproof.simulate.roofs import SimBuilding, find_largest_part, make_part, united_outline

SMALLEST_PART_M2 = 12.0
"""Area (m2) of a part that is raised, lowered or removed; dormers are small objects."""

EDGE_MARGIN_M = 0.8  # between an addition and the edge of the part that it stands on

OTHER_TYPES = {
    "flat": "gable",
    "gable": "flat",
    "asymmetric_gable": "flat",
    "hip": "gable",
    "half_hip": "flat",
    "pyramid": "flat",
    "monopitch": "gable",
    "mansard": "gable",
    "gambrel": "flat",
}
"""Type that the largest part gets, by the type that it had."""

SLOPING = ("gable", "hip", "monopitch", "pyramid", "asymmetric_gable")


def change_building(
    rng: np.random.Generator, building: SimBuilding, kind: str
) -> SimBuilding | None:
    """Return the building after a change, a key of CHANGES, None where it allows none."""
    parts = CHANGES[kind](rng, building)
    if parts is None:
        return None
    roof = replace(building.roof, parts=tuple(parts), outline=united_outline(tuple(parts)))
    return replace(building, roof=roof, type=find_largest_part(roof).type)


def lift(part: Part, height: float) -> Part:
    """Return the part `height` (m) higher."""
    shift = np.array([0.0, 0.0, height])
    pieces = tuple(piece.move(shift) for piece in part.pieces)
    return replace(part, translation=part.translation + shift, pieces=pieces)


def raise_roof(rng: np.random.Generator, building: SimBuilding) -> list[Part]:
    """Add a storey, or half of one."""
    height = rng.uniform(0.5, 3.2)
    return [lift(part, height) for part in building.roof.parts]


def lower_roof(rng: np.random.Generator, building: SimBuilding) -> list[Part] | None:
    """Take off as much as leaves a wall of 2 m."""
    most = min(part.translation[2] for part in building.roof.parts) - 2.0
    if most < 0.5:
        return None
    height = rng.uniform(0.5, min(most, 3.0))
    return [lift(part, -height) for part in building.roof.parts]


def choose_part(rng: np.random.Generator, building: SimBuilding) -> int | None:
    """Choose one part among several, none of them a dormer."""
    parts = building.roof.parts
    large = [k for k, part in enumerate(parts) if part.area >= SMALLEST_PART_M2]
    return int(rng.choice(large)) if len(parts) > 1 and len(large) == len(parts) else None


def raise_part(rng: np.random.Generator, building: SimBuilding) -> list[Part] | None:
    """Raise one part of several."""
    k = choose_part(rng, building)
    parts = list(building.roof.parts)
    return (
        None if k is None else [*parts[:k], lift(parts[k], rng.uniform(0.6, 3.0)), *parts[k + 1 :]]
    )


def lower_part(rng: np.random.Generator, building: SimBuilding) -> list[Part] | None:
    """Lower one part of several."""
    k, parts = choose_part(rng, building), list(building.roof.parts)
    if k is None or (most := parts[k].translation[2] - 2.0) < 0.6:
        return None
    return [*parts[:k], lift(parts[k], -rng.uniform(0.6, min(most, 3.0))), *parts[k + 1 :]]


def put_block(
    rng: np.random.Generator, part: Part, size: tuple[float, float], height: float
) -> Part | None:
    """Return a level block on a part, `height` (m) over the highest roof below, or None."""
    p = part.parameters
    if "width" not in p:
        return None
    room = (np.array([p["length"], p["width"]]) - size - EDGE_MARGIN_M) / 2
    if (room < 0).any():
        return None
    u, v = rng.uniform(-room, room)
    c, s = math.cos(part.kappa), math.sin(part.kappa)
    xy = part.translation[:2] + np.array([c * u - s * v, s * u + c * v])
    sides = {"length": size[0], "width": size[1]}
    block = make_part("flat", sides, part.kappa, np.array([*xy, 0.0]))
    corners = np.vstack([shapely.get_coordinates(block.pieces[0].outline), xy[None]])
    return lift(block, max(piece.height_at(corners).max() for piece in part.pieces) + height)


def add_part(rng: np.random.Generator, building: SimBuilding) -> list[Part] | None:
    """Build a block of 16 to 45 m2 on a level roof."""
    part = building.largest
    if part.type != "flat":
        return None
    size = (rng.uniform(4.5, 8.0), rng.uniform(3.5, 5.5))
    block = put_block(rng, part, size, rng.uniform(0.8, 3.0))
    return None if block is None else [*building.roof.parts, block]


def remove_part(rng: np.random.Generator, building: SimBuilding) -> list[Part] | None:
    """Pull the smallest part of several down to the ground."""
    parts = list(building.roof.parts)
    if choose_part(rng, building) is None or building.kind == "row":
        return None
    k = int(np.argmin([part.area for part in parts]))
    return [*parts[:k], *parts[k + 1 :]]


def change_type(rng: np.random.Generator, building: SimBuilding) -> list[Part] | None:
    """Put another roof on the largest part, of a building of one part."""
    part, parts = building.largest, building.roof.parts
    if len(parts) > 1 or part.type not in OTHER_TYPES or "width" not in part.parameters:
        return None
    sizes = {name: part.parameters[name] for name in ("width", "length")}
    kind = OTHER_TYPES[part.type]
    if kind == "gable":
        sizes["height"] = sizes["width"] / 2 * math.tan(math.radians(rng.uniform(25, 48)))
    return [make_part(kind, sizes, part.kappa, part.translation)]


def change_slope(rng: np.random.Generator, building: SimBuilding) -> list[Part] | None:
    """Make the roof of one part steeper or flatter: its ridge moves by 0.8 m or more."""
    part, parts = building.largest, building.roof.parts
    if len(parts) > 1 or part.type not in SLOPING or "height" not in part.parameters:
        return None
    height = part.parameters["height"]
    step = rng.uniform(0.8, 2.0)
    new = height - step if height - step > 0.8 and rng.random() < 0.5 else height + step
    return [make_part(part.type, {**part.parameters, "height": new}, part.kappa, part.translation)]


def add_small_object(rng: np.random.Generator, building: SimBuilding) -> list[Part] | None:
    """Put a box of 4.5 to 9 m2 on the roof, 0.6 to 1.5 m over what is below."""
    size = (rng.uniform(2.2, 3.2), rng.uniform(2.1, 2.8))
    block = put_block(rng, building.largest, size, rng.uniform(0.6, 1.5))
    return None if block is None else [*building.roof.parts, block]


CHANGES: dict[str, Callable[[np.random.Generator, SimBuilding], list[Part] | None]] = {
    "roof_raised": raise_roof,
    "roof_lowered": lower_roof,
    "part_raised": raise_part,
    "part_lowered": lower_part,
    "part_added": add_part,
    "part_removed": remove_part,
    "type_changed": change_type,
    "slope_changed": change_slope,
    "small_object": add_small_object,
}
"""Changes by the name that `hiproof update` gives them."""
