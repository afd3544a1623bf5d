"""Check that equal dormers in a row are found from one, and nothing else repeats."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from hiproof.fit.union.allowed import list_allowed_shapes
from hiproof.fit.union.plan import lay_out_plan
from hiproof.fit.union.repeats import move_volume, repeat_volumes
from hiproof.fit.union.scene import make_scene
from hiproof.fit.union.volumes import (
    DIRECTION,
    LEVEL,
    OFFSET0,
    SLOPE0,
    U0,
    UNSORTED,
    V1,
    compute_roof_heights,
    make_base,
)
from points_of_roofs import sample_heights
from union_scenes import draw_volume

OUTLINE = shapely.box(-12, -5, 12, 5)
WIDE_M, DORMERS = 1.6, (-9.0, -5.6, -2.2, 1.2, 4.6, 8.0)  # m: where each begins along the eave


def make_height(dormers):
    """Return the heights of a monopitch with flat dormers at its lower side."""

    def height(x, y):
        z = 4.0 + 0.6 * (y + 5.0)
        for x0 in dormers:
            z = np.where((x0 < x) & (x < x0 + WIDE_M) & (y < -2.0), np.maximum(z, 6.5), z)
        return z

    return height


def make_volumes(base_m):
    """Return the monopitch and the first dormer over a base far below.

    Heights are over `base_m`. The plan's u is y, its v is -x: the longer side of the outline lies
    along v.
    """
    volumes = np.repeat(make_base(-50.0), 3, axis=0)
    volumes[1, U0 : V1 + 1] = -5.0, 5.0, -12.0, 12.0
    volumes[1, OFFSET0 + LEVEL] = np.inf
    volumes[1, [OFFSET0, SLOPE0]] = 7.0 - base_m, 0.6
    volumes[2, U0 : V1 + 1] = -5.0, -2.0, -DORMERS[0] - WIDE_M, -DORMERS[0]
    volumes[2, OFFSET0 + LEVEL] = 6.5 - base_m
    return volumes


@pytest.mark.parametrize("dormers", [DORMERS, DORMERS[:1], (DORMERS[0], DORMERS[4])])
def test_each_dormer_of_a_row_is_found_from_one_of_them(dormers):
    points = sample_heights(make_height(dormers), OUTLINE, 4.0, 0.02)
    plan = lay_out_plan(points, OUTLINE)
    scene = make_scene(plan, OUTLINE, [0.0], 3.0, 0.2, list_allowed_shapes(()))
    result = repeat_volumes(make_volumes(plan.frame.origin[2]), scene)
    begins = np.sort(-result[2:, V1])
    assert begins == pytest.approx(dormers, abs=0.5)  # points are half a metre apart


@pytest.mark.parametrize("count", [5, 6, 7])
def test_few_points_beside_a_block_add_no_more_than_one_copy(count):
    """Check that copies end where the edges of one would move past the points that called for it.

    Copies of such a place once went on for ever.
    """
    block, box, outline = [8.0, 12.0, 0.0, 8.0], [1.0, 3.0, 0.0, 3.0], shapely.box(0, 0, 16, 8)

    def height(x, y):
        boxes = np.where((x > 1) & (x < 3) & (y < 3), 6.0, 5.0)
        return np.where((x > 8) & (x < 12), 9.0, boxes)

    points = sample_heights(height, outline, 4.0, 0.02)
    beside = (points[:, 0] > 7.6) & (points[:, 0] < 8.0) & (points[:, 1] < 3.0)
    few = np.column_stack([np.full(count, 7.85), np.linspace(0.3, 2.7, count), np.full(count, 6.0)])
    few[:, 0] += np.linspace(-0.14, 0.14, count)
    points = np.vstack([points[~beside], few])
    plan = lay_out_plan(points, outline)
    origin = plan.frame.origin
    volumes = np.repeat(make_base(5.0 - origin[2]), 3, axis=0)
    for row, (x0, x1, y0, y1), z in zip(volumes[1:], (block, box), (9.0, 6.0), strict=True):
        ends = (np.array([[x0, y0], [x1, y1]]) - origin[:2]) @ plan.frame.rotation.T
        row[U0 : V1 + 1] = np.sort(ends, axis=0).T.ravel()
        row[OFFSET0 + LEVEL] = z - origin[2]
    scene = make_scene(plan, outline, [0.0], 3.0, 0.2, list_allowed_shapes(()))
    assert len(repeat_volumes(volumes, scene)) <= 4


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0, 1]), st.floats(-20.0, 20.0))
def test_a_moved_volume_is_as_high_at_moved_places(seed, axis, step_m):
    rng = np.random.default_rng(seed)
    volume = draw_volume(rng, replacing=0.0)
    volume[DIRECTION] = 0.0
    u, v = rng.uniform(-9.0, 9.0, (2, 1, 200))
    moved = move_volume(volume, axis, step_m)[None]
    shifted = (u + step_m, v) if axis == 0 else (u, v + step_m)
    original, changed_state = (
        compute_roof_heights(volume[None], u, v, UNSORTED)[0],
        compute_roof_heights(moved, *shifted, UNSORTED)[0],
    )
    assert changed_state == pytest.approx(original, abs=1e-6)
