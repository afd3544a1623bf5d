"""Fit a building's roof as a union of parametric volumes.

Structure must be worth its price in points, and all points share in the fit of the result. The roof
is

    z(x, y) = max over volumes whose rectangle contains (x, y)  of  min over its at most five planes

plan        the building's frame, the points that count, a grid, the unobserved cells
allowed     the shapes that volumes may have
scene       these in each of the building's directions, as the compiled search reads them
planes      compiled: planes and gables that explain rectangles of points
candidates  volumes made of these planes, and where each would gain most
volumes     compiled: a volume as a row of numbers, and the heights of a roof
around      compiled: the heights that the other volumes leave for one
beside      compiled: the price of the edges beside a moving volume
steps       compiled: the price of an edge of a volume that is visible
prices      the table of prices: what a unit is, what structure costs, what a change must gain
objective   compiled: the cost of a roof: misfit, volumes and visible edges
edges       compiled: moves of a volume's edges
refit       compiled: least squares for a volume's planes
moves       compiled: moves that change one volume
facings     compiled: moves that turn its planes
improve     compiled: all moves in turn
add, grow   volumes added one by one to a level base, and the first of them grown anew
trim        hidden edges drawn in
run_on      ends that stand out of a neighbour a little, moved until they are hidden in it
search      these in order, and the simplification that a draughtsman would make
large       roofs of more than 200 m2, searched in windows of bounded size
box         upright boxes in the plan's axes
whole       what windows need of a whole roof
window      the scene of a box, and how changes in it return to the roof
blocks      where a large roof is cut
block       the search of one block as a house
seams       the blocks joined again
places      further growth where points are unexplained
groups      passes after the search, on groups of neighbouring volumes
slivers     planes of which only a narrow strip is visible
apart       volumes that are visible in several places, split
gaps        volumes over gaps, split there
sides       each side on the line of the outline that it nearly follows
finish      all planes fitted to all points, with level eaves where the points allow them
cants       planes over walls that cut a volume's corners off
cut_corners one volume over such walls instead of several
unite       volumes merged that only skewed walls or cut corners keep apart
repeats     copies of small volumes along their axes, such as dormers in a row
bays        level volumes over small pieces that walls cut off the outline
risen       compiled: volumes whose fitted planes rise above others, put back
members     the volumes whose planes the points determine
clusters    members tied by equations, and the normal equations of their unknowns
conditions  planes, slopes, ridges and eaves of members that are nearly equal
aligned     planes of two volumes that may be one, faced one way
corners     hips and valleys that end beside a corner of the outline, moved into it
agree       the conditions of both that hold
drawn_plan  the plan of the drawn roof: its corners, and the planes beside its edges
repairs     what nearly meets in it and might be made to meet
faces       the faces of the drawn plan, and who may take them
weld        the repairs that pay: sides that end in corners, low steps that become fold lines,
            faces handed to the volumes beside them
regions     where each volume roofs the outline
levels      equal levels that touch, as one
names       from volumes to named parts of the family of roof shapes
teeth       rows of equal monopitches as saw-teeth
larger      gambrels combined from their parts
own         custom shapes instead of neighbouring parts
judged      roofs judged by points, with one shape in place of several parts
round_ends  cones, spires, domes, onions and half cones over round stretches of the outline
spires      how near points lie to spires
round_tops  cones, spires, domes and onions around the tops of parts
onions      onions around round parts, which may be their tops
drums       level discs over arcs of the outline and around level parts
barrels     barrel vaults over parts with slopes to two sides
bases       one level part under and around a curved shape
curved      these shapes where points follow them better
shown       hidden parts removed
clamp       heights limited to the range of the points
fit         the outcome
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import shapely

from ...errors import FitError
from ...model import Part, Piece, as_xyz
from ...primitives.family import name_among
from ...read.plausible import is_plausible
from ...settings import Settings
from .agree import agree_planes
from .apart import split_volumes
from .bays import add_bays
from .cants import Cache
from .clamp import clamp_parts
from .curved import fit_curved_shapes
from .fit import BuildingFit
from .gaps import split_at_gaps
from .groups import run_in_groups
from .larger import combine_parts
from .levels import join_levels
from .names import name_part
from .objective import is_base_visible
from .outline import draw_outline
from .own import fit_custom_shapes
from .plan import Plan, lay_out_plan
from .prices import COMMON_HOUSE_M2, LARGE_ROOF_M2, compute_unit_points
from .regions import PlanSite, exclude_parts, list_part_polygons, list_polygons
from .repeats import repeat_volumes
from .scene import Scene
from .search import find_volumes
from .shown import find_highest, keep_visible
from .slivers import drop_slivers, drop_specks
from .unite import OutlineEnds, draw_roof, gather_ends, select_ends, unite_volumes
from .weld import weld

__all__ = ["BuildingFit", "fit_building"]

NameParts = Callable[[np.ndarray, shapely.Polygon, Plan, Scene, Settings], list[Part]]
"""What makes named parts of volumes over an outline, in the plan and scene of a building."""


def fit_building(
    points_local: np.ndarray,
    outline: shapely.Polygon | None = None,
    settings: Settings | None = None,
) -> BuildingFit:
    """Fit the roof of one building to `points_local` (n, 3) over `outline`.

    Both are in metres of one local frame. Without an outline, it is estimated from the points. With
    one, points outside it do not count. Where `settings.fit.types` names types, all parts have one
    of these types or are flat.

    Raises FitError if nothing can be fitted: if no points lie inside the outline, if it has no
    area, or if the points span no area. Raises InputError for points of another shape.

    >>> x, y = np.meshgrid(np.arange(0.2, 12, 0.4), np.arange(0.2, 7, 0.4))
    >>> z = np.where(x < 8, 8 - 0.9 * abs(y - 3.5), 3.0)
    >>> roof = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    >>> fit = fit_building(roof, shapely.box(0, 0, 12, 7))
    >>> sorted(part.type for part in fit.roof_parts), fit.unexplained
    (['flat', 'gable'], 0.0)
    """
    from .. import roof as new
    return fit_by(new.name_volumes, points_local, outline, settings or Settings())


def fit_by(
    name_parts: NameParts,
    points_local: np.ndarray,
    outline: shapely.Polygon | None,
    settings: Settings,
) -> BuildingFit:
    """Fit a building as `fit_building` does, with a way to draw and name the search's volumes."""
    points_local = as_xyz(points_local)
    points_local = points_local[is_plausible(points_local)]
    outline = draw_outline(points_local) if outline is None else outline
    outline = select_largest_polygon(outline)
    plan = lay_out_plan(points_local, outline)
    if len(plan.cloud.u) == 0:
        raise FitError(
            "expected roof points inside the outline, got none; "
            "add a cloud that covers the building"
        )
    types = settings.fit.types
    volumes, value, scene = find_volumes(plan, outline, settings.compound, types)
    parts = name_parts(volumes, outline, plan, scene, settings)
    visible = keep_visible(parts, plan, scene)
    parts = fit_custom_shapes(combine_parts(visible, types), points_local, settings)
    parts = fit_curved_shapes(parts, plan.points, outline, settings)
    parts = [restrict_type(part, types, points_local) for part in parts]
    z_low, z_high = (plan.frame.origin[2] + z for z in (plan.cloud.z.min(), plan.cloud.z.max()))
    parts = clamp_parts(parts, z_low, z_high, 1.0 / math.sqrt(plan.density))
    if exclude_parts(parts, visible):  # new ones may hide others
        parts = keep_visible(parts, plan, scene, widest_m2=0.0)
    unexplained = measure_unexplained_share(parts, plan, settings.compound.tolerance_m)
    return BuildingFit(tuple(parts), outline, value, scene.n, unexplained)


