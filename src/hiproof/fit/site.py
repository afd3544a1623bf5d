"""A building's footprint against the ground.

Bare ground is cut out. Where nothing stands, a remark says so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from ..frames import LocalFrame
from ..geometry.grid import count_cells
from ..geometry.point_in_polygon import find_inside
from ..read.terrain import Terrain, TerrainChain
from ..settings import Settings
from ..status import Doubt
from .bare_ground import find_bare_ground
from .standing import FEWEST_PLACES, LEAST_LOW, classify_standing, cover, ground_plane

DECK_M = 1.0
"""Height over the ground around from which on points of the ground lie on a deck, which is part of
the building.
"""

LEAST_HOUSE_M2, MOST_OF_PARCEL = 20.0, 0.2
"""Area (m2) of points above the ground from which on they may be a house, and the share of a
parcel up to which it covers that: a roof over more of it is modelled.
"""

ROOFED = 0.85
"""Share of the plan beside bare ground that points above the ground cover at least where a building
stands around a yard: cleared sites with heaps and trees on them reach 0.72
(benchmarks/bare_ground.py).
"""


@dataclass(frozen=True)
class Site:
    """The ground's evidence about a building before its fit.

    It has the points and the outline that remain, whether nothing stands there, and a remark.
    `is_doubtful` says whether the remark speaks against a model: bare ground lies under its roof.
    """

    points: np.ndarray
    outline: shapely.Polygon | None
    remark: str = ""
    is_empty: bool = False
    is_doubtful: bool = False


def look_at_ground(
    points: np.ndarray,
    outline: shapely.Polygon,
    ground: np.ndarray,
    frame: LocalFrame,
    terrain: Terrain | None,
    settings: Settings,
) -> Site:
    """Return what remains of the building's points (n, 3) and outline.

    The points `ground` (m, 3) and the terrain around decide, all in the local `frame`.
    """
    ground = ground.compress(find_inside(outline, ground[:, 0], ground[:, 1]), axis=0)
    plane = None if terrain is None else fit_plane_around(outline, frame, terrain)
    if plane is None:
        return cut_bare_ground(points, outline, ground, settings, points)
    ground = ground[ground[:, 2] - ground[:, :2] @ plane[:2] - plane[2] < DECK_M]
    combined = np.concatenate([points, ground])
    standing = classify_standing(combined, plane)
    if standing.is_empty and not has_roofed_rest(combined, standing.is_low, outline):
        share = f"{100 * standing.low_share:.0f} % of its points lie on the ground"
        share += remark_parcel(points[~standing.is_low[: len(points)]], outline)
        if settings.reconstruct.empty_footprints == "skip":
            return Site(
                points,
                outline,
                f"no model: nothing stands on the footprint, {share}",
                is_empty=True,
            )
        return Site(points, outline, f"perhaps nothing stands there: {share}", is_doubtful=True)
    lower = standing.is_low[: len(points)]
    selection = (
        points[~lower] if lower.mean() >= LEAST_LOW else points
    )  # so many are the cloud's ground, fewer the feet of walls
    return cut_bare_ground(
        selection, outline, np.concatenate([ground, points[lower]]), settings, points[~lower]
    )


def remark_parcel(upper: np.ndarray, outline: shapely.Geometry) -> str:
    """Return a remark where `upper` points (n, 3) cover as much as a house, and little in all."""
    area_m2 = count_cells(np.floor(upper[:, :2]))
    if not LEAST_HOUSE_M2 <= area_m2 < MOST_OF_PARCEL * outline.area:
        return ""
    return (
        f", and points above it cover {area_m2} m2; if that is a house and the footprint its "
        "parcel, pass the outline of the house"
    )


def has_roofed_rest(all_points: np.ndarray, is_low: np.ndarray, outline: shapely.Polygon) -> bool:
    """Return whether points above the ground cover most of what is left.

    That is the outline without its bare ground. It tells a block around a wide yard from heaps and
    trees on a cleared site.
    """
    if is_low.all():
        return False
    bare_ground = find_bare_ground(outline, all_points[~is_low], all_points[is_low])
    if bare_ground is None or bare_ground.outline is None:
        return False
    mask = find_inside(bare_ground.outline, all_points[:, 0], all_points[:, 1])
    return bool(mask.any()) and cover(all_points[mask], ~is_low[mask]) >= ROOFED


def fit_plane_around(
    outline: shapely.Polygon, frame: LocalFrame, terrain: Terrain
) -> np.ndarray | None:
    """Fit the plane of the ground around the outline, in the local frame.

    The terrain's known heights count, without guesses.
    """

    def height_at(xy: np.ndarray) -> np.ndarray:
        xy = frame.to_world(xy)
        heights = (
            terrain.find_known_heights(xy, FEWEST_PLACES)
            if isinstance(terrain, TerrainChain)
            else terrain.height_at(xy)
        )
        return heights - frame.origin[2]

    return ground_plane(outline, height_at)


def cut_bare_ground(
    points: np.ndarray,
    outline: shapely.Polygon,
    ground: np.ndarray,
    settings: Settings,
    upper: np.ndarray,
) -> Site:
    """Cut the bare ground among `ground` (m, 3) from points and outline.

    Where it is roofed over it stays, with a remark. `upper` (k, 3) are the points that lie above
    it.
    """
    bare_ground = find_bare_ground(outline, upper, ground) if len(ground) else None
    if bare_ground is None:
        return Site(points, outline)
    area = f"{bare_ground.area_m2:.0f} m2 {Doubt.BARE_GROUND_INSIDE.value}"
    if bare_ground.outline is None or settings.reconstruct.footprint_trust == "full":
        advice = "" if bare_ground.outline is None else "; --footprint-trust points cuts it out"
        return Site(points, outline, f"{area} is roofed over{advice}", is_doubtful=True)
    inside = find_inside(bare_ground.outline, points[:, 0], points[:, 1])
    if not inside.any():
        return Site(points, outline, f"{area} is roofed over", is_doubtful=True)
    return Site(points.compress(inside, axis=0), bare_ground.outline, f"{area} was cut out")
