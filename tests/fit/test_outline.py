"""Outlines without footprints: no inward bias, straight edges, and sentences for points that are no roof."""

import numpy as np
import pytest
import shapely

from hiproof.errors import FitError
from hiproof.fit.outline import estimate_outline, iou

L_SHAPE = shapely.Polygon([(0, 0), (16, 0), (16, 8), (7, 8), (7, 18), (0, 18)])
SHAPES = {
    "rectangle": shapely.box(0, 0, 14, 8),
    "l": L_SHAPE,
    "u": shapely.Polygon([(0, 0), (20, 0), (20, 16), (14, 16), (14, 7), (6, 7), (6, 16), (0, 16)]),
}


def points_in(outline, density, angle=0.3, seed=0):
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = outline.bounds
    xy = rng.uniform((x0, y0), (x1, y1), (int(density * (x1 - x0) * (y1 - y0)), 2))
    xy = xy[shapely.contains_xy(outline, xy[:, 0], xy[:, 1])]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return xy @ turn.T, shapely.transform(outline, lambda c: c @ turn.T)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("density", [3.0, 8.0])
def test_the_outline_is_found_without_bias_and_with_few_edges(name, density):
    xy, truth = points_in(SHAPES[name], density)
    outline = estimate_outline(xy)
    assert outline.is_valid and not outline.interiors
    assert iou(outline, truth) > 0.88
    assert outline.area == pytest.approx(truth.area, rel=0.08)
    assert len(outline.exterior.coords) - 1 <= 2 * (len(truth.exterior.coords) - 1)


def test_the_given_direction_is_that_of_the_edges():
    xy, _ = points_in(L_SHAPE, 8.0, angle=0.5)
    edges = np.diff(shapely.get_coordinates(estimate_outline(xy, kappa=0.5).exterior), axis=0)
    off = np.abs(np.angle(np.exp(4j * (np.arctan2(edges[:, 1], edges[:, 0]) - 0.5)))) / 4
    length = np.hypot(edges[:, 0], edges[:, 1])
    assert length[off < 1e-6].sum() > 0.8 * length.sum()


@pytest.mark.parametrize("xy", [np.zeros((0, 2)), np.zeros((5, 2)), np.column_stack([np.arange(6.0), np.arange(6.0)])])
def test_points_that_span_no_area_are_an_error_with_a_sentence(xy):
    with pytest.raises(FitError, match="expected points that span an area"):
        estimate_outline(xy)
