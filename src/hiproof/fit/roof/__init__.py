"""Fit the roof of a building: one state, one price, one loop.

A roof is four small tables (lines, unknowns, planes, volumes) that share what is equal. Its price
is the misfit of every point and what its exact drawing costs. Moves propose, `accept` judges.

tables      the state
draw        compiled: the exact plan of a roof, and its corners
steps       compiled: what its steps cost
price       compiled: the price of a roof in a box, and the fit of its unknowns
ends        compiled: where the points say that a volume ends
moves       compiled: moves of a roof, which propose and do not judge
accept      compiled: the one place that judges, and the loop
site        what a roof has to explain: points, cells, the outline and its lines
draft       a roof that is being improved, and what is known of it
start       the level roof of a block, and the tables of further volumes
copies      compiled: volumes copied along a side to where points are unexplained
add         volumes added where points are unexplained
grow        a roof grown block by block, and each volume grown anew
deviations  compiled: how well points determine unknowns and sides
regions     which polygons each volume roofs
names       from volumes to planes and sides by place
parts       from these to named parts of the family of roof shapes
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from ...errors import FitError
from ...model import Part, Piece, as_xyz
from ...primitives.catalogue import CATALOGUE, CURVED
from ...primitives.family import name_among
from ...read.plausible import is_plausible
from ...settings import Settings
from ..layout.depth import VISIBLE_DEPTH_M
from ..layout.outline import draw_outline
from ..layout.plan import Plan, lay_out_plan
from ..layout.whole import Whole, lay_out_whole
from ..outcome import BuildingFit
from ..shapes.curved import fit_shapes
from ..shapes.regions import exclude_parts, list_polygons
from ..shapes.shown import find_highest, keep_visible
from ..shapes.teeth import unite_saw_teeth
from .deviations import estimate_covariance, estimate_side_sigmas, find_anchored
from .draw import draw_whole_roof
from .grow import find_roof
from .names import cut_sides, find_axes, read_planes, read_sides
from .parts import name_planes
from .price import Site
from .regions import list_places
from .tables import Tables, make_tables_like

__all__ = ["BuildingFit", "fit_building"]


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
    points_local = as_xyz(points_local)
    points_local = points_local[is_plausible(points_local)]
    outline = draw_outline(points_local) if outline is None else outline
    outline = select_largest_polygon(outline)
    plan = lay_out_plan(points_local, outline)
    if plan.uvz.shape[1] == 0:
        raise FitError(
            "expected roof points inside the outline, got none; "
            "add a cloud that covers the building"
        )
    settings = settings or Settings()
    types = settings.fit.types
    whole = lay_out_whole(plan, outline, settings.compound, types)
    xy = plan.frame.xy_local(whole.raster.list_nodes(VISIBLE_DEPTH_M).T)
    drawn, price = draw_parts(whole, settings)
    visible = keep_visible(drawn, xy)
    has_teeth = not types or "shed" in types
    parts = unite_saw_teeth(visible) if has_teeth else visible
    parts = fit_shapes(parts, plan.points, outline, settings)
    parts = [restrict_type(part, types, points_local) for part in parts]
    if exclude_parts(parts, visible):  # new ones may hide others
        parts = keep_visible(parts, xy, widest_m2=0.0)
    unexplained = measure_unexplained_share(parts, plan, settings.compound.tolerance_m)
    return BuildingFit(tuple(parts), outline, price, plan.uvz.shape[1], unexplained)


def draw_parts(whole: Whole, settings: Settings) -> tuple[list[Part], float]:
    """Find the roof of a building, and name its parts.

    Returns the parts, and the price (points) of the drawn roof.
    """
    types = settings.fit.types
    keeps_shapes = bool(types) and not {*CATALOGUE} <= {*types, *CURVED}
    draft = find_roof(whole, keeps_shapes)
    return read_parts(draft.roof, draft.site, whole.outline, whole.plan, types), draft.price


def read_parts(
    roof: Tables, site: Site, outline: shapely.Polygon, plan: Plan, types: tuple[str, ...]
) -> list[Part]:
    """Name what each volume roofs of an `outline` in the plan's coordinates."""
    (free, covariance), is_anchored = estimate_covariance(roof, site), find_anchored(roof, site)
    inner, outer, parts = make_tables_like(roof), make_tables_like(roof), []
    for k, polygons, numbers, is_cut in list_places(roof, draw_whole_roof(roof, site), outline):
        axes = find_axes(roof, k, numbers)
        anchored = is_anchored[np.abs(roof.sides[k]) - 1]
        sigmas = estimate_side_sigmas(roof, inner, outer, site, k, anchored)
        sides = read_sides(roof, k, axes, anchored, sigmas)
        if is_cut:
            sides = cut_sides(sides, shapely.get_coordinates(polygons), axes, outline)
        planes = read_planes(free, k, numbers, axes, covariance)
        local = [shapely.transform(polygon, plan.frame.xy_local) for polygon in polygons]
        local_axes = axes @ plan.frame.rotation
        parts.append(name_planes(planes, sides, local_axes, local, plan.frame, types))
    return parts


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
    xy = plan.frame.xy_local(plan.uvz[:2].T)
    z, _ = find_highest(parts, xy)
    return float(np.mean(np.abs(z - plan.frame.origin[2] - plan.uvz[2]) > tolerance_m))


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
