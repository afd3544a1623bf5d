"""Laws every shape of the catalogue obeys; a new shape inherits them by its row of the table."""

import numpy as np
import pytest
import shapely

from hiproof.errors import FitError, SettingsError
from hiproof.primitives import CATALOGUE, get
from hiproof.primitives.contract import HALF_LENGTH, HALF_WIDTH, RECTANGLE, place_vertices

VARIANTS = [variant for primitive in CATALOGUE.values() for variant in primitive.variants]
IDS = [f"{variant.name}-{len(variant.parameters)}-{variant.strips}" for variant in VARIANTS]
each_variant = pytest.mark.parametrize("primitive", VARIANTS, ids=IDS)


def random_roofs(primitive, count=20, seed=3):
    """Yield (variant, theta_p, kappa, T_L) of ordinary roofs. Proportions are typical, each length
    varied by a tenth. The variant has as many facets as the size asks for.
    """
    rng = np.random.default_rng(seed)
    for _ in range(count):
        width = rng.uniform(6, 12)
        theta_p = primitive.typical(width, width * rng.uniform(1.2, 2.5), rng.uniform(1.5, 4))
        theta_p = {
            k: v if k == "teeth" else v * rng.uniform(0.95, 1.05) for k, v in theta_p.items()
        }
        yield primitive.variant(theta_p), theta_p, rng.uniform(-1.5, 1.5), rng.normal(0, 20, 3)


def compute_plan_area(primitive, theta_p):
    """Return the area of the plan."""
    return sum(
        shapely.Polygon(ring).area for ring in primitive.plan_rings(primitive.to_theta(theta_p))
    )


def plane_by_svd(polygon):
    """(a, b, c) of z = a x + b y + c through a planar polygon's vertices (n, 3)."""
    centre = polygon.mean(axis=0)
    normal = np.linalg.svd(polygon - centre)[2][2]
    a, b = -normal[:2] / normal[2]
    return np.array([a, b, centre[2] - a * centre[0] - b * centre[1]])


@each_variant
def test_planes_of_the_term_table_are_those_of_the_vertices(primitive):
    for shape, theta_p, _, _ in random_roofs(primitive):
        vertices = shape.vertices(theta_p)
        planes = shape.plane_values(shape.to_theta(theta_p))
        assert len(planes) == len(shape.faces)
        for face, plane in zip(shape.faces, planes, strict=True):
            np.testing.assert_allclose(plane_by_svd(vertices[list(face)]), plane, atol=1e-9)


@each_variant
def test_theta_and_named_parameters_are_inverse(primitive):
    for shape, theta_p, kappa, translation in random_roofs(primitive):
        theta = shape.to_theta(theta_p, kappa, translation)
        parameters, kappa_back, translation_back = shape.from_theta(theta)
        assert parameters == pytest.approx(theta_p)
        assert kappa_back == pytest.approx(kappa)
        np.testing.assert_allclose(translation_back, translation, atol=1e-9)
        assert shape.is_proper(theta)


@each_variant
def test_faces_tile_the_plan_counter_clockwise_with_eave_at_zero(primitive):
    for shape, theta_p, _, _ in random_roofs(primitive):
        vertices = shape.vertices(theta_p)
        rings = [shapely.LinearRing(vertices[list(face), :2]) for face in shape.faces]
        assert all(ring.is_ccw for ring in rings)
        areas = sum(shapely.Polygon(ring).area for ring in rings)
        assert areas == pytest.approx(compute_plan_area(shape, theta_p))
        assert shapely.union_all([shapely.Polygon(ring) for ring in rings]).area == pytest.approx(
            areas
        )
        assert vertices[:, 2].min() == 0
        plan = np.concatenate(shape.plan_rings(shape.to_theta(theta_p)))
        for extreme in (np.min, np.max):
            np.testing.assert_allclose(
                extreme(vertices[:, :2], axis=0), extreme(plan, axis=0), atol=1e-12
            )
        if shape.rim == RECTANGLE:
            half = shape.to_theta(theta_p)[[HALF_LENGTH, HALF_WIDTH]]
            np.testing.assert_allclose(vertices[:, :2].max(axis=0), half, atol=1e-12)
            np.testing.assert_allclose(vertices[:, :2].min(axis=0), -half, atol=1e-12)


@each_variant
def test_vertices_lie_on_the_surface_and_on_the_part(primitive):
    for shape, theta_p, kappa, translation in random_roofs(primitive, 5):
        theta = shape.to_theta(theta_p, kappa, translation)
        vertices = shape.vertices(theta_p)
        inside = [np.mean(vertices[list(face)], axis=0) for face in shape.faces]
        centroids = place_vertices(np.array(inside), kappa, translation)
        np.testing.assert_allclose(
            shape.height_at(theta, centroids[:, :2]), centroids[:, 2], atol=1e-9
        )
        part = shape.part(theta)
        assert part.type == shape.name
        assert part.area == pytest.approx(compute_plan_area(shape, theta_p))
        for xy, z in zip(centroids[:, :2], centroids[:, 2], strict=True):
            (_,) = [o for o in part.outlines if o.buffer(1e-9).contains(shapely.Point(xy))]
            assert part.height_at(xy[None])[0] == pytest.approx(z)


