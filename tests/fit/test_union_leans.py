"""Laws of planes that face walls which are not quite along the axes."""

import math

import numpy as np
import pytest
import shapely

from hiproof.fit.union import fit_building
from hiproof.fit.union.around import look_around
from hiproof.fit.union.facings import face_walls, turn_plane
from hiproof.fit.union.objective import objective
from hiproof.fit.union.scene import MOST_LEAN, leans_along
from hiproof.fit.union.volumes import LEAN, OFFSET, SIDES, coefficients, lowest_plane
from hiproof.model import Roof
from roof_zoo import FRAME
from union_scenes import random_scene, random_volumes


def wedge(skew):
    """A plan 12 m long whose two long walls are 8 m apart on the left and come closer by `skew` (tangent each)."""
    return shapely.Polygon([(0, -4), (12, -4 + 12 * skew), (12, 4 - 12 * skew), (0, 4)])


def wedge_roof(skew, pitch, rng, density=6.0):
    """Points of a gable over it, each slope square to its wall from an eave 5 m high, noise 2 cm."""
    outline = wedge(skew)
    x0, y0, x1, y1 = outline.bounds
    xy = rng.uniform((x0, y0), (x1, y1), (int(density * (x1 - x0) * (y1 - y0)), 2))
    xy = xy[shapely.contains_xy(outline, *xy.T)]
    inwards = [(s * xy[:, 1] + 4 - skew * xy[:, 0]) / math.hypot(1.0, skew) for s in (1.0, -1.0)]
    z = 5.0 + pitch * np.minimum(*inwards)
    return outline, np.column_stack([xy, z + rng.normal(0.0, 0.02, len(xy))]), z


@pytest.mark.parametrize("skew", [0.0, 0.05, 0.1, 0.18])
@pytest.mark.parametrize("pitch", [0.6, 1.2])
def test_a_gable_over_walls_that_run_together_is_one_part(skew, pitch):
    outline, points, z = wedge_roof(skew, pitch, np.random.default_rng(4))
    fit = fit_building(points, outline)
    assert len(fit.roof_parts) == 1
    roof = Roof(fit.roof_parts, outline, FRAME)
    inner = shapely.contains_xy(outline.buffer(-0.2), *points[:, :2].T)
    assert np.abs(roof.height_at(points[inner, :2]) - z[inner]).max() < 0.15


def test_slopes_that_face_neither_wall_nor_each_other_are_one_gable():
    outline = shapely.Polygon([(-6, -7), (6, -6), (7.5, 7.5), (-6.8, 6.5)])
    rng = np.random.default_rng(2)
    xy = rng.uniform(-8, 8, (2000, 2))
    xy = xy[shapely.contains_xy(outline, *xy.T)]
    facing = [np.radians(5.0), np.radians(180.0 - 2.5)]
    z = 9.0 - 0.5 * np.max([xy @ (math.cos(angle), math.sin(angle)) for angle in facing], axis=0)
    fit = fit_building(np.column_stack([xy, z + rng.normal(0.0, 0.02, len(xy))]), outline)
    assert len(fit.roof_parts) == 1
    inner = shapely.contains_xy(outline.buffer(-0.3), *xy.T)
    assert np.abs(Roof(fit.roof_parts, outline, FRAME).height_at(xy[inner]) - z[inner]).max() < 0.15


@pytest.mark.parametrize("seed", range(6))
def test_facing_walls_never_costs(seed):
    rng = np.random.default_rng(seed)
    volumes, scene = random_volumes(rng), random_scene(rng)

    value = objective(volumes, scene, np.inf)
    for k in range(1, len(volumes)):
        found, lower = face_walls(volumes.copy(), scene, value, k, look_around(volumes, scene.U, scene.V, k))
        assert lower <= value
        assert objective(found, scene, np.inf) == pytest.approx(lower, rel=1e-9)
        assert np.isfinite(found[:, LEAN : LEAN + SIDES]).all()


# The later seeds lost planes, to a wall that was none.
@pytest.mark.parametrize("seed", [0, 1, 2, 68, 101, 281, 314, 360, 396, 399])
def test_facing_walls_takes_no_plane_away(seed):
    rng = np.random.default_rng(seed)
    volumes, scene = random_volumes(rng), random_scene(rng)
    scene = scene._replace(leans=np.where(np.arange(scene.leans.shape[2]) == 0, 0.1, np.full_like(scene.leans, np.inf)))
    for k in range(1, len(volumes)):
        found, _ = face_walls(
            volumes.copy(), scene, objective(volumes, scene, np.inf), k, look_around(volumes, scene.U, scene.V, k)
        )
        kept, given = (np.isfinite(rows[k, OFFSET : OFFSET + SIDES]) for rows in (found, volumes))
        assert (kept == given).all()
        assert np.isfinite(found[:, LEAN : LEAN + SIDES]).all()


@pytest.mark.parametrize("seed", range(6))
def test_a_turned_plane_keeps_its_height_where_it_is_turned(seed):
    rng = np.random.default_rng(seed)
    row = random_volumes(rng)[-1]
    for plane in np.nonzero(np.isfinite(row[OFFSET : OFFSET + SIDES]))[0]:
        alone = row.copy()
        alone[OFFSET : OFFSET + SIDES + 1] = np.inf
        alone[OFFSET + plane] = row[OFFSET + plane]
        middle, before = rng.uniform(-3.0, 3.0, 2), alone.copy()
        turn_plane(alone, plane, 0.2, middle)
        assert alone[LEAN + plane] == 0.2
        heights = [lowest_plane(coefficients(own[None], 0), *middle)[0] for own in (before, alone)]
        assert heights[0] == pytest.approx(heights[1], abs=1e-9)


def test_walls_are_those_near_an_axis_but_not_along_it():
    ring = np.array([(0, 0), (10, 0), (9, 8), (4, 8.2), (1, 8)], float)
    assert leans_along(ring, 0) == pytest.approx([1 / 8, -1 / 8], abs=1e-9) or leans_along(ring, 0) == pytest.approx(
        [-1 / 8, 1 / 8], abs=1e-9
    )
    assert leans_along(ring, 1) == pytest.approx([-0.2 / 5, 0.2 / 3], abs=1e-9)
    assert leans_along(np.array([(0, 0), (5, 0), (5, 4), (0, 4)], float), 0) == []
    assert leans_along(np.array([(0, 0), (8, 0), (8 - 4 * 2 * MOST_LEAN, 4), (0, 4)], float), 0) == []
