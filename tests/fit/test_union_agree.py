"""Check that what volumes have in common is equal in the model, and nothing else.

A house that bends ends its wings on one line.
"""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from hiproof.fit.union import clusters, fit_building
from hiproof.fit.union.agree import agree_planes
from hiproof.fit.union.allowed import list_allowed_shapes
from hiproof.fit.union.finish import (
    find_visible_points,
    fit_design,
    read_volume_planes,
    take_points,
)
from hiproof.fit.union.plan import lay_out_plan
from hiproof.fit.union.risen import measure_misfits, restore_risen_planes
from hiproof.fit.union.scene import make_scene
from hiproof.fit.union.sides import Side
from hiproof.fit.union.volumes import LEVEL, N_PLANES, OFFSET0, SLOPE0, U0, V1, make_base
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


def test_planes_that_fall_from_their_eaves_are_never_taken(monkeypatch):
    """Without a proper common fit, the wings keep their own planes.

    They took any planes before, and pitches became negative.
    """
    fit = fit_building(sample_heights(make_wings(0.0), L_SHAPE, 3.0, 0.05), L_SHAPE)
    lower, upper = list_ridge_heights(fit)
    assert upper - lower < 1e-4
    monkeypatch.setattr(clusters, "is_proper", lambda *_: False)
    lower, upper = list_ridge_heights(
        fit_building(sample_heights(make_wings(0.0), L_SHAPE, 3.0, 0.05), L_SHAPE)
    )
    assert upper - lower > 1e-3
    assert (lower, upper) == pytest.approx((8.0, 8.0), abs=0.15)


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


def test_a_hidden_volume_does_not_rise_above_those_that_explain_the_points():
    """Of a church, the gable over a third of the nave rose above the other's points."""
    outline = shapely.box(0.0, 0.0, 20.0, 8.0)
    points = sample_heights(lambda x, y: 5.0 + 0.0 * x, outline, 5.0, 0.02)
    plan = lay_out_plan(points, outline)
    scene = make_scene(plan, outline, [0.0], 3.0, 0.2, list_allowed_shapes(()))
    volumes = np.repeat(make_base(5.0 - plan.frame.origin[2]), 3, axis=0)
    volumes[0, OFFSET0 + LEVEL] -= 9.0
    volumes[1, OFFSET0 + LEVEL] -= 0.01  # over all of it, hidden
    result = [read_volume_planes(volume, scene) for volume in volumes]
    risen = replace(result[1], rows=result[1].rows + [0.0, 0.0, 0.4])
    with_risen = [result[0], risen, result[2]]
    assert measure_misfits(volumes, with_risen, scene)[0].sum() > 0.5 * scene.n
    _, misfits = restore_risen_planes(volumes, with_risen, scene)
    assert np.array_equal(misfits, measure_misfits(volumes, result, scene)[0])
    shifted = replace(result[2], rows=result[2].rows + [0.0, 0.0, 0.02])
    planes, _ = restore_risen_planes(volumes, [*result[:2], shifted], scene)
    assert planes[2] is shifted


@pytest.mark.parametrize(("bend", "n_planes"), [(0.0, 1), (0.25, 2)])
def test_planes_that_face_a_degree_apart_are_one_where_the_points_are(bend, n_planes):
    outline = shapely.box(0.0, 0.0, 20.0, 8.0)
    points = sample_heights(
        lambda x, y: 5.0 + 0.6 * y + bend * (x > 12.0) * (x - 12.0), outline, 5.0, 0.02
    )
    plan = lay_out_plan(points, outline)
    scene = make_scene(plan, outline, [0.0], 3.0, 0.2, list_allowed_shapes(()))
    volumes = np.repeat(make_base(-9.0), 3, axis=0)
    volumes[1:, OFFSET0 : OFFSET0 + N_PLANES] = np.inf
    volumes[1:, U0 : V1 + 1] = (-4, 4, -2, 10), (-4, 4, -10, -2)  # u is y - 4, and v is 10 - x
    volumes[1:, OFFSET0], volumes[1:, SLOPE0] = 7.4 - plan.frame.origin[2], 0.6
    planes = [read_volume_planes(volume, scene) for volume in volumes]
    for k, lean in ((1, 0.0), (2, 0.02)):  # the planes rise from the left
        design = np.zeros((5, 3, 2))
        design[0] = [[0.0, 1.0], [0.0, lean], [1.0, 0.0]]
        own = take_points(volumes[k], find_visible_points(volumes, scene)[k], scene)
        planes[k] = fit_design(planes[k], design, own, scene)
    sides = [[Side(float(x)) for x in row[U0 : V1 + 1]] for row in volumes]
    first, second = (one.rows[0] for one in agree_planes(volumes, sides, planes, scene).planes[1:])
    assert len({tuple(np.round(rows, 9)) for rows in (first, second)}) == n_planes
