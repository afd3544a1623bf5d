"""How far a roof reaches beyond the walls below it (LoD2.3)."""

from __future__ import annotations

from dataclasses import dataclass

from .solid import Solid

WALLS, ROOF_EDGE = "walls", "roof"  # what an outline is that of


@dataclass(frozen=True)
class Overhang:
    """The distance `length` (m) of the roof's edge from the wall below it.

    `edge` is the number of the edge of the roof's outline, counted from 0 along the rings as they
    are written. `sigma` (m) is NaN where the length was assumed.
    """

    edge: int
    length: float
    sigma: float = float("nan")


@dataclass(frozen=True)
class Eaves:
    """All overhangs of a roof; other edges have none.

    `thickness` (m) is that of the roof over them, measured upright. `footprint_kind` says whether
    the outline is one of walls, which the roof reaches beyond, or of the roof, within which walls
    stand. `solid` (world) has the overhangs; it is None where there are none.
    """

    overhangs: tuple[Overhang, ...] = ()
    thickness: float = 0.2
    footprint_kind: str = WALLS
    solid: Solid | None = None
