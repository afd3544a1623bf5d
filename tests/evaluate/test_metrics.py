"""Quality figures on solids whose figures are known by hand."""

import math
from functools import partial

import numpy as np
import pytest
import shapely
from benchmarks.judging import SHARED, load_tool

from handmade import box
from hiproof.city.folder.ledger import Ledger
from hiproof.city.run import Request, reconstruct_area
from hiproof.errors import InputError
from hiproof.evaluate.distance import point_surface_distances, vertical_distances
from hiproof.evaluate.metrics import iou, nodata_share, plan_outline, psd, quality, unexplained_area
from hiproof.evaluate.run import evaluate_run

AMSTERDAM = SHARED / "data/amsterdam_west"


block = partial(box, 10.0, 6.0, 0.0, 5.0)


def roof_points(dz=0.0, step=0.5):
    x, y = np.meshgrid(np.arange(0.25, 10, step), np.arange(0.25, 6, step))
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 5.0 + dz)])


def test_points_on_the_roof_leave_nothing_over():
    figures = quality(block(), roof_points(), shapely.box(0, 0, 10, 6))
    assert (figures.psd_mean, figures.psd_std, figures.rmse, figures.p95) == (0, 0, 0, 0)
    assert (figures.share_within_20cm, figures.outline_iou, figures.nodata_share) == (1, 1, 0)
    assert figures.points == 240 and figures.density == 4 and figures.unexplained_area_m2 == 0


def test_walls_and_ground_are_no_roof():
    assert psd(block(), np.array([[5.0, 0, 2.0]])) == pytest.approx(3.0)


def test_a_dormer_is_unexplained_by_its_area():
    points = roof_points()
    dormer = (points[:, 0] < 3) & (points[:, 1] < 2)
    points[dormer, 2] += 1
    figures = quality(block(), points, shapely.box(0, 0, 10, 6))
    assert figures.unexplained_area_m2 == 6
    # of the points 0.3 m inside the outline
    assert figures.share_within_20cm == pytest.approx(1 - 15 / 180)


def test_points_beyond_the_roof_are_misses():
    annex = np.column_stack([np.full(20, 11.0), np.linspace(1, 5, 20), np.full(20, 5.0)])
    points = np.concatenate([roof_points(), annex])
    figures = quality(block(), points, shapely.box(0, 0, 12, 6))
    assert figures.share_within_20cm == pytest.approx(190 / 210)
    assert psd(block(), points)[-1] == pytest.approx(1)


def test_facade_points_do_not_count_for_the_share():
    y = np.linspace(0.1, 5.9, 30)
    facade = np.column_stack([np.full(30, 0.1), y, np.linspace(0, 4, 30)])
    figures = quality(block(), np.concatenate([roof_points(), facade]), shapely.box(0, 0, 10, 6))
    assert figures.share_within_20cm == 1 and figures.psd_mean > 0.1
    narrow_quality = quality(block(), facade, shapely.box(0, 0, 10, 6))
    assert np.isnan(narrow_quality.share_within_20cm)


@pytest.mark.skipif(not AMSTERDAM.is_dir(), reason="needs the real data in ../shared")
def test_the_share_is_that_of_the_judge(tmp_path):
    """One definition: `share_within_20cm` of a run equals what ../shared/tools/roof_residuals.py
    says of its files.
    """
    clouds, footprints = [str(min(AMSTERDAM.glob("*.laz")))], str(AMSTERDAM / "footprints_bag.gpkg")
    reconstruct_area(Request(tuple(clouds), tmp_path, footprints))
    models = tmp_path / "buildings.city.jsonl"
    judged = load_tool("roof_residuals").measure(models, footprints, clouds)
    ledger = Ledger(tmp_path / ".hiproof" / "ledger.sqlite", read_only=True)
    rows = ledger.run("select share from building where share is not null order by position")
    kept = [share for (share,) in rows]
    assert np.mean(kept) == pytest.approx(judged["share_within_20cm"], abs=0.005)
    shares = [
        figures.quality.share_within_20cm
        for figures in evaluate_run(tmp_path, clouds, footprints).figures
    ]
    assert np.nanmean(shares) == pytest.approx(judged["share_within_20cm"], abs=0.005)


