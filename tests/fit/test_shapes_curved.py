"""Check that curved roofs become cones, spires, domes, onions and barrels, and others do not."""

from functools import cache

import numpy as np
import pytest
import shapely
from benchmarks.compounds import draw_compound
from benchmarks.curved import DRUM_SETTINGS, draw_scene, is_drum_found, judge_parts, make_disc

import hiproof
from hiproof.compose import check_solid, compose
from hiproof.fit.roof import fit_building
from hiproof.fit.shapes.arcs import find_arcs
from hiproof.frames import LocalFrame
from hiproof.model import ROOF, Roof
from hiproof.model.heights import find_highest
from hiproof.primitives import CATALOGUE
from hiproof.primitives.catalogue import CURVED
from hiproof.settings import Settings
from hiproof.write.parameters import building_record
from points_of_roofs import sample_heights, sample_roof, typical_theta

PLANAR = [name for name in CATALOGUE if name not in CURVED]


@cache
def fit_scene(kind, setting, seed, density=8.0):
    """Return a scene and the parts that are found in it, for all tests that look at them."""
    scene = draw_scene(kind, setting, seed, density)
    return scene, fit_building(scene.points, scene.outline).roof_parts


@cache
def reconstruct_scene(kind, setting, seed):
    scene = draw_scene(kind, setting, seed, 8.0)
    return scene, hiproof.reconstruct(scene.points, scene.outline)


@pytest.mark.parametrize(
    ("kind", "setting"),
    [
        *((kind, "alone") for kind in CURVED),
        ("cone", "tower"),
        ("broach", "tower"),
        ("dome", "tower"),
        ("hexagonal_spire", "tower"),
        ("barrel", "tower"),
        ("cone", "turret"),
        ("broach", "turret"),
        ("dome", "turret"),
        ("onion", "turret"),
        ("half_cone", "apse"),
        ("hexagonal_spire", "turret"),
    ],
)
def test_a_curved_roof_is_found(kind, setting):
    outcome = judge_parts(*fit_scene(kind, setting, 20))
    assert outcome.is_right
    # Few points lie on an onion's pointed top.
    tolerance_m = 0.5 if kind == "onion" else 0.2
    assert outcome.height_error_m == pytest.approx(0.0, abs=tolerance_m)
    assert outcome.volume_error == pytest.approx(0.0, abs=0.03)


def test_a_pointed_roof_over_a_polygon_has_a_facet_over_each_wall():
    """Of 7 to 16 unequal walls, at 8 points/m2: 80 of 80 other seeds."""
    found = 0
    for seed in range(10):
        rng = np.random.default_rng([seed, 11])
        sides, radius = 7 + seed % 10, rng.uniform(2.5, 6.0)
        turns = (np.arange(sides) + rng.uniform(-0.15, 0.15, sides)) * 2.0 * np.pi / sides
        rim = radius * np.column_stack([np.cos(turns), np.sin(turns)])
        way, outline = np.roll(rim, -1, axis=0) - rim, shapely.Polygon(rim)
        normals = np.column_stack([way[:, 1], -way[:, 0]]) / np.linalg.norm(way, axis=1)[:, None]
        depths = (normals * rim).sum(axis=1)
        xy = rng.uniform(-radius, radius, (int(32.0 * radius**2), 2))
        xy = xy[shapely.contains_xy(outline, *xy.T)]
        fall = rng.uniform(0.6, 1.6) * (xy @ normals.T / depths).max(axis=1)
        z = 10.0 - radius * fall + rng.normal(0.0, 0.03, len(xy))
        parts = fit_building(np.column_stack([xy, z]), outline).roof_parts
        solid = compose(Roof(parts, outline, LocalFrame(np.zeros(3))), 0.0)
        found += len(solid.select_faces(ROOF)) == sides
    assert found >= 9


def test_a_cone_is_no_onion_of_any_width():
    """No bulge lies along a cone, so its points do not determine that of an onion."""
    right = 0
    for seed in range(100, 107):
        scene, parts = fit_scene("cone", "tower", seed)
        true, _, _ = CATALOGUE["cone"].from_theta(scene.theta)
        curved = [part for part in parts if part.type != "flat"]
        if [part.type for part in curved] == ["cone"]:
            right += curved[0].parameters["width"] == pytest.approx(true["width"], rel=0.1)
    assert right >= 5