@each_variant
def test_canonical_theta_is_the_same_surface_and_idempotent(primitive):
    rng = np.random.default_rng(5)
    for shape, theta_p, kappa, translation in random_roofs(primitive):
        theta = shape.to_theta(theta_p, kappa + rng.uniform(-9, 9), translation)
        theta[HALF_WIDTH : HALF_WIDTH + 2] *= rng.uniform(0.7, 1.4, 2)
        canonical = shape.canonical_theta(theta)
        xy = translation[:2] + rng.uniform(-3, 3, (40, 2))
        np.testing.assert_allclose(
            shape.height_at(canonical, xy), shape.height_at(theta, xy), atol=1e-9
        )
        np.testing.assert_allclose(shape.canonical_theta(canonical), canonical, atol=1e-9)
        assert shape.part(canonical).pieces[0].outline.area == pytest.approx(
            shape.part(theta).pieces[0].outline.area
        )


def test_round_plans_have_the_area_of_their_ellipse():
    for kind in ("cone", "dome", "onion"):
        for width, length in ((1.5, 1.5), (7.0, 9.0), (40.0, 40.0)):
            theta_p = CATALOGUE[kind].typical(width, length, width / 3)
            shape = CATALOGUE[kind].variant(theta_p)
            assert compute_plan_area(shape, theta_p) == pytest.approx(np.pi / 4 * width * length)
            farthest = np.linalg.norm(np.array(shape.rim), axis=1).max() * length / 2
            assert farthest - length / 2 <= 0.1


@pytest.mark.parametrize("kind", ["dome", "barrel"])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.8, 1.0])
def test_vaults_hold_what_circular_arcs_do(kind, share):
    """A spherical cap over its circle, and a segment of a cylinder over its rectangle."""
    radius, length = 4.0, 11.0
    height = share * radius
    sphere = (radius**2 + height**2) / (2 * height)
    theta_p = {"width": 2 * radius, "length": 2 * radius, "height": height}
    if kind == "barrel":
        theta_p["length"] = length
    shape = CATALOGUE[kind].variant(theta_p)
    ring = shape.plan_rings(shape.to_theta(theta_p))[0]
    step = 0.02
    grid = np.arange(-6.0, 6.0, step) + step / 2
    xy = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    xy = xy[shapely.contains_xy(shapely.Polygon(ring), *xy.T)]
    volume = shape.height_at(shape.to_theta(theta_p), xy).sum() * step**2
    half_angle = np.arcsin(min(radius / sphere, 1.0))
    segment = sphere**2 * (half_angle - np.sin(half_angle) * np.cos(half_angle))
    true = np.pi * height * (3 * radius**2 + height**2) / 6 if kind == "dome" else segment * length
    assert volume == pytest.approx(true, rel=0.01)


@pytest.mark.parametrize(("height", "neck_height"), [(5.0, 3.0), (8.0, 3.0), (12.0, 4.5)])
@pytest.mark.parametrize("chord_m", [0.1, 0.03])
def test_an_onion_follows_its_two_curves(height, neck_height, chord_m):
    """A quarter ellipse from the eave to the neck, and a parabola from there to the apex."""
    radius, neck = 4.0, 0.4
    theta_p = {"width": 8.0, "length": 8.0, "height": height, "neck_height": neck_height}
    shape = CATALOGUE["onion"].refine(theta_p, chord_m)
    theta = shape.to_theta(theta_p)
    ((x0, y0), (x1, y1)) = np.min(shape.rim, axis=0) * radius, np.max(shape.rim, axis=0) * radius
    step = 0.02
    xy = np.stack(np.meshgrid(np.arange(x0, x1, step), np.arange(y0, y1, step)), -1).reshape(-1, 2)
    xy = xy[shapely.contains_xy(shapely.Polygon(shape.plan_rings(theta)[0]), *xy.T)]
    r = np.minimum(np.hypot(*xy.T) / radius, 1.0)
    line = neck_height / (1 - neck)
    top = line * (1 - r) + (height - line) * (1 - r / neck) ** 2
    bulge = neck_height * np.sqrt((1 - r**2) / (1 - neck**2))
    true, drawn = np.where(r < neck, top, bulge), shape.height_at(theta, xy)
    assert drawn.sum() == pytest.approx(true.sum(), rel=0.01)
    assert np.abs(drawn - true)[r < 0.8].mean() <= 0.03 * neck_height


def test_gable_is_the_papers_figure_3():
    vertices = CATALOGUE["gable"].vertices({"width": 8, "length": 12, "height": 3})
    expected = [(6, -4, 0), (-6, -4, 0), (-6, 0, 3), (6, 0, 3), (6, 4, 0), (-6, 4, 0)]
    np.testing.assert_array_equal(vertices, expected)
    one_based = [[i + 1 for i in face] for face in CATALOGUE["gable"].faces]
    assert one_based == [[4, 3, 2, 1], [3, 4, 5, 6]]


def test_unknown_type_is_named_with_the_known_ones():
    with pytest.raises(SettingsError, match=r"expected a roof type \(flat, .*onion\), got 'zome'"):
        get("zome")


def test_missing_parameter_is_named():
    with pytest.raises(FitError, match="none for height"):
        CATALOGUE["gable"].vertices({"width": 8, "length": 12})


def test_tooth_count_out_of_range_is_refused():
    with pytest.raises(FitError, match="2 to 6 teeth"):
        CATALOGUE["shed"].vertices({"width": 8, "length": 12, "height": 1, "teeth": 9})


@each_variant
def test_codes_bounds_and_signs_are_complete(primitive):
    assert primitive.citygml_code.isdigit() and primitive.adv_code.isdigit()
    assert set(primitive.signed) <= set(primitive.parameters)
    assert all(lower < upper for lower, upper in primitive.bounds)
    assert all(start.source in CATALOGUE for start in primitive.starts)
    assert all(len(start.q) == 1 + len(primitive.bounds) for start in primitive.starts)