def test_a_bare_corner_is_no_data():
    points = roof_points()
    points = points[(points[:, 0] > 5) | (points[:, 1] > 3)]
    assert quality(block(), points, shapely.box(0, 0, 10, 6)).nodata_share == pytest.approx(0.25)


def test_without_a_footprint_the_alpha_shape_is_the_outline():
    figures = quality(block(), roof_points())
    assert figures.outline_iou == pytest.approx(9.5 * 5.5 / 60, abs=0.01)


@pytest.mark.parametrize("seed", range(4))
def test_cells_are_counted_as_one_by_one(seed):
    rng = np.random.default_rng(seed)
    outline = shapely.MultiPoint(rng.uniform(-9, 9, (8, 2))).convex_hull
    xyz, dz = rng.uniform(-12, 12, (150, 3)), rng.uniform(0, 1, 150)
    gaps_by_cell = {}
    for (x, y, _), gap in zip(xyz, dz, strict=True):
        gaps_by_cell.setdefault((math.floor(x), math.floor(y)), []).append(gap > 0.5)
    cells = [
        (x, y)
        for x in range(-10, 10)
        for y in range(-10, 10)
        if outline.covers(shapely.Point(x + 0.5, y + 0.5))
    ]
    assert nodata_share(xyz, outline) == pytest.approx(
        np.mean([cell not in gaps_by_cell for cell in cells])
    )
    assert unexplained_area(xyz, dz) == sum(np.mean(gaps) > 0.5 for gaps in gaps_by_cell.values())


def test_figures_do_not_depend_on_the_order_of_points():
    rng = np.random.default_rng(3)
    points = roof_points() + rng.normal(0, 0.2, (240, 3))
    a = quality(block(), points, shapely.box(0, 0, 10, 6))
    b = quality(block(), rng.permutation(points), shapely.box(0, 0, 10, 6))
    assert a.rmse == pytest.approx(b.rmse)
    assert a.p95 == b.p95
    assert a.unexplained_area_m2 == b.unexplained_area_m2


def test_iou_laws():
    a, b = shapely.box(0, 0, 2, 2), shapely.box(1, 1, 3, 3)
    assert iou(a, a) == 1 and iou(a, b) == iou(b, a) == pytest.approx(1 / 7)
    assert iou(a, shapely.box(5, 5, 6, 6)) == 0
    assert math.isnan(iou(shapely.Polygon(), shapely.Polygon()))


def test_outline_of_a_solid_is_its_plan():
    assert plan_outline(block()).equals(shapely.box(0, 0, 10, 6))


def test_no_points_no_figures():
    figures = quality(block(), np.empty((0, 3)), shapely.box(0, 0, 10, 6))
    assert figures.points == 0 and math.isnan(figures.rmse) and figures.nodata_share == 1


def test_points_that_are_not_finite_are_left_out():
    points = np.concatenate([roof_points(), [[np.nan, 1, 5], [1, np.inf, 5]]])
    assert quality(block(), points, shapely.box(0, 0, 10, 6)) == quality(
        block(), roof_points(), shapely.box(0, 0, 10, 6)
    )


@pytest.mark.parametrize("xy", [np.zeros((2, 2)), np.zeros((9, 2)), np.arange(10.0).reshape(5, 2)])
def test_points_without_area_give_no_outline_but_figures(xy):
    figures = quality(block(), np.column_stack([xy, np.full(len(xy), 5.0)]))
    assert math.isnan(figures.outline_iou) and figures.psd_mean >= 0


def plane_basis(ring):
    """Origin and two unit vectors in the plane of a ring (m, 3)."""
    origin = ring.mean(axis=0)
    _, _, rows = np.linalg.svd(ring - origin)
    return origin, rows[0], rows[1], rows[2]