@pytest.mark.parametrize(("setting", "seed"), [("alone", 10), ("tower", 10)])
def test_two_halves_of_a_spire_become_one_with_equal_sides(setting, seed):
    """Planes follow the points as well, but there are more of them."""
    scene, parts = fit_scene("hexagonal_spire", setting, seed)
    (spire,) = [part for part in parts if part.type == "hexagonal_spire"]
    true, _, place = CATALOGUE["hexagonal_spire"].from_theta(scene.theta)
    size = spire.parameters
    assert size["width"] == pytest.approx(size["length"], abs=1e-6)
    assert size["height"] / size["width"] == pytest.approx(true["height"] / true["width"], rel=0.02)
    assert spire.translation[:2] == pytest.approx(place[:2], abs=0.05)


def test_a_spire_on_a_tower_stands_on_one_level_part():
    """Strips beside it would leave a moat where they lie higher than its eave (21 of 24 seeds)."""
    found = 0
    for seed in range(4):
        scene, parts = fit_scene("broach", "tower", seed)
        low, high = np.reshape(scene.outline.bounds, (2, 2))
        xy = np.random.default_rng(seed).uniform(low, high, (4000, 2))
        xy = xy[shapely.contains_xy(scene.outline, *xy.T)]
        too_low = find_highest(parts, xy)[0] < scene.height_at(xy) - 0.15
        types = sorted(part.type for part in parts)
        found += types == ["broach", "flat"] and too_low.mean() <= 0.02
    assert found >= 3


@pytest.mark.parametrize("kind", ["cone", "dome", "onion"])
def test_facets_over_an_arc_stand_on_its_sides(kind):
    """So the eave is level."""
    scene, parts = fit_scene(kind, "alone", 20)
    corners = 0.999 * shapely.get_coordinates(scene.outline)
    assert np.ptp(find_highest(parts, corners)[0]) <= 0.05


def test_an_onion_on_a_tower_is_as_high_as_it_is():
    """Its middle and its width follow from all points on it, and the needle from those.

    Of 40 seeds, the type is right in 35, and the height within 0.2 m too in 29.
    """
    outcomes = [judge_parts(*fit_scene("onion", "tower", seed)) for seed in range(6)]
    assert sum(outcome.is_right for outcome in outcomes) >= 4
    near = [outcome.is_right and abs(outcome.height_error_m) <= 0.2 for outcome in outcomes]
    assert sum(near) >= 3


def test_an_onion_is_found_around_what_looks_like_a_spire():
    """On a square tower no arc of the outline helps, and its top alone looks like a cone."""
    outcome = judge_parts(*fit_scene("onion", "tower", 21))
    assert outcome.is_right
    assert outcome.height_error_m == pytest.approx(0.0, abs=0.5)
    assert outcome.volume_error == pytest.approx(0.0, abs=0.01)


def test_the_top_of_an_onion_is_not_drawn_without_points():
    """Of thirteen points, none lies higher than a cone would be."""
    outcome = judge_parts(*fit_scene("cone", "turret", 25, 2.0))
    assert outcome.is_right and outcome.height_error_m == pytest.approx(0.0, abs=0.2)


@pytest.mark.parametrize("kind", PLANAR)
def test_planes_stay_planes(kind):
    theta = typical_theta(kind, height=3.0, teeth=3 if kind == "shed" else None)
    points = sample_roof(kind, theta, density=6.0, teeth=3)
    shape = CATALOGUE[kind].variant({"teeth": 3}) if kind == "shed" else CATALOGUE[kind]
    outline = shapely.union_all([piece.outline for piece in shape.part(theta).pieces])
    parts = fit_building(points, shapely.convex_hull(outline)).roof_parts
    assert not {part.type for part in parts} & set(CURVED)


def test_a_turret_is_found_from_two_points_a_square_metre():
    """The outline gives the circle, so that two numbers are left to the points."""
    found = [
        judge_parts(*fit_scene("cone", "turret", seed, 2.0)).is_right for seed in range(20, 26)
    ]
    assert all(found)


def test_the_top_of_a_turret_may_lie_beside_the_middle_of_its_arc():
    """Walls bulge more to one side than roofs do; steep facets show 0.2 m as 0.5 m of height."""
    disc = make_disc(0.0, 0.0, 1.7)
    outline = shapely.union(shapely.box(0.0, 0.0, 14.0, 9.0), disc)

    def height_at(x, y):
        cone = 14.0 - 2.2 * np.hypot(x - 0.2, y - 0.15)
        house = 6.0 + 0.9 * (4.5 - np.abs(y - 4.5))
        return np.where(shapely.contains_xy(disc, x, y), cone, house)

    parts = fit_building(sample_heights(height_at, outline), outline).roof_parts
    (cone,) = [part for part in parts if part.type == "cone"]
    assert cone.translation[:2] == pytest.approx([0.2, 0.15], abs=0.05)


