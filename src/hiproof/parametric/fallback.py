"""Heights from attributes where a building has no usable points.

Registers often know how high a building is. A block of that height then stands for the roof, with a
status of its own. Points and overrides count before it.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely

from ..data_files import Values
from ..errors import CompositionError, SettingsError
from ..model import Building
from ..read.numbers import read_number
from ..settings import ReadSettings, Settings
from ..stages.ground import ASSUMED_WALL_M, Ground, find_ground
from ..stages.outline import largest_polygon, to_local
from ..stages.remarks import add_remark
from ..status import Doubt, Status
from ..write.parameters import outline_record
from .override import RANGES, Override, build_over_ground, choose_frame, describe_block

ABOVE_GROUND = "+"  # before a column: its heights count from the ground
WITHOUT_POINTS = (Status.NO_POINTS, Status.NO_ROOF)


@dataclass(frozen=True)
class FallbackHeights:
    """Heights (m) of a footprint's attributes or None; `block_m` counts from the ground."""

    roof_m: float | None = None
    block_m: float | None = None
    ground_m: float | None = None


def list_fallback_columns(read: ReadSettings) -> list[str]:
    """Return the fallback columns; raises SettingsError for a ground above the ground."""
    if read.fallback_ground_height.startswith(ABOVE_GROUND):
        raise SettingsError(
            "expected a column of heights in the world as --fallback-ground-height, got "
            f"{read.fallback_ground_height}; only --fallback-roof-height takes +COLUMN"
        )
    return list(find_fallback_ranges(read))


def find_fallback_ranges(read: ReadSettings) -> dict[str, tuple[float, float]]:
    """Return the least and largest height that each column may hold, by its name."""
    roof, is_block = split_roof_column(read)
    ranges = {
        roof: RANGES["block_height" if is_block else "ridge_height"],
        read.fallback_ground_height: RANGES["z_ground"],
    }
    return {name: bounds for name, bounds in ranges.items() if name}


def split_roof_column(read: ReadSettings) -> tuple[str, bool]:
    """Return the column of roof heights, and whether they count from the ground."""
    name = read.fallback_roof_height
    return name.removeprefix(ABOVE_GROUND), name.startswith(ABOVE_GROUND)


def read_fallback(attributes: Values, read: ReadSettings) -> FallbackHeights:
    """Read the fallback heights in a footprint's attributes.

    What no building can have, such as -9999, is unknown.

    >>> read_fallback({"h": "9,5 m"}, ReadSettings(fallback_roof_height="+h")).block_m
    9.5
    """
    (roof, is_block), ranges = split_roof_column(read), find_fallback_ranges(read)
    height, ground = (
        read_number(attributes.get(name), *ranges[name]) if name else None
        for name in (roof, read.fallback_ground_height)
    )
    return FallbackHeights(None if is_block else height, height if is_block else None, ground)


def use_fallback(
    building: Building, override: Override | None, terrain: Any, settings: Settings
) -> Building:
    """Return a block of known height where a building has no usable points.

    The building stays as it is where it has a model, where its ground lies bare, or where no height
    is known.
    """
    heights = read_fallback(building.attributes, settings.read)
    if override is not None:  # its heights count before those of attributes
        ridge = override.fixed.get("ridge_height")
        if ridge is not None:
            heights = FallbackHeights(ridge, None, heights.ground_m)
        if override.z_ground is not None:
            heights = dataclasses.replace(heights, ground_m=override.z_ground)
    is_known = heights.roof_m is not None or heights.block_m is not None
    if (
        building.status not in WITHOUT_POINTS
        or building.footprint is None
        or not is_known
        or Doubt.BARE_GROUND.value in building.detail
    ):
        return building
    try:
        return build_block(building, heights, terrain, settings)
    except CompositionError as error:
        return add_remark(building, f"its heights make no block: {error}")


def build_block(
    building: Building, heights: FallbackHeights, terrain: Any, settings: Settings
) -> Building:
    """Return the building as a block over the terrain's ground, else its attributes'."""
    shift = np.array(building.shift)
    outline = shapely.transform(largest_polygon(building.footprint), lambda xy: xy + shift)
    frame = choose_frame(np.zeros((0, 3)), outline)
    local = to_local(outline, frame)
    ground = find_ground(local, np.zeros((1, 3)), frame, terrain)
    if ground.source.startswith("assumed"):
        if heights.ground_m is not None:
            ground = Ground(heights.ground_m, "attribute")
        elif heights.roof_m is not None:
            below = heights.roof_m - ASSUMED_WALL_M
            ground = Ground(below, f"assumed {ASSUMED_WALL_M:g} m below its roof")
        else:
            return add_remark(building, "its height is known, but not that of its ground")
    top = ground.z + heights.block_m if heights.block_m is not None else heights.roof_m
    rings = outline_record(local)
    parts = [describe_block(rings, top - frame.origin[2])]
    return build_over_ground(
        building, Status.FROM_ATTRIBUTES, frame, rings, ground, parts, settings
    )
