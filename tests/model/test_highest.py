"""Check the heights of roofs at many points against those at few."""

import numpy as np
import shapely

from hiproof.model import Part, Piece
from hiproof.model.heights import MANY_PLACES, find_highest


def test_many_points_have_the_heights_of_few():
    rng = np.random.default_rng(3)
    corners = rng.uniform(0.0, 40.0, (30, 2))
    outlines = shapely.buffer(shapely.points(corners), rng.uniform(1.0, 20.0, 30), quad_segs=2)
    planes = rng.normal(0.0, 1.0, (30, 2, 3))
    pieces = [Piece(o, p) for o, p in zip(outlines, planes, strict=True)]
    parts = [Part("free", (piece,)) for piece in pieces]
    xy = rng.uniform(-5.0, 45.0, (2 * MANY_PLACES, 2))
    few = [find_highest(parts, chunk) for chunk in np.array_split(xy, 4)]
    z, top = find_highest(parts, xy)
    assert np.array_equal(z, np.concatenate([z for z, _ in few]))
    assert np.array_equal(top, np.concatenate([top for _, top in few]))