@pytest.mark.parametrize("setting", DRUM_SETTINGS)
def test_a_drum_is_found(setting):
    assert is_drum_found(setting, 20, 8.0)


def test_the_edge_of_a_drum_lies_between_points():
    """Three percent of its plan are a few centimetres of its radius."""
    assert sum(is_drum_found("in a gable", seed, 8.0) for seed in range(10)) >= 8


def test_a_ring_is_found_from_two_points_a_square_metre():
    """Of forty, 23 are found, so of ten hardly ever fewer than four."""
    assert sum(is_drum_found("ring", seed, 2.0) for seed in range(10)) >= 4


@pytest.mark.parametrize("step", [-3.0, 1.5])
def test_a_drum_in_a_drum_leaves_a_ring(step):
    disc, middle = make_disc(0.0, 0.0, 5.0), make_disc(0.0, 0.0, 2.5)

    def height_at(x, y):
        return 10.0 + np.where(np.hypot(x, y) < 2.49, step, 0.0)

    building = hiproof.reconstruct(sample_heights(height_at, disc), disc)
    assert [part.type for part in building.parts] == ["flat", "flat"]
    roof = building.solid.select_faces("RoofSurface")
    areas = sorted(building.solid.project_face(face).area for face in roof)
    assert areas == pytest.approx([middle.area, disc.area - middle.area], rel=0.03)
    assert not check_solid(building.solid)


def test_a_square_shaft_is_no_drum():
    house, shaft = shapely.box(0.0, 0.0, 14.0, 10.0), shapely.box(5.0, 3.0, 8.5, 6.5)

    def height_at(x, y):
        return 9.0 + 3.0 * shapely.contains_xy(shaft, x, y)

    parts = fit_building(sample_heights(height_at, house), house).roof_parts
    assert min(part.area for part in parts) == pytest.approx(shaft.area, rel=0.05)
    assert min(len(part.outlines[0].exterior.coords) for part in parts) == 5


def test_a_level_or_a_hipped_end_stays_so():
    arc = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 13)
    ring = np.column_stack([10.0 + 3.0 * np.cos(arc), 4.0 + 3.0 * np.sin(arc)])
    outline = shapely.union(shapely.box(0.0, 0.0, 10.0, 8.0), shapely.Polygon(ring))
    (end,) = find_arcs(outline)
    assert (end.radius, end.span_deg) == pytest.approx((3.0, 180.0), rel=0.01)
    assert end.centre == pytest.approx([10.0, 4.0], abs=0.01)
    level = sample_heights(lambda x, y: np.full(len(x), 5.0), outline)
    assert {part.type for part in fit_building(level, outline).roof_parts} == {"flat"}
    hipped = sample_heights(lambda x, y: 8.0 - np.maximum(np.abs(y - 4.0), x - 9.0), outline)
    assert not {part.type for part in fit_building(hipped, outline).roof_parts} & set(CURVED)


def test_ordinary_outlines_have_no_round_ends():
    canted = shapely.Polygon([(0, 0), (9, 0), (10, 1), (10, 5), (9, 6), (1, 6), (0, 5)])
    bow = shapely.Polygon([(0, 0), (10, 0), *((10 - 2 * k, 6 + k * (5 - k) / 8) for k in range(6))])
    assert find_arcs(canted) == find_arcs(bow) == []


def test_an_apse_is_a_valid_solid_with_one_curved_surface():
    _, building = reconstruct_scene("half_cone", "apse", 20)
    types = [part.type for part in building.parts]
    assert len(types) == 2 and types.count("half_cone") == 1
    assert not check_solid(building.solid)
    rebuilt = hiproof.build(building_record(building))
    assert np.array_equal(rebuilt.solid.vertices, building.solid.vertices)
    steeper = building.with_part(types.index("half_cone"), height=2.0)
    assert steeper.parts[types.index("half_cone")].parameters["height"] == 2.0
    assert not check_solid(steeper.solid)