def name_volumes(
    volumes: np.ndarray, outline: shapely.Polygon, plan: Plan, scene: Scene, settings: Settings
) -> list[Part]:
    """Draw the search's volumes and mend what its price does not see. Returns named parts."""
    site, ends = PlanSite(outline, plan, scene, {}), gather_ends(outline, plan, scene)
    cache: Cache = {}
    volumes = tidy_volumes(volumes, ends, site, cache)
    unit = compute_unit_points(plan.density, COMMON_HOUSE_M2, settings.compound)
    volumes = add_bays(volumes, outline, plan, scene, unit)
    roof = draw_roof(volumes, ends, scene, cache)
    agreement = agree_planes(volumes, roof.sides, roof.planes, scene)
    base = is_base_visible(volumes, scene)
    sides, planes, regions = weld(volumes, roof.sides, agreement, site, base)
    sides, regions = join_levels(volumes, sides, planes, regions, site)
    return [
        name_part(volumes[k], planes[k], sides[k], polygons, plan, scene, settings.fit.types)
        for k, polygons in list_part_polygons(regions, outline, plan)
    ]


def tidy_volumes(
    volumes: np.ndarray, ends: OutlineEnds, site: PlanSite, cache: Cache
) -> np.ndarray:
    """Drop specks and slivers, split volumes, unite, and repeat.

    Volumes visible in several places are split. Over cut corners, only volumes of houses are
    united: in large roofs it gains nothing and takes a fifth of the time.
    """
    is_house = site.outline.area <= LARGE_ROOF_M2

    def tidy(rows: np.ndarray, scene: Scene) -> np.ndarray:
        rows = drop_slivers(drop_specks(rows, scene), scene)
        rows = split_at_gaps(split_volumes(rows, scene), scene)
        is_whole = scene is site.scene
        ends_there = ends if is_whole else select_ends(ends, scene)
        roof = unite_volumes(rows, ends_there, scene, cache if is_whole else {}, is_house)
        return repeat_volumes(roof.volumes, scene)

    return run_in_groups(tidy, volumes, site)


