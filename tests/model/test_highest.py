"""Check the heights of roofs at many points against those of each part."""

import numpy as np
import shapely

from hiproof.model import Part, Piece
from hiproof.model.heights import find_highest


def test_the_highest_part_is_found_at_every_point():
    rng = np.random.default_rng(3)
    corners = rng.uniform(0.0, 40.0, (30, 2))
    outlines = shapely.buffer(shapely.points(corners), rng.uniform(1.0, 20.0, 30), quad_segs=2)
    planes = rng.normal(0.0, 1.0, (30, 2, 3))
    pieces = [Piece(o, p) for o, p in zip(outlines, planes, strict=True)]
    parts = [Part("free", (piece,)) for piece in pieces]
    xy = rng.uniform(-5.0, 45.0, (5_000, 2))
    heights = np.array([part.height_at(xy) for part in parts])
    z, top = find_highest(parts, xy)
    assert np.array_equal(z, heights.max(axis=0))
    assert np.array_equal(top, heights.argmax(axis=0))
