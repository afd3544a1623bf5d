"""The simulated scanner: points lie on the truth, as many as asked for, with the right labels."""

import dataclasses

import numpy as np
import pytest
import shapely

from handmade import box
from hiproof.errors import InputError
from hiproof.model import Piece
from hiproof.simulate import (
    NOT_ROOF,
    ROOF_TYPES,
    SOURCES,
    Defects,
    ScanSettings,
    random_building,
    scan,
    scan_solids,
    uniform_points,
)
from hiproof.simulate.flight import Swath, make_beams
from hiproof.simulate.raycast import cast_crowns
from hiproof.simulate.scanner import first_hits, returns
from hiproof.simulate.scene import Body, building_bodies, make_scene

ROOF, WALL, GROUND = (SOURCES.index(name) for name in ("roof", "wall", "ground"))
EXACT = ScanSettings(
    range_noise_m=0.0,
    horizontal_noise_m=0.0,
    beam_radius_m=0.0,
    registration_m=0.0,
    defects=Defects.none(),
)


def slow_first_hit(building, xy0, slope, step=0.002):
    """Walk each beam down in small steps until it is under the roof."""
    heights = np.arange(25.0, 0.0, -step)
    hits = np.zeros(len(xy0))
    for i, (start, tilt) in enumerate(zip(xy0, slope, strict=True)):
        roof = building.roof.height_at(start + heights[:, None] * tilt)
        is_under = np.flatnonzero(heights <= np.nan_to_num(roof, nan=-1.0))
        hits[i] = heights[is_under[0]] if len(is_under) else 0.0
    return hits


@pytest.mark.parametrize("type", ROOF_TYPES)
def test_roof_points_lie_on_the_truth(type):
    rng = np.random.default_rng(3)
    building = random_building(rng, type, origin=(1000.0, 2000.0, 7.0))
    cloud = scan(building, rng, EXACT)
    roof = cloud.source == ROOF
    local = building.roof.frame.to_local(cloud.points)
    # The roof's height jumps at a shed's teeth, where a plan position has two right answers.
    highest = building.roof.height_at(local[roof, :2])
    on_a_piece = np.min(
        [np.abs(p.height_at(local[roof, :2]) - local[roof, 2]) for p in building.roof.pieces],
        axis=0,
    )
    assert on_a_piece.max() < 1e-9
    assert np.nanmax(local[roof, 2] - highest) < 1e-9
    assert set(cloud.label[roof]) == {ROOF_TYPES.index(type)}
    assert set(cloud.label[~roof]) <= {NOT_ROOF}
    assert np.abs(cloud.points[cloud.source == GROUND, 2] - 7.0).max() < 1e-9


def test_noise_is_as_large_as_asked():
    rng = np.random.default_rng(5)
    settings = dataclasses.replace(EXACT, range_noise_m=0.05, density=20.0)
    building = random_building(rng, "flat")
    cloud = scan(building, rng, settings)
    error = cloud.points[cloud.source == ROOF, 2] - building.roof.parts[0].translation[2]
    assert abs(error.std() - 0.05) < 0.006 and abs(error.mean()) < 0.006


@pytest.mark.parametrize("density", [1.0, 5.0, 20.0])
def test_density_is_as_asked(density):
    rng = np.random.default_rng(11)
    counts, areas = 0, 0.0
    for _ in range(30):
        building = random_building(rng, "flat")
        cloud = scan(building, rng, dataclasses.replace(EXACT, density=density, margin_m=0.0))
        counts, areas = counts + (cloud.source == ROOF).sum(), areas + building.outline.area
    assert counts / areas == pytest.approx(density, rel=0.06)


@pytest.mark.parametrize("type", ["gable", "half_hip", "shed", "gambrel"])
def test_compiled_beams_equal_a_slow_walk(type):
    rng = np.random.default_rng(7)
    building = random_building(rng, type)
    xy0 = rng.uniform(-9, 9, (60, 2))
    slope = rng.uniform(-0.4, 0.4, (60, 2))
    z_fast, _, _ = first_hits(make_scene(building_bodies(building)), xy0, slope)
    assert np.abs(z_fast - slow_first_hit(building, xy0, slope)).max() < 0.003


def test_heading_changes_no_label():
    """Turning flight and building together gives the same labels; a nadir beam has no walls
    whatever the heading.
    """
    for heading in (0.0, 1.0, 2.5):
        building = random_building(np.random.default_rng(2), "hip", kappa=0.3 + heading)
        beams = make_beams(
            np.random.default_rng(4), Swath(heading, 0.5, 0.4, 0.2), np.zeros(2), 12.0, 0.0
        )
        cloud = returns(
            make_scene(building_bodies(building)), beams, np.random.default_rng(4), EXACT
        )
        if heading == 0.0:
            first = cloud
        assert np.array_equal(cloud.label, first.label)
        assert np.array_equal(cloud.source, first.source)
        nadir = make_beams(
            np.random.default_rng(4), Swath(heading, 0.5, 0.4, 0.0), np.zeros(2), 12.0, 0.0
        )
        assert (
            WALL
            not in returns(
                make_scene(building_bodies(building)), nadir, np.random.default_rng(4), EXACT
            ).source
        )


