"""The operation that PROJ uses between two CRSs, and its accuracy.

A missing grid that would be more accurate is named.

PROJ transforms between datums by the best operation whose grids are installed. Where the grid of a
better one is missing it takes a coarser one without a word, and everything moves by metres.
`find_operation` names both.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import warnings
from dataclasses import dataclass
from typing import Any

from pyproj import CRS, Transformer
from pyproj.exceptions import ProjError
from pyproj.transformer import AreaOfInterest, TransformerGroup

from ...errors import InputWarning
from . import describe_crs, parse_crs

# Accuracy (m) from which on an operation is worth a remark: footprints a metre off take their
# neighbours' roofs.
COARSE_OPERATION_M = 1.0


@dataclass(frozen=True)
class Operation:
    """An operation of PROJ from the CRS `source` to `target`.

    It is used near `place` (x, y in `source`) for `subject`. `accuracy_m` is PROJ's, None where it
    states none. `missing_grids` are those of the best operation that cannot be used because they
    are not installed, and `missing_accuracy_m` is its accuracy; empty and None where none is
    better.
    """

    subject: str
    source: str
    target: str
    place: tuple[float, float]
    name: str
    accuracy_m: float | None
    missing_grids: tuple[str, ...] = ()
    missing_accuracy_m: float | None = None

    @property
    def is_coarse(self) -> bool:
        """Whether the operation may put things COARSE_M or more beside their place."""
        return self.accuracy_m is None or self.accuracy_m >= COARSE_OPERATION_M

    @property
    def remark(self) -> str:
        """Advice on a coarse operation for the user; empty for an accurate one."""
        if not self.is_coarse:
            return ""
        accuracy = (
            "to an unknown accuracy" if self.accuracy_m is None else f"to {self.accuracy_m:g} m"
        )
        ways = f"{describe_crs(parse_crs(self.source))} to {describe_crs(parse_crs(self.target))}"
        text = f"{self.subject}: transformed from {ways} {accuracy} ({self.name})"
        if not self.missing_grids:
            return (
                f"{text}; PROJ knows no better way, so check that the models lie where they should"
            )
        files = " ".join(f"--file {grid}" for grid in self.missing_grids)
        better = (
            ""
            if self.missing_accuracy_m is None
            else f", accurate to {self.missing_accuracy_m:g} m,"
        )
        return (
            f"{text}; a better way{better} needs {', '.join(self.missing_grids)}, which is not "
            f"installed: run `projsync {files}`, or set PROJ_NETWORK=ON"
        )

    def to_dict(self) -> dict[str, Any]:
        return dataclasses.asdict(self)

    @staticmethod
    def from_dict(values: dict[str, Any]) -> Operation:
        lists = {name: tuple(values[name]) for name in ("place", "missing_grids")}
        return Operation(**values | lists)


def find_operation(subject: str, source: CRS, target: CRS, place: tuple[float, float]) -> Operation:
    """Find the operation of `Transformer.from_crs(source, target)` at x, y in `source`."""
    x, y = (float(value) for value in place)
    return dataclasses.replace(
        operation_at(source.to_string(), target.to_string(), (x, y)), subject=subject
    )


def is_current(operation: Operation) -> bool:
    """Check whether PROJ still uses this operation: grids may have come or gone since."""
    current = operation_at(operation.source, operation.target, operation.place)
    return (current.name, current.accuracy_m) == (operation.name, operation.accuracy_m)


def warn_if_coarse(operation: Operation) -> None:
    """Warn (InputWarning) where an operation is coarse or its accuracy unknown."""
    if operation.remark:
        warnings.warn(operation.remark, InputWarning)


@functools.lru_cache(maxsize=32)
def operation_at(source: str, target: str, place: tuple[float, float]) -> Operation:
    """Return the operation between CRSs given as text, for no subject."""
    transformer = Transformer.from_crs(source, target, always_xy=True)
    transformer.transform(*place)
    try:
        in_use = transformer.get_last_used_operation()
    except ProjError:  # a single operation, which is the transformer itself
        in_use = transformer
    accuracy = in_use.accuracy if in_use.accuracy is not None and in_use.accuracy >= 0 else None
    operation = Operation("", source, target, place, in_use.description, accuracy)
    for way in missing_ways(source, target, place):
        if accuracy is None or 0 <= way.accuracy < accuracy:  # a negative one is unknown
            grids = dict.fromkeys(grid.short_name for grid in way.grids if not grid.available)
            better = way.accuracy if way.accuracy >= 0 else None
            return dataclasses.replace(
                operation, missing_grids=tuple(grids), missing_accuracy_m=better
            )
    return operation


def missing_ways(source: str, target: str, place: tuple[float, float]) -> list:
    """Return PROJ's operations near `place` whose grids are missing, best first."""
    lon, lat = Transformer.from_crs(source, "EPSG:4326", always_xy=True).transform(*place)
    area = AreaOfInterest(lon, lat, lon, lat) if math.isfinite(lon) and math.isfinite(lat) else None
    with warnings.catch_warnings():
        # of the missing grids, which are what is asked for
        warnings.simplefilter("ignore", UserWarning)
        return TransformerGroup(
            source, target, always_xy=True, area_of_interest=area
        ).unavailable_operations
