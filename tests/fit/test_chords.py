"""Between the corners of a convex outline, every line is a chord."""

import math

import numpy as np
import pytest
import shapely

from hiproof.fit.union.plan import lay_out_plan
from hiproof.fit.union.sides import list_chords
from hiproof.geometry.rings import is_convex


@pytest.mark.parametrize("corners", [4, 5, 9])
def test_chords_of_a_convex_outline_are_those_within_its_surroundings(corners):
    turns = 2.0 * math.pi * np.arange(corners) / corners
    outline = shapely.Polygon(np.column_stack([6.0 * np.cos(turns), 5.0 * np.sin(turns)]))
    notched = outline - shapely.box(4.0, -0.01, 9.0, 0.01)
    x, y = np.random.default_rng(0).uniform(-6.0, 6.0, (2, 300))
    plan = lay_out_plan(np.column_stack([x, y, 5.0 + 0.1 * x]), outline)
    assert is_convex(outline) and not is_convex(notched)
    assert list_chords(outline, plan).shape == (2, corners * (corners - 1) // 2, 2)
    assert not is_convex(outline - outline.centroid.buffer(1.0))
