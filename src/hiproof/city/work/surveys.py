"""The points of a building in a work tile, of the surveys of which its model is made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...read.terrain.raster import RasterTerrain
from ..plan.work_plan import WorkPlan
from .solve import Surroundings
from .sort import POINT_KINDS, load_points


@dataclass
class SurveyPoints:
    """The points of some surveys in a work tile, by name, alone and together.

    `points` (n, 3) are those of each survey by kind, the newest first.
    """

    points: dict[str, dict[str, np.ndarray]]
    terrain: RasterTerrain | None
    plan: WorkPlan
    views: dict[tuple[str, ...], Surroundings] = field(default_factory=dict)

    @staticmethod
    def load(
        root: Path,
        tile: str,
        terrain: RasterTerrain | None,
        shifts: dict[str, np.ndarray],
        plan: WorkPlan,
    ) -> SurveyPoints:
        """Load the points of surveys, and take off the shift (3,) of each."""
        points = {
            name: {kind: xyz - shift for kind, xyz in load_points(root, tile, name).items()}
            for name, shift in shifts.items()
        }
        return SurveyPoints(points, terrain, plan)

    def unite(self, names: tuple[str, ...]) -> Surroundings:
        """Return the points of some surveys together."""
        if names not in self.views:
            united = {
                kind: np.concatenate([self.points[name][kind] for name in names])
                for kind in POINT_KINDS
            }
            self.views[names] = Surroundings(united, self.terrain, self.plan)
        return self.views[names]

    def choose(self, record: Mapping[str, Any]) -> Surroundings:
        """Return the points of the surveys that a building's object names, or of the newest."""
        used = record.get("epochs_used") or ()
        names = tuple(name for name in self.points if name in used)
        return self.unite(names or tuple(self.points)[:1])
