"""Coordinates of files in another CRS than the run's own (`--out-crs`).

Every vertex goes by itself, so that corners which meet still meet, whatever building or file they
are in. A plan goes as a plan and a height as a height: what stands upright in one CRS does so in
the other, and planes bend by less than coordinates are rounded to as long as both projections are
true to shape.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..frames import METRES, Units
from ..read.crs import (
    combine,
    describe_crs,
    find_best_transformer,
    find_units,
    has_heights,
    horizontal_crs,
    parse_crs,
    same_horizontal,
    vertical_crs,
)


@dataclass(frozen=True)
class Reprojected(Units):
    """Units of a file, and the way to its CRS from world metres.

    World metres are coordinates of another CRS times their units, `own`. `plan_way` takes plans,
    `height_way` places with their heights, in a unit of `height_m` metres; None where heights stay.
    """

    own: Units = METRES
    plan_way: Any = None
    height_way: Any = None
    height_m: float = 1.0

    def from_metres(self, world: np.ndarray) -> np.ndarray:
        """Return file coordinates of world metres (..., 2 or 3); InputError without any there."""
        world = np.asarray(world, float)
        places = np.moveaxis(self.own.from_metres(world), -1, 0)
        columns = [*self.plan_way.transform(*places[:2])]
        if len(places) == 3:
            z = world[..., 2]
            if self.height_way is not None:
                z = self.height_m * np.asarray(self.height_way.transform(*places)[2])
            columns.append(z / self.height)
        result = np.stack(columns, axis=-1)
        if not np.isfinite(result).all() and np.isfinite(world).all():
            raise InputError(
                "expected buildings inside the area of --out-crs, got some that have no place in "
                "it; name a CRS of theirs"
            )
        return result

    def to_metres(self, coordinates: ArrayLike) -> np.ndarray:
        """Return world metres of the file's coordinates (..., 2) or (..., 3)."""
        x, y, *heights = np.moveaxis(np.asarray(coordinates, float), -1, 0)
        plan = np.stack(self.plan_way.transform(x, y, direction="INVERSE"), axis=-1)
        columns = [self.own.to_metres(plan)]
        for height in heights:
            z = height * self.height
            if self.height_way is not None:
                z = self.height_way.transform(x, y, z / self.height_m, direction="INVERSE")[2]
                z = z * self.own.height
            columns.append(z[..., None])
        return np.concatenate(columns, axis=-1)


def choose_file_crs(crs: Any, requested: str) -> Any:
    """Return the CRS in which files of a run in `crs` are written, the one `requested`.

    It has the run's heights where it names none. Raises InputError for one that is no projection,
    or where the run's is not known.

    >>> describe_crs(choose_file_crs("EPSG:7415", "EPSG:25831"))
    'ETRS89 / UTM zone 31N + NAP height'
    """
    crs, out = parse_crs(crs), parse_crs(requested)
    if out is None:
        return crs
    if crs is None:
        raise InputError(
            f"expected a CRS of the clouds to go to {describe_crs(out)} from, got none; say which "
            "with --crs"
        )
    plan = horizontal_crs(out)
    if not plan.is_projected:
        raise InputError(
            f"expected a projected CRS for --out-crs, got {describe_crs(out)}, in which no solid "
            "has a size; name a UTM zone or a national grid (`hiproof convert` to 3D Tiles places "
            "models on the globe by itself)"
        )
    return combine(out, vertical_crs(crs)) if len(out.axis_info) < 3 else out


def make_reprojection(crs: Any, out: Any, source_units: Units, units: Units) -> Units:
    """Return the way from world metres of `crs` to a file in `out`.

    World metres have `source_units`; the file is in `units`. Raises InputError where pyproj knows
    none, of heights without a grid that is at hand.
    """
    crs, out = parse_crs(crs), parse_crs(out)
    own, theirs = vertical_crs(crs), vertical_crs(out)
    heights = has_heights(out) and not (own and theirs and own.equals(theirs))
    if same_horizontal(crs, out) and not heights:
        return units
    plan = find_best_transformer(horizontal_crs(crs), horizontal_crs(out), allow_ballpark=False)
    if plan is None:
        raise InputError(
            f"expected a CRS that pyproj can go to from {describe_crs(crs)}, got "
            f"{describe_crs(out)}; name one of the same part of the Earth"
        )
    way = height_way(crs, out) if heights else None
    return Reprojected(
        *(units.plan, units.height, units.plan_name, units.height_name),
        source_units,
        plan,
        way,
        find_units(out).height,
    )


def height_way(crs: Any, out: Any) -> Any:
    """Return the transformer of two CRSs with heights; InputError without these or a grid."""
    way = find_best_transformer(crs, out, allow_ballpark=False) if has_heights(crs) else None
    if way is None:
        missing = (
            "no grid between them is here (`projsync` gets some)"
            if has_heights(crs)
            else "the clouds' names none"
        )
        raise InputError(
            f"expected heights that pyproj can take from {describe_crs(crs)} to "
            f"{describe_crs(out)}, but {missing}; name the plan alone with --out-crs, heights then "
            "stay as they are"
        )
    return way
