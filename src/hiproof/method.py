"""One building, from points to a valid solid: the paper's steps, one line each."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely

from .frames import LocalFrame
from .model import Building, Footprint, Roof, as_xyz
from .settings import Settings
from .stages.arguments import refuse_other_kinds, refuse_without_network
from .stages.fit import fit
from .stages.footprint import align_footprint, start_building
from .stages.ground import find_ground, look_at_ground
from .stages.judge import judge
from .stages.outline import to_local
from .stages.points import drop_neighbour_roofs, usable
from .stages.recognise import recognise
from .stages.remarks import add_finding, add_remark
from .stages.solid import (
    add_installations,
    add_overhangs,
    open_passages,
    reach_terrain,
    solid_or_simpler,
)
from .status import Status

if TYPE_CHECKING:
    from .read.terrain import Terrain


def reconstruct(
    points: np.ndarray,
    footprint: shapely.Polygon | Footprint | None = None,
    terrain: Terrain | None = None,
    settings: Settings | None = None,
    id: str = "building",
    ground: np.ndarray | None = None,
    unused: np.ndarray | None = None,
    neighbours: Sequence[shapely.Polygon] = (),
) -> Building:
    """Reconstruct one building from its roof points.

    The method is that of Li, Zhang and Shan 2020, sections 3.1-3.3, with our fits.

    points: (n, 3) world coordinates in metres, in any order, facade and clutter returns allowed;
    repeated ones and those that are nowhere on Earth (not finite, 3.4e38) are dropped. footprint:
    plan polygon in the same frame, moved where points around it show clearly that it lies beside
    its roof; without one the outline is estimated. terrain: what `read_terrain` gives, or anything
    of the protocol `hiproof.Terrain`; without one the ground is assumed below the lowest point, or
    at the foot of walls that are seen. ground: (m, 3) ground points in and around the footprint, by
    which bare ground inside it is cut out (`footprint_trust`). unused: further points (m, 3) of the
    building that are not fitted, thinned out or of a noise class; the verdict on the model names
    them where they lie together off the roof. neighbours: outlines of other buildings, whose roofs
    may reach over this one, and which its own overhangs (LoD2.3) do not cross. What the data hold
    never raises: the outcome is the Building's `status`, and its `detail` says why. Raises
    InputError for points of another shape, for a footprint, a terrain or settings of another kind,
    and for settings that ask the network where the extra `network` is not installed.

    >>> x, y = np.meshgrid(np.arange(0, 10, 0.5), np.arange(0, 6, 0.5))
    >>> roof = np.column_stack([x.ravel(), y.ravel(), 5 - 0.5 * abs(y.ravel() - 2.75)])
    >>> reconstruct(roof).type
    'gable'
    """
    refuse_other_kinds(footprint, terrain, settings)
    points, settings = as_xyz(points), settings or Settings()
    refuse_without_network(settings)
    building = start_building(footprint, id)
    given, surroundings = footprint, points
    building, footprint, of_footprint = align_footprint(building, points, settings)
    points, outline, status = usable(points, footprint)
    if status is not Status.MODELLED:
        return dataclasses.replace(building, status=status, detail=status.value)
    frame = LocalFrame.around(points)
    points, outline = frame.to_local(points), to_local(outline, frame)
    site = look_at_ground(points, outline, ground, frame, terrain, settings)
    if site.is_empty:
        return dataclasses.replace(building, status=Status.NO_BUILDING, detail=site.remark)
    outline = site.outline
    points = drop_neighbour_roofs(site.points, outline, surroundings, neighbours, frame)
    recognised = recognise(points, settings)
    building = dataclasses.replace(building, recognised=recognised.types)
    fitted = fit(points, outline, recognised, settings)
    if not fitted.parts:
        return dataclasses.replace(building, status=fitted.status, detail=fitted.detail)
    roof = Roof(fitted.parts, fitted.outline, frame)
    base = find_ground(fitted.outline, points, frame, terrain, roof, settings.reconstruct.walls)
    roof, solid, fitted = solid_or_simpler(roof, points, base, fitted, settings)
    building = judge(building, roof, solid, points, fitted, base, settings, unused)
    building = reach_terrain(building, base, settings)
    building = open_passages(building, base, given)
    building = add_installations(building, points, settings)
    building = add_overhangs(building, surroundings, neighbours, settings)
    building = add_remark(building, of_footprint)
    return (add_finding if site.is_doubtful else add_remark)(building, site.remark)