def slow_distance(point, rings):
    """Distance to one polygon: shapely decides about inside in the plane's own coordinates."""
    origin, u, v, normal = plane_basis(rings[0])
    flat = [np.column_stack([(ring - origin) @ u, (ring - origin) @ v]) for ring in rings]
    foot = shapely.Point((point - origin) @ u, (point - origin) @ v)
    in_plane = shapely.Polygon(flat[0], flat[1:]).distance(foot)
    return np.hypot(in_plane, (point - origin) @ normal)


def random_polygon(rng):
    """A star-shaped polygon with a hole in a random plane."""
    angle = np.sort(rng.uniform(0, 2 * np.pi, 7))
    if np.diff(np.append(angle, angle[0] + 2 * np.pi)).max() > np.pi:
        angle = np.linspace(0, 2 * np.pi, 7, endpoint=False)
    radius = rng.uniform(2, 4, 7)
    outer = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    hole = 0.3 * np.array([[1, 0], [0, -1], [-1, 0], [0, 1]])
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    centre = rng.normal(size=3) * 3
    return [np.pad(ring, ((0, 0), (0, 1))) @ q.T + centre for ring in (outer, hole)]


@pytest.mark.parametrize("seed", range(20))
def test_equals_the_slow_oracle(seed):
    rng = np.random.default_rng(seed)
    polygons = [random_polygon(rng) for _ in range(3)]
    points = rng.normal(size=(40, 3)) * 4
    expected = [min(slow_distance(p, rings) for rings in polygons) for p in points]
    np.testing.assert_allclose(point_surface_distances(points, polygons), expected, atol=1e-9)


def test_distances_beyond_a_limit_are_the_limit():
    rng = np.random.default_rng(20)
    polygons, points = [random_polygon(rng) for _ in range(3)], rng.normal(size=(40, 3)) * 4
    limit = rng.uniform(0, 2, len(points))
    expected = np.minimum(point_surface_distances(points, polygons), limit)
    assert 0 < np.count_nonzero(expected == limit) < len(points)
    np.testing.assert_allclose(point_surface_distances(points, polygons, limit), expected)


def test_a_hole_is_outside():
    outer = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]])
    hole = np.array([[4.0, 4, 0], [4, 6, 0], [6, 6, 0], [6, 4, 0]])
    point = np.array([[5.0, 5, 2]])
    assert point_surface_distances(point, [[outer, hole]]) == pytest.approx(np.hypot(1, 2))
    assert vertical_distances(point, [[outer, hole]]) == np.inf
    assert vertical_distances(point, [outer]) == 2


def test_points_on_a_shared_edge_are_covered_once():
    left = np.array([[0.0, 0, 0], [1, 0, 1], [1, 2, 1], [0, 2, 0]])
    right = np.array([[1.0, 0, 1], [2, 0, 0], [2, 2, 0], [1, 2, 1]])
    assert vertical_distances(np.array([[1.0, 1, 1.5]]), [left, right]) == pytest.approx(0.5)


def test_vertical_takes_the_nearest_of_stacked_surfaces_and_no_walls():
    lower_ring = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    wall = np.array([[1.0, 0, 0], [1, 2, 0], [1, 2, 9], [1, 0, 9]])
    points = np.array([[1.0, 1, 1], [1, 1, 4]])
    assert vertical_distances(points, [lower_ring, lower_ring + [0, 0, 5], wall]).tolist() == [1, 1]


def test_without_polygons_nothing_is_near():
    assert point_surface_distances(np.zeros((2, 3)), []).tolist() == [np.inf, np.inf]
    assert point_surface_distances(np.zeros((0, 3)), []).shape == (0,)


def test_a_collapsed_polygon_counts_as_its_edges():
    line = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    assert point_surface_distances(np.array([[1.0, 3, 4]]), [line]) == pytest.approx(5)


@pytest.mark.parametrize("points", [np.zeros((3, 2)), np.zeros(3)])
def test_refuses_points_without_three_columns(points):
    with pytest.raises(InputError, match="shape"):
        point_surface_distances(points, [])


def test_refuses_rings_of_two_vertices():
    with pytest.raises(InputError, match="at least 3 vertices"):
        point_surface_distances(np.zeros((1, 3)), [np.zeros((2, 3))])
