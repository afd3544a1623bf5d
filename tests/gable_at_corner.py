"""Points of a gable of 12 by 8 m at a corner in the Netherlands, and level terrain below it."""

import numpy as np
import shapely

from tiny_town import gable

CORNER = np.array([85000.0, 446000.0])
FOOTPRINT = shapely.box(*CORNER, *(CORNER + [12, 8]))


class LevelSite:
    """Level terrain at -1 m."""

    source = "level"

    def height_at(self, xy):
        return np.full(len(xy), -1.0)


def gable_height(xy):
    """Height of the gable at places (n, 2) about CORNER."""
    return gable(xy[:, 0], xy[:, 1], 8.0, 12.0, 5.0, 3.0)


def scan_gable(annex=False):
    """900 points of the gable, with a lower flat half where it has an annex."""
    rng = np.random.default_rng(100)
    xy = rng.uniform((0, 0), (12, 8), (900, 2))
    z = np.where(annex & (xy[:, 0] < 5), 3.0, gable_height(xy)) + rng.normal(0, 0.03, len(xy))
    return np.column_stack([xy + CORNER, z])