def test_walls_show_only_at_an_angle_and_lie_on_the_outline():
    rng = np.random.default_rng(13)
    building = random_building(rng, "gable")
    cloud = scan(building, rng, dataclasses.replace(EXACT, density=10.0, max_scan_angle_deg=30.0))
    walls = cloud.points[cloud.source == WALL]
    assert len(walls)
    assert shapely.distance(building.footprint.exterior, shapely.points(walls[:, :2])).max() < 1e-6


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_seeds_reproduce(seed):
    clouds = []
    for _ in range(2):
        rng = np.random.default_rng(seed)
        clouds.append(scan(random_building(rng), rng))
    assert np.array_equal(clouds[0].points, clouds[1].points)
    assert np.array_equal(clouds[0].label, clouds[1].label)


def test_defects_all_happen_and_none_happens_without_them():
    rng = np.random.default_rng(17)
    everything = Defects(*(1.0,) * 8, outliers=0.02)
    visited = set()
    for _ in range(6):
        visited |= set(
            scan(
                random_building(rng, "gable"), rng, ScanSettings(margin_m=2.0, defects=everything)
            ).source
        )
    assert visited == set(range(len(SOURCES)))
    bare = scan(random_building(rng, "gable"), rng, ScanSettings(defects=Defects.none()))
    assert set(bare.source) <= {ROOF, WALL, GROUND}


def test_solids_are_scanned_like_buildings():
    cube = box(10.0, 10.0, 0.0, 6.0).move(np.array([500.0, 900.0, 3.0]))
    cloud = scan_solids([cube], np.random.default_rng(1), EXACT, ["flat"])
    roof = cloud.source == ROOF
    assert np.abs(cloud.points[roof, 2] - 9.0).max() < 1e-9 and set(cloud.label[roof]) == {0}
    assert np.abs(cloud.points[cloud.source == GROUND, 2] - 3.0).max() < 1e-9
    assert roof.sum() == pytest.approx(5.0 * 100.0, rel=0.12)
    unknown = scan_solids([cube], np.random.default_rng(1), EXACT, ["arch"])
    assert set(unknown.label) == {NOT_ROOF} and ROOF in unknown.source


def test_uniform_points_have_the_papers_noise():
    rng = np.random.default_rng(0)
    building = random_building(rng, "pyramid", origin=(100.0, 200.0, 5.0))
    points = np.concatenate([uniform_points(building, rng) for _ in range(40)])
    local = building.roof.frame.to_local(points)
    error = np.abs(local[:, 2] - building.roof.height_at(local[:, :2])) / 0.12
    assert (error < 1).mean() == pytest.approx(0.9, abs=0.02)
    assert (error < 2).mean() == pytest.approx(0.99, abs=0.01)
    assert error.max() < 3
    assert len(points) / 40 / building.outline.area == pytest.approx(4.72, rel=0.05)


def test_pieces_that_beams_cannot_enter_are_refused():
    corner = shapely.Polygon([(0, 0), (4, 0), (4, 4), (2, 1), (0, 4)])
    yard = shapely.Point(0, 0).buffer(9).difference(shapely.Point(0, 0).buffer(3))
    for outline, fault in ((corner, "re-entrant corner"), (yard, "hole")):
        with pytest.raises(InputError, match=fault):
            make_scene([Body(Piece(outline, np.zeros((1, 3))))])


@pytest.mark.parametrize("order", [1, -1])
def test_either_orientation_of_an_outline_will_do(order):
    square = shapely.Polygon([(0, 0), (4, 0), (4, 4), (0, 4)][::order])
    scene = make_scene([Body(Piece(square, np.array([[0.0, 0.0, 3.0]])))])
    z, _, _ = first_hits(scene, np.array([[2.0, 2.0], [5.0, 2.0]]), np.zeros((2, 2)))
    assert z.tolist() == [3.0, 0.0]


def test_crowns_catch_beams_inside_them_only():
    """A dense crown catches every beam that meets it, where and only where the ellipsoid is."""
    rng = np.random.default_rng(9)
    crown = np.array([[1.0, -2.0, 7.0, 2.5, 3.0]])
    xy0, slope = rng.uniform(-8, 8, (4000, 2)), rng.uniform(-0.3, 0.3, (4000, 2))
    z = np.full(len(xy0), -np.inf)
    cast_crowns(xy0, slope, crown, np.full(len(xy0), 1e-9), z)
    caught = np.isfinite(z)
    on_shell = np.column_stack([xy0 + slope * z[:, None], z])[caught] - crown[0, :3]
    assert np.abs(((on_shell / (2.5, 2.5, 3.0)) ** 2).sum(axis=1) - 1).max() < 1e-6
    heights = np.linspace(4.0, 10.0, 400)
    walk = (xy0[~caught][:, None] + slope[~caught][:, None] * heights[:, None] - crown[0, :2]) / 2.5
    assert ((walk**2).sum(axis=2) + ((heights - 7.0) / 3.0) ** 2).min() > 1.0


def test_bad_requests_are_refused_in_a_sentence():
    rng = np.random.default_rng(0)
    building = random_building(rng, "flat")
    with pytest.raises(InputError, match="expected a density"):
        scan(building, rng, ScanSettings(density=-1.0))
    with pytest.raises(InputError, match="expected noise"):
        scan(building, rng, ScanSettings(range_noise_m=-0.1))
    with pytest.raises(InputError, match="expected noise"):
        scan(building, rng, ScanSettings(margin_m=float("nan")))
    with pytest.raises(InputError, match="scan angle"):
        scan(building, rng, ScanSettings(max_scan_angle_deg=80.0))
    with pytest.raises(InputError, match="at least one solid"):
        scan_solids([], rng)
    with pytest.raises(InputError, match="expected a roof type"):
        random_building(rng, "igloo")
