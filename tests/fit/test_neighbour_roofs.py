"""Check that a neighbour's overhang does not become a slice of the lower house."""

import numpy as np
import pytest
import shapely
from shapely import affinity

from hiproof import reconstruct
from hiproof.fit.neighbour_roofs import find_neighbour_roofs
from hiproof.frames import LocalFrame
from hiproof.stages.points import drop_neighbour_roofs


def draw_pair(rng, density=6.0, step=None, overhang=None):
    """Draw two gables side by side, the first a step higher and over the wall between them.

    Returns points (n, 3), whether each lies on the overhang, and both outlines.
    """
    width, first, second = rng.uniform(7, 10), *rng.uniform(6, 11, 2)
    step = rng.uniform(0.8, 3.0) if step is None else step
    overhang = rng.uniform(0.3, 0.9) if overhang is None else overhang
    n = int(density * (first + second) * width)
    x, y = rng.uniform(-first, second, n), rng.uniform(0, width, n)
    z = 4.0 + np.tan(rng.uniform(0.35, 0.8)) * (width / 2 - np.abs(y - width / 2))
    z += np.where(x < overhang, step, 0.0) + rng.normal(0, 0.03, n)
    outlines = shapely.box(0, 0, second, width), shapely.box(-first, 0, 0, width)
    return np.column_stack([x, y, z]), (x >= 0) & (x < overhang), *outlines


def find_over(points, lower, higher):
    """Return the numbers of the points that lie on the higher house's overhang."""
    inside = np.flatnonzero(shapely.intersects_xy(lower, points[:, 0], points[:, 1]))
    around = points[shapely.contains_xy(higher, points[:, 0], points[:, 1])]
    return inside[find_neighbour_roofs(points[inside], lower, around, higher)]


def test_the_lower_house_of_a_stepped_terrace_keeps_one_gable():
    single = []
    for seed in range(20):
        points, _, lower, higher = draw_pair(np.random.default_rng(seed))
        single.append(len(reconstruct(points, lower, neighbours=[higher]).parts) == 1)
    assert sum(single) >= 17


def test_the_points_of_an_overhang_are_found():
    right = []
    for seed in range(20):
        points, is_over, lower, higher = draw_pair(np.random.default_rng(seed))
        found = find_over(points, lower, higher)
        # a point at the end of the overhang may be told wrong
        right.append(len(np.setxor1d(found, np.flatnonzero(is_over))) <= 0.1 * is_over.sum())
    assert sum(right) >= 17


@pytest.mark.parametrize("step", [0.0, -2.0])
@pytest.mark.parametrize("seed", range(5))
def test_no_point_is_taken_from_a_house_as_high_as_its_neighbour(step, seed):
    points, _, lower, higher = draw_pair(np.random.default_rng(seed), step=step, overhang=0.0)
    assert len(find_over(points, lower, higher)) == 0


@pytest.mark.parametrize("seed", range(5))
def test_a_part_wider_than_an_overhang_stays(seed):
    points, _, lower, higher = draw_pair(np.random.default_rng(seed), overhang=2.0)
    assert len(find_over(points, lower, higher)) == 0


def test_the_order_of_points_and_a_neighbour_elsewhere_do_not_matter():
    rng = np.random.default_rng(0)
    points, _, lower, higher = draw_pair(rng)
    distant = shapely.box(50, 50, 60, 60)
    one = reconstruct(points, lower, neighbours=[higher])
    other = reconstruct(rng.permutation(points), lower, neighbours=[distant, higher])
    assert one.parts[0].parameters == other.parts[0].parameters


@pytest.mark.parametrize("seed", [484, 1031, 1474, 2194])
def test_an_outline_cut_in_turned_axes_leaves_its_neighbours_whole(seed):
    """Its corners lie a last bit beside theirs, for which GEOS finds holes outside of shells."""
    rng = np.random.default_rng(seed)
    base = np.array([85000.0, 447000.0]) + rng.integers(0, 500, 2)
    angle, w, h = rng.uniform(0, 90), rng.uniform(8, 14), rng.uniform(6, 9)
    _, b = rng.uniform(4, 8), rng.uniform(3, 5)

    def place(*corners):
        turned = affinity.rotate(shapely.Polygon(corners), angle, origin=(0, 0))
        return shapely.transform(turned, lambda xy: np.round(xy, 3) + base)

    house = place((0, 0), (w, 0), (w, b), (w + 3, b), (w + 3, h), (0, h))
    beside = place((w, 0), (w + 3.5, 0.2), (w + 3.5, b), (w, b))
    behind = place((-1, h), (w + 3, h), (w + 1, h + 5), (-1, h + 6))
    frame = LocalFrame(np.array([*np.round(house.centroid.coords[0], 3), 0.0]))
    cosine, sine = np.cos(t := np.radians(angle) + rng.normal(0, 1e-4)), np.sin(t)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    turned = shapely.transform(house, lambda xy: frame.to_local(xy) @ turn)
    _, y0, x1, y1 = turned.bounds
    bare = shapely.box(x1 - rng.uniform(2, 5), y0 - 1, x1 + 1, y1 + 1)
    outline = shapely.transform(shapely.difference(turned, bare), lambda xy: xy @ turn.T)
    points = np.column_stack([rng.uniform(-3, 3, (200, 2)), np.full(200, 6.0)])
    around = np.vstack([points, points + [9.0, 0.0, 0.0]]) + frame.origin
    kept = drop_neighbour_roofs(points, outline, around, [beside, behind], frame)
    assert len(kept) == len(points)
