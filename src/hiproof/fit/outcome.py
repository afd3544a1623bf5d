"""Describe the outcome of fitting a building."""

from __future__ import annotations

from dataclasses import dataclass

import shapely

from ..model import Part


@dataclass(frozen=True)
class BuildingFit:
    """The outcome of `fit_building`, in the frame of the given points.

    `roof_parts` cover `outline` and may overlap: the roof is their max. `objective` is in points,
    `points_used` is the number of points inside the outline that counted, and `unexplained` the
    share of them further than the tolerance from the roof.
    """

    roof_parts: tuple[Part, ...]
    outline: shapely.Polygon
    objective: float
    points_used: int
    unexplained: float
