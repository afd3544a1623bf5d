"""The alpha shape on points whose outline is known."""

import numpy as np
import pytest
import shapely

from hiproof.errors import FitError
from hiproof.geometry.alpha_shape import alpha_shape


def slow_alpha_area(xy, radius):
    """Area of the Delaunay triangles whose circumcircle, drawn through their corners, is smaller
    than `radius`.
    """
    area = 0.0
    for triangle in shapely.get_parts(shapely.delaunay_triangles(shapely.MultiPoint(xy))):
        corners = np.array(triangle.exterior.coords)[:3]
        system = 2 * (corners[1:] - corners[0])
        centre = np.linalg.solve(system, (corners[1:] ** 2).sum(1) - (corners[0] ** 2).sum())
        if np.linalg.norm(centre - corners[0]) < radius:
            area += triangle.area
    return area


@pytest.mark.parametrize("seed", range(5))
def test_equals_the_slow_oracle(seed):
    xy = np.random.default_rng(seed).uniform(0, 10, (200, 2))
    shape = alpha_shape(xy, 2.0)
    assert shape.area == pytest.approx(slow_alpha_area(xy, 2.0), rel=1e-9)


def test_a_wide_radius_gives_the_hull():
    xy = np.random.default_rng(1).uniform(0, 10, (50, 2))
    assert alpha_shape(xy, 1e6).area == pytest.approx(shapely.MultiPoint(xy).convex_hull.area)


def test_an_l_keeps_its_bay():
    x, y = np.meshgrid(np.arange(0, 10, 0.5), np.arange(0, 10, 0.5))
    xy = np.column_stack([x.ravel(), y.ravel()])
    xy = xy[(xy[:, 0] < 4.9) | (xy[:, 1] < 4.9)]
    assert alpha_shape(xy, 1.0).area == pytest.approx(9.5 * 9.5 - 5 * 5, rel=0.02)


def test_the_larger_of_two_houses():
    rng = np.random.default_rng(0)
    xy = np.concatenate([rng.uniform(0, 10, (300, 2)), rng.uniform(20, 24, (80, 2))])
    assert 80 < alpha_shape(xy, 2.0).area < 100


@pytest.mark.parametrize(
    "xy",
    [np.zeros((1, 2)), np.zeros((5, 2)), np.ones((2, 1)) * [[1.0, 2]], np.full((4, 2), np.nan)],
)
def test_points_without_area_are_refused(xy):
    with pytest.raises(FitError, match="span an area"):
        alpha_shape(xy)


def test_a_radius_below_every_spacing_is_refused():
    with pytest.raises(FitError, match="larger"):
        alpha_shape(np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]]), 0.01)


@pytest.mark.parametrize("seed", range(4))
def test_the_shape_is_the_same_far_from_the_origin(seed):
    """At a national grid's coordinates, where doubles have steps of a nanometre."""
    xy = np.random.default_rng(seed).uniform(0.0, 12.0, (600, 2)).round(3)
    distant_origin = np.array([390_123.0, 5_656_789.0])
    first, second = alpha_shape(xy), alpha_shape(xy + distant_origin)
    assert second.area == pytest.approx(first.area, rel=1e-6)
    assert (
        shapely.transform(second, lambda corners: corners - distant_origin).hausdorff_distance(
            first
        )
        < 1e-6
    )


@pytest.mark.parametrize("holes", [True, False])
def test_a_court_is_kept_or_filled(holes):
    xy = np.stack(np.meshgrid(np.arange(0, 10.1, 0.5), np.arange(0, 10.1, 0.5)), axis=-1).reshape(
        -1, 2
    )
    xy = xy[np.abs(xy - 5.0).max(axis=1) > 2.4]
    shape = alpha_shape(xy, 1.0, holes=holes)
    assert len(shape.interiors) == holes
    # corners of the court are rounded off
    assert shape.area == pytest.approx(100 - 25 * holes, abs=2.5)
