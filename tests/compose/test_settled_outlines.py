"""Check that rounded outlines of parts are valid polygons."""

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from hiproof.compose.settle import settle_outlines

GRID_M = 1e-4


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_outlines_that_cross_themselves_become_valid_ones_of_the_same_area(seed):
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 9))
    ring = rng.uniform(2, 6, 9)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    # a spike out and back that is narrower than the grid
    spike = 0.5 * (ring[0] + ring[1]) + rng.normal(0, 2.0, 2)
    ring = np.insert(ring, 1, [ring[0], spike, ring[0] + rng.normal(0, 0.4 * GRID_M, 2)], axis=0)
    outline = shapely.Polygon(ring)
    polygons = settle_outlines([outline])
    assert all(polygon.is_valid and polygon.geom_type == "Polygon" for polygon in polygons)
    area = shapely.make_valid(outline, method="structure", keep_collapsed=False).area
    assert abs(sum(polygon.area for polygon in polygons) - area) < 40 * GRID_M
    assert [p.wkb for p in settle_outlines(polygons)] == [p.wkb for p in polygons]


def test_an_outline_without_an_area_goes_where_another_stays():
    line = shapely.Polygon([(0, 0), (1, 0), (1, 1e-9)])
    assert settle_outlines([line, shapely.box(0, 0, 1, 1)]) == [shapely.box(0, 0, 1, 1)]
    assert len(settle_outlines([line])) == 1
