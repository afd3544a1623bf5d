"""The outcome of a compound fit."""

from __future__ import annotations

from dataclasses import dataclass, field

import shapely

from ...model import Part


@dataclass(frozen=True)
class CompoundFit:
    """Outcome of `fit_building`, in the frame of the points given.

    `roof_parts` cover `outline`, disjoint in plan or, where wings cross, overlapping; `objective` is in points (see the package), `types` posterior
    probabilities where one primitive explains the roof, `points_used` the points inside the outline that counted,
    `unexplained` the share of them further than the tolerance from the roof.
    """

    roof_parts: tuple[Part, ...]
    outline: shapely.Polygon
    objective: float
    points_used: int
    unexplained: float
    types: dict[str, float] = field(default_factory=dict)
