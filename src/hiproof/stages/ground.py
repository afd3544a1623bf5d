"""The ground of a building: bare ground inside it, and the lower end of its walls."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

from ..frames import LocalFrame
from ..model import Roof
from ..settings import Settings
from .points import finite

if TYPE_CHECKING:
    from ..fit.site import Site
    from ..read.terrain import Terrain

ASSUMED_WALL_M = 3.0  # height of the lowest wall where nothing is known of the terrain

# Of the lowest point below all of the roof, from which on walls are seen; a gutter or a bay hangs
# less far down.
WALLS_SEEN_M = 1.5


@dataclass(frozen=True)
class Ground:
    """Walls' lower end (world), source, and terrain line, of which `known_share` is known."""

    z: float
    source: str
    intersection: tuple[np.ndarray, ...] = ()
    known_share: float = 0.0


def look_at_ground(
    points: np.ndarray,
    outline: shapely.Polygon | None,
    ground: np.ndarray | None,
    frame: LocalFrame,
    terrain: Terrain | None,
    settings: Settings,
) -> Site:
    """Remove bare ground from points and outline (local); it may be that nothing stands."""
    from ..fit.site import Site, look_at_ground

    if outline is None or (terrain is None and ground is None):
        return Site(points, outline)
    ground = np.zeros((0, 3)) if ground is None else frame.to_local(finite(ground))
    return look_at_ground(points, outline, ground, frame, terrain, settings)


def find_ground(
    outline: shapely.Polygon,
    points: np.ndarray,
    frame: LocalFrame,
    terrain: Terrain | None,
    roof: Roof | None = None,
    walls: str = "level",
) -> Ground:
    """Find z_min, and the terrain's line around the outline.

    It is the lowest terrain under the roof's eave vertices (paper section 3.3). Where no terrain is
    known it is assumed as low as a low wall's foot, or as the lowest points of the walls that are
    seen below `roof`. `walls` are those of the settings: where they follow the terrain, a line of
    which a part is unknown runs at z_min there.
    """
    from ..compose import terrain_intersection
    from ..compose.settle import PLAN_DIGITS, round_number

    if terrain is not None:
        corners = frame.to_world(shapely.get_coordinates(outline))
        heights, source = query_terrain(terrain, corners)
        if np.isfinite(heights).any():
            z = round_number(np.nanmin(heights), PLAN_DIGITS)
            unknown: list[np.ndarray] = []

            def height_at(xy: np.ndarray) -> np.ndarray:
                heights = terrain.height_at(frame.to_world(xy)) - frame.origin[2]
                unknown.append(np.isnan(heights))
                return (
                    np.where(unknown[-1], z - frame.origin[2], heights)
                    if walls == "terrain"
                    else heights
                )

            lines = terrain_intersection(outline, height_at, z - frame.origin[2])
            rounded = tuple(np.round(frame.to_world(line), PLAN_DIGITS) for line in lines)
            return Ground(z, source, rounded, 1.0 - float(np.concatenate(unknown).mean()))
    assumed, source = assume_ground(points, roof)
    return Ground(round_number(assumed + frame.origin[2], PLAN_DIGITS), source)


def assume_ground(points: np.ndarray, roof: Roof | None) -> tuple[float, str]:
    """Return an assumed ground height in the frame of points (n, 3), and the reason."""
    lowest, usual = float(points[:, 2].min()), f"assumed {ASSUMED_WALL_M:g} m below"
    eave = math.inf
    if roof is not None:
        eave = float(np.nanmin(roof.height_at(points[:, :2]), initial=math.inf))
    if not math.isfinite(eave) or lowest >= eave - WALLS_SEEN_M:
        return lowest - ASSUMED_WALL_M, f"{usual} the lowest point"
    # a single lowest point may be noise
    foot = float(np.partition(points[:, 2], 1)[1]) if len(points) > 1 else lowest
    return (
        (foot, "assumed at the foot of its walls")
        if foot < eave - ASSUMED_WALL_M
        else (eave - ASSUMED_WALL_M, f"{usual} its roof")
    )


def query_terrain(terrain: Terrain, xy_world: np.ndarray) -> tuple[np.ndarray, str]:
    """Return terrain heights (n,) at `xy_world` (n, 2), and the source that answered first."""
    if hasattr(terrain, "heights_and_sources"):
        heights, sources = terrain.heights_and_sources(xy_world)
        return heights, sources[0] if sources else terrain.source
    return terrain.height_at(xy_world), terrain.source