def select_largest_polygon(outline: shapely.Geometry) -> shapely.Polygon:
    """Return the largest polygon of an outline, made valid.

    Raises FitError for an outline without area.
    """
    is_finite = math.isfinite(outline.area)
    polygons = list_polygons(shapely.make_valid(outline)) if is_finite else []
    if not polygons:
        raise FitError(
            f"expected an outline with an area, got a {outline.geom_type} without; give a polygon"
        )
    return max(polygons, key=lambda polygon: polygon.area)


def measure_unexplained_share(parts: list[Part], plan: Plan, tolerance_m: float) -> float:
    """Return the share of points further than `tolerance_m` from the highest part."""
    xy = plan.frame.xy_local(np.column_stack([plan.cloud.u, plan.cloud.v]))
    z, _ = find_highest(parts, xy)
    return float(np.mean(np.abs(z - plan.frame.origin[2] - plan.cloud.z) > tolerance_m))


def restrict_type(part: Part, types: tuple[str, ...], points: np.ndarray) -> Part:
    """Return the part, or a flat one if its type is none of `types`.

    The flat part lies at the median height of its `points` (n, 3).
    """
    if name_among(part.type, types) or part.type == "flat":
        return part
    inside = np.any(
        [shapely.contains_xy(p.outline, points[:, 0], points[:, 1]) for p in part.pieces], axis=0
    )
    z = points[inside, 2] if inside.any() else np.array([part.translation[2]])
    level = np.array([[0.0, 0.0, float(np.sort(z)[len(z) // 2])]])
    pieces = tuple(Piece(outline, level) for outline in part.outlines)
    size: dict[str, float] = {
        name: part.parameters[name] for name in ("width", "length") if name in part.parameters
    }
    return Part("flat", pieces, size, part.kappa, np.array([*part.translation[:2], level[0, 2]]))
