"""Check that what volumes have in common is equal in the model, and nothing else.

A house that bends ends its wings on one line.
"""

import numpy as np
import pytest
import shapely

from hiproof.fit.roof import fit_building
from hiproof.model import Roof
from points_of_roofs import sample_heights

L_SHAPE = shapely.Polygon([(0, 0), (14, 0), (14, 6), (6, 6), (6, 15), (0, 15)])


def make_wings(lower):
    """Make gables along both legs of L_SHAPE, the second `lower` than the first.

    They are equally steep and wide.
    """

    def height(x, y):
        first = np.where(y < 6.0, 8.0 - 0.8 * np.abs(y - 3.0), -np.inf)
        other = np.where(x < 6.0, 8.0 - lower - 0.8 * np.abs(x - 3.0), -np.inf)
        return np.maximum(first, other)

    return height


def list_ridge_heights(fit):
    """Return the heights of the highest point of every part with a ridge, ascending."""
    return sorted(
        float(part.translation[2] + part.parameters["height"])
        for part in fit.roof_parts
        if part.type == "gable"
    )


@pytest.mark.parametrize("seed", range(3))
def test_wings_of_one_height_have_one_ridge_height(seed):
    fit = fit_building(sample_heights(make_wings(0.0), L_SHAPE, 10.0, 0.02, seed), L_SHAPE)
    lower, upper = list_ridge_heights(fit)
    assert upper - lower < 1e-4
    assert upper == pytest.approx(8.0, abs=0.05)


@pytest.mark.parametrize("lower", [0.15, 0.4])
def test_wings_of_two_heights_keep_them(lower):
    low, upper = list_ridge_heights(
        fit_building(sample_heights(make_wings(lower), L_SHAPE, 10.0, 0.02), L_SHAPE)
    )
    assert upper - low == pytest.approx(lower, abs=0.04)


def make_bent_house(angle_deg):
    """Make the outline and height of a house that bends by an angle halfway along.

    It is 7 m wide and has one roof.
    """
    half = np.radians(0.5 * angle_deg)
    # Away from the bend, and back to it.
    along = np.array([[np.cos(half), np.sin(half)], [np.cos(half), -np.sin(half)]])
    across = np.array([[-np.sin(half), np.cos(half)], [np.sin(half), np.cos(half)]])

    def height(x, y):
        remainder = x < 0.0
        d = np.where(remainder, across[0] @ np.stack([x, y]), across[1] @ np.stack([x, y]))
        return 9.0 - 0.7 * np.abs(d)

    corner = 3.5 / np.cos(half)
    ends = -10.0 * along[0], 10.0 * along[1]
    sides = 3.5 * across[0], 3.5 * across[1]
    ring = [
        ends[0] - sides[0],
        (0, -corner),
        ends[1] - sides[1],
        ends[1] + sides[1],
        (0, corner),
        ends[0] + sides[0],
    ]
    return shapely.Polygon(ring), height


@pytest.mark.parametrize("angle", [20.0, 32.0, 44.0])
def test_a_bent_house_is_two_wings_that_meet_on_one_line(angle):
    outline, height = make_bent_house(angle)
    fit = fit_building(sample_heights(height, outline, 8.0, 0.02), outline)
    assert [part.type for part in fit.roof_parts] == ["gable", "gable"]
    xy = shapely.get_coordinates(
        shapely.intersection(outline.buffer(-0.1), shapely.MultiPoint(make_grid(outline)))
    )
    error = Roof(fit.roof_parts, fit.outline, None).height_at(xy) - height(xy[:, 0], xy[:, 1])
    assert np.abs(error).max() < 0.1


def make_grid(outline):
    x0, y0, x1, y1 = outline.bounds
    return np.stack(np.meshgrid(np.arange(x0, x1, 0.25), np.arange(y0, y1, 0.25)), axis=-1).reshape(
        -1, 2
    )
