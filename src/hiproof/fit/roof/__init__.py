"""Fit the roof of a building: one state, one price, one loop.

A roof is four small tables (lines, unknowns, planes, volumes) that share what is equal. Its price
is the misfit of every point and what its exact drawing costs. Moves propose, `accept` judges.

tables      the state
prices      the table of prices
draw        compiled: the exact plan of a roof, its corners and low steps
price       compiled: the price of a roof in a box, and the fit of its unknowns
moves       compiled: moves of a roof, which propose and do not judge
accept      compiled: the one place that judges, and the loop
site        what a roof has to explain: points, cells, the outline and its lines
start       the tables of the volumes that the search found
deviations  compiled: how well points determine unknowns and sides
regions     which polygons each volume roofs
names       from volumes to named parts of the family of roof shapes
"""

from __future__ import annotations

import numpy as np
import shapely

from ...model import Part
from ...settings import Settings
from ..union import fit_by
from ..union.fit import BuildingFit
from ..union.names import name_planes
from ..union.objective import is_base_visible
from ..union.plan import Plan
from ..union.scene import Scene
from ..union.sides import choose_sides
from ..union.unite import gather_ends
from .accept import improve
from .beside import estimate_shift
from .deviations import estimate_covariance, estimate_side_sigmas, find_anchored
from .draw import draw_whole_roof, make_drawing
from .names import cut_sides, find_axes, read_planes, read_sides
from .price import Site, price_roof
from .prices import UNKNOWN_UNITS, compute_unit
from .regions import list_places
from .site import make_site
from .start import make_roof
from .tables import Tables, copy_tables, make_tables_like

__all__ = ["BuildingFit", "fit_building"]


def fit_building(
    points_local: np.ndarray,
    outline: shapely.Polygon | None = None,
    settings: Settings | None = None,
) -> BuildingFit:
    """Fit the roof of one building, with the arguments, errors and outcome of the fit in use.

    >>> x, y = np.meshgrid(np.arange(0.2, 12, 0.4), np.arange(0.2, 7, 0.4))
    >>> z = np.where(x < 8, 8 - 0.9 * abs(y - 3.5), 3.0)
    >>> roof = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    >>> fit = fit_building(roof, shapely.box(0, 0, 12, 7))
    >>> sorted(part.type for part in fit.roof_parts), fit.unexplained
    (['flat', 'gable'], 0.0)
    """
    return fit_by(name_volumes, points_local, outline, settings or Settings())


def name_volumes(
    volumes: np.ndarray, outline: shapely.Polygon, plan: Plan, scene: Scene, settings: Settings
) -> list[Part]:
    """Draw the search's volumes, improve them until no move saves, and name them as parts."""
    plan_outline = shapely.transform(outline, plan.frame.uv_plan)
    unit = compute_unit(plan.density, settings.compound)
    site = make_site(scene, plan_outline, unit, plan.border)
    roof = start_roof(volumes, outline, plan, scene)
    roof, site = improve_beside(roof, site)
    return read_parts(roof, site, plan_outline, plan, settings.fit.types)


def improve_beside(roof: Tables, site: Site) -> tuple[Tables, Site]:
    """Improve a roof, also with its points moved to where its eaves are level, if that is cheaper.

    Returns the roof and the site that it explains.
    """
    trial, drawing = make_tables_like(roof), make_drawing(len(roof.sides))
    improve(roof, trial, site, drawing)
    shift = estimate_shift(roof, site)
    if not shift.any():
        return roof, site
    moved = site._replace(x=site.x - shift[0], y=site.y - shift[1])
    other = make_tables_like(roof)
    copy_tables(roof, other)
    improve(other, trial, moved, drawing)
    cost = price_roof(other, drawing, moved) + 2 * UNKNOWN_UNITS * site.unit
    return (other, moved) if cost < price_roof(roof, drawing, site) else (roof, site)


def start_roof(volumes: np.ndarray, outline: shapely.Polygon, plan: Plan, scene: Scene) -> Tables:
    """Return the tables of the search's volumes along walls."""
    sides = choose_sides(volumes, gather_ends(outline, plan, scene).lines, scene)
    return make_roof(volumes, sides, scene.turn, is_base_visible(volumes, scene))


def read_parts(
    roof: Tables, site: Site, outline: shapely.Polygon, plan: Plan, types: tuple[str, ...]
) -> list[Part]:
    """Name what each volume roofs of an `outline` in the plan's coordinates."""
    covariance, is_anchored = estimate_covariance(roof, site), find_anchored(roof, site)
    inner, outer, parts = make_tables_like(roof), make_tables_like(roof), []
    for k, polygons, is_cut in list_places(roof, draw_whole_roof(roof, site), outline):
        axes = find_axes(roof, k)
        anchored = is_anchored[np.abs(roof.sides[k]) - 1]
        sigmas = estimate_side_sigmas(roof, inner, outer, site, k, anchored)
        sides = read_sides(roof, k, axes, anchored, sigmas)
        if is_cut:
            sides = cut_sides(sides, shapely.get_coordinates(polygons) @ axes.T)
        planes = read_planes(roof, k, axes, covariance)
        local = [shapely.transform(polygon, plan.frame.xy_local) for polygon in polygons]
        local_axes = axes @ plan.frame.rotation
        parts.append(name_planes(planes, sides, local_axes, local, plan.frame, types))
    return parts