def test_an_onion_is_built_again_from_its_parameters():
    scene, building = reconstruct_scene("onion", "turret", 20)
    (number,) = [k for k, part in enumerate(building.parts) if part.type == "onion"]
    assert not check_solid(building.solid)
    record = building_record(building)
    assert len(record["parts"][number]["outlines"]) == 1
    rebuilt = hiproof.build(record)
    assert np.array_equal(rebuilt.solid.vertices, building.solid.vertices)
    lower = building.with_part(number, height=6.9, neck_height=2.8)
    assert not check_solid(lower.solid)
    refitted = lower.refit(scene.points).parts[number]
    for name in ("height", "neck_height"):
        fitted = building.parts[number].parameters[name]
        assert refitted.parameters[name] == pytest.approx(fitted, abs=0.2)


REFITTED = [
    *(("onion", setting) for setting in ("alone", "tower", "turret")),
    ("cone", "tower"),
    ("broach", "turret"),
    ("dome", "tower"),
    ("half_cone", "apse"),
]


def test_a_refit_of_an_untouched_building_stays_near_its_fit():
    """Of 40 seeds of each kind, 270 of 280 do."""
    near = [is_refit_near(kind, setting, 20) for kind, setting in REFITTED]
    assert sum(near) >= 6


def is_refit_near(kind, setting, seed):
    scene, building = reconstruct_scene(kind, setting, seed)
    refitted = building.refit(scene.points)
    rng, (x0, y0, x1, y1) = np.random.default_rng(seed), building.roof.outline.bounds
    xy = rng.uniform((x0, y0), (x1, y1), (2000, 2))
    xy = xy[shapely.contains_xy(building.roof.outline, *xy.T)]
    fitted, again = (find_highest(one.parts, xy)[0] for one in (building, refitted))
    return bool((np.abs(again - fitted) <= 0.2).all())


MEASURED = [
    ("onion", "alone"),
    ("cone", "turret"),
    ("hexagonal_spire", "tower"),
    ("barrel", "alone"),
]


@pytest.mark.parametrize(("kind", "setting"), MEASURED)
def test_errors_of_curved_parts_are_a_few_standard_deviations(kind, setting):
    scores = []
    for seed in range(16, 24):
        scene, parts = fit_scene(kind, setting, seed)
        of_kind = [part for part in parts if part.type == kind]
        if len(of_kind) != 1:  # another shape in one of eight, of which the benchmark tells
            continue
        (part,) = of_kind
        true, _, _ = CATALOGUE[kind].from_theta(scene.theta)
        scores.append((part.parameters["height"] - true["height"]) / part.sigma["height"])
    assert len(scores) >= 7
    # the median, for one vault in eight is another
    assert 1.48 * np.median(np.abs(scores)) == pytest.approx(1.0, abs=0.55)


def test_a_type_that_is_not_allowed_is_not_found():
    scene = draw_scene("dome", "alone", 20, 8.0)
    settings = Settings.from_dict({"fit": {"types": ["flat", "pyramid", "mansard"]}})
    parts = fit_building(scene.points, scene.outline, settings).roof_parts
    assert {part.type for part in parts} <= {"flat", "pyramid", "mansard"}


@pytest.mark.parametrize("kind", CURVED)
@pytest.mark.parametrize("width", [1.6, 7.0, 30.0])
def test_curved_shapes_of_every_size_are_valid_solids(kind, width):
    theta_p = CATALOGUE[kind].typical(width, 1.2 * width, 0.4 * width)
    shape = CATALOGUE[kind].variant(theta_p)
    part = shape.part(shape.to_theta(theta_p, 0.3, (1.0, 2.0, 6.0)))
    roof = Roof((part,), part.pieces[0].outline, LocalFrame(np.zeros(3)))
    solid = compose(roof, 0.0)
    assert not check_solid(solid)
    plan_area = part.pieces[0].outline.area
    assert solid.volume > 6.0 * plan_area
    # The smallest facets of a small dome are one face, and the tip of a small onion is cut off.
    tolerance_m = 0.2 if (kind, width) == ("onion", 1.6) else 0.05
    assert solid.vertices[:, 2].max() == pytest.approx(6.0 + theta_p["height"], abs=tolerance_m)


@pytest.mark.parametrize("seed", [2009, 2010, 2015])  # of twenty, those whose gables were bent
def test_a_gable_is_no_barrel_because_a_bend_fits_a_little_better(seed):
    building, points = draw_compound("dormered", 10.0, seed)
    types = [part.type for part in fit_building(points, building.outline).roof_parts]
    assert "gable" in types and "barrel" not in types
