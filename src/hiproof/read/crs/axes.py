"""The directions and units of a coordinate reference system's axes.

Models are built in x to the right, y upwards and heights above, all in units of length. A system
whose axes cannot be used so is refused with an InputError.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...errors import InputError
from ..names import READING

# Shortest and longest unit (m) of a coordinate: EPSG's own linear units run from 0.001 m to 1,852
# m.
LEAST_UNIT_M, MOST_UNIT_M = 1e-3, 2000.0

# Starts of the names of units that count angles. WKT 1 declares units without their kind.
ANGULAR_UNITS = ("degree", "radian", "grad", "gon", "arc-second", "arc-minute")

# Directions of axes clockwise from north, a sixteenth of a turn apart.
COMPASS: list[str] = READING["compass"]


def check_plan_axes(plan: Any, source: str) -> None:
    """Refuse a plan CRS unless its axes are lengths, x to the right of y.

    Both lengths have to be in one unit. `source` names the coordinates in the message. Files hold
    east before north whatever order a CRS declares, so north before east is usual. A local system
    may be turned, but not mirrored.
    """
    axes = plan.axis_info[:2]
    directions = [axis.direction for axis in axes]
    if len(axes) < 2:
        raise InputError(
            f"expected {source} in a CRS of two axes in plan, got {plan.name} "
            f"({plan.type_name.lower()}); name a projected CRS with --crs"
        )
    if not runs_east_and_north(directions, is_local=plan.is_engineering):
        raise InputError(
            f"expected {source} in a CRS whose axes run east and north, got {plan.name}, whose "
            f"axes run {' and '.join(directions)}; reproject to a CRS of the place that counts "
            "east and north"
        )
    for axis in axes:
        check_unit(axis, plan, source)
    first, second = axes
    if first.unit_conversion_factor != second.unit_conversion_factor:
        raise InputError(
            f"expected {source} in a CRS with one unit in plan, got {plan.name} in "
            f"{first.unit_name} and {second.unit_name}; reproject to a CRS with one unit"
        )


def runs_east_and_north(directions: Sequence[str], is_local: bool) -> bool:
    """Return whether two axes may be taken as x to the right and y upwards.

    Both axes of a polar CRS run away from the pole.

    >>> runs_east_and_north(("north", "east"), False), runs_east_and_north(("south", "west"), False)
    (True, False)
    >>> runs_east_and_north(("southWest", "southEast"), True), runs_east_and_north(("west",
    ...     "north"), True)
    (True, False)
    """
    first, second = directions
    if first == second or {first, second} == {"east", "north"}:
        return True
    if not is_local:
        return False
    if first not in COMPASS or second not in COMPASS:
        return True
    turn = (COMPASS.index(first) - COMPASS.index(second)) % len(COMPASS)
    return 0 < turn < len(COMPASS) / 2


def check_height_axis(axis: Any, crs: Any, source: str) -> None:
    """Refuse a height axis that counts downwards, or in no length."""
    if axis.direction == "down":
        raise InputError(
            f"expected {source} with heights, got {crs.name}, which counts depths downwards; "
            "turn them into heights and name a CRS of heights with --crs"
        )
    check_unit(axis, crs, source)


def check_unit(axis: Any, crs: Any, source: str) -> None:
    """Refuse an axis whose unit is no length that is in use."""
    is_angle = axis.unit_name.lower().startswith(ANGULAR_UNITS)
    if is_angle or not LEAST_UNIT_M <= axis.unit_conversion_factor <= MOST_UNIT_M:
        raise InputError(
            f"expected {source} in a CRS that counts in metres, feet or another unit of length, "
            f"got {crs.name} in units of {axis.unit_conversion_factor:g} ({axis.unit_name}); name "
            "the right CRS with --crs"
        )
