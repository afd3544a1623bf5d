"""Laws every shape of the catalogue obeys; a new shape inherits them by its catalogue line."""

import numpy as np
import pytest
import shapely

from hiproof.errors import FitError, SettingsError
from hiproof.primitives import CATALOGUE, get
from hiproof.primitives.algebra import SYMBOLS, U, V, formula, q0, q1, q2
from hiproof.primitives.contract import HALF_WIDTH, place_vertices

VARIANTS = [variant for primitive in CATALOGUE.values() for variant in primitive.variants]
IDS = [f"{variant.name}-{len(variant.parameters)}-{variant.strips}" for variant in VARIANTS]
each_variant = pytest.mark.parametrize("primitive", VARIANTS, ids=IDS)


def random_roofs(primitive, count=20, seed=3):
    """(theta_p, kappa, T_L) of ordinary roofs: typical proportions, each length varied by a
    tenth.
    """
    rng = np.random.default_rng(seed)
    for _ in range(count):
        width = rng.uniform(6, 12)
        theta_p = primitive.typical(width, width * rng.uniform(1.2, 2.5), rng.uniform(1.5, 4))
        theta_p = {
            k: v if k == "teeth" else v * rng.uniform(0.95, 1.05) for k, v in theta_p.items()
        }
        yield theta_p, rng.uniform(-1.5, 1.5), rng.normal(0, 20, 3)


def plane_by_svd(polygon):
    """(a, b, c) of z = a x + b y + c through a planar polygon's vertices (n, 3)."""
    centre = polygon.mean(axis=0)
    normal = np.linalg.svd(polygon - centre)[2][2]
    a, b = -normal[:2] / normal[2]
    return np.array([a, b, centre[2] - a * centre[0] - b * centre[1]])


@each_variant
def test_planes_of_the_term_table_are_those_of_the_vertices(primitive):
    for theta_p, _, _ in random_roofs(primitive):
        vertices = primitive.vertices(theta_p)
        planes = primitive.plane_values(primitive.to_theta(theta_p))
        assert len(planes) == len(primitive.faces)
        for face, plane in zip(primitive.faces, planes, strict=True):
            np.testing.assert_allclose(plane_by_svd(vertices[list(face)]), plane, atol=1e-9)


@each_variant
def test_theta_and_named_parameters_are_inverse(primitive):
    for theta_p, kappa, translation in random_roofs(primitive):
        theta = primitive.to_theta(theta_p, kappa, translation)
        parameters, kappa_back, translation_back = primitive.from_theta(theta)
        assert parameters == pytest.approx(theta_p)
        assert kappa_back == pytest.approx(kappa)
        np.testing.assert_allclose(translation_back, translation, atol=1e-9)
        assert primitive.is_proper(theta)


@each_variant
def test_faces_tile_the_plan_counter_clockwise_with_eave_at_zero(primitive):
    for theta_p, _, _ in random_roofs(primitive):
        vertices = primitive.vertices(theta_p)
        rings = [shapely.LinearRing(vertices[list(face), :2]) for face in primitive.faces]
        assert all(ring.is_ccw for ring in rings)
        areas = sum(shapely.Polygon(ring).area for ring in rings)
        assert areas == pytest.approx(theta_p["width"] * theta_p["length"])
        assert shapely.union_all([shapely.Polygon(ring) for ring in rings]).area == pytest.approx(
            areas
        )
        assert vertices[:, 2].min() == 0
        np.testing.assert_allclose(
            (vertices[:, :2].min(axis=0) + vertices[:, :2].max(axis=0)) / 2, 0, atol=1e-12
        )


@each_variant
def test_vertices_lie_on_the_surface_and_on_the_part(primitive):
    for theta_p, kappa, translation in random_roofs(primitive, 5):
        theta = primitive.to_theta(theta_p, kappa, translation)
        vertices = primitive.vertices(theta_p)
        inside = [np.mean(vertices[list(face)], axis=0) for face in primitive.faces]
        centroids = place_vertices(np.array(inside), kappa, translation)
        np.testing.assert_allclose(
            primitive.height_at(theta, centroids[:, :2]), centroids[:, 2], atol=1e-9
        )
        part = primitive.part(theta)
        assert part.type == primitive.name
        assert part.area == pytest.approx(theta_p["width"] * theta_p["length"])
        for xy, z in zip(centroids[:, :2], centroids[:, 2], strict=True):
            (piece,) = [
                piece
                for piece in part.pieces
                if piece.outline.buffer(1e-9).contains(shapely.Point(xy))
            ]
            assert piece.height_at(xy[None])[0] == pytest.approx(z)


@each_variant
def test_canonical_theta_is_the_same_surface_and_idempotent(primitive):
    rng = np.random.default_rng(5)
    for theta_p, kappa, translation in random_roofs(primitive):
        theta = primitive.to_theta(theta_p, kappa + rng.uniform(-9, 9), translation)
        theta[HALF_WIDTH : HALF_WIDTH + 2] *= rng.uniform(0.7, 1.4, 2)
        canonical = primitive.canonical_theta(theta)
        xy = translation[:2] + rng.uniform(-3, 3, (40, 2))
        np.testing.assert_allclose(
            primitive.height_at(canonical, xy), primitive.height_at(theta, xy), atol=1e-9
        )
        np.testing.assert_allclose(primitive.canonical_theta(canonical), canonical, atol=1e-9)
        assert primitive.part(canonical).pieces[0].outline.area == pytest.approx(
            primitive.part(theta).pieces[0].outline.area
        )


@each_variant
def test_codes_bounds_and_signs_are_complete(primitive):
    assert primitive.citygml_code.isdigit() and primitive.adv_code.isdigit()
    assert set(primitive.signed) <= set(primitive.parameters)
    assert all(lower < upper for lower, upper in primitive.bounds)
    assert all(start.source in CATALOGUE for start in primitive.starts)
    assert all(len(start.q) == 1 + len(primitive.bounds) for start in primitive.starts)


def test_gable_is_the_papers_figure_3():
    vertices = CATALOGUE["gable"].vertices({"width": 8, "length": 12, "height": 3})
    expected = [(6, -4, 0), (-6, -4, 0), (-6, 0, 3), (6, 0, 3), (6, 4, 0), (-6, 4, 0)]
    np.testing.assert_array_equal(vertices, expected)
    one_based = [[i + 1 for i in face] for face in CATALOGUE["gable"].faces]
    assert one_based == [[4, 3, 2, 1], [3, 4, 5, 6]]


def test_hip_whose_axes_are_exchanged_is_the_same_hip():
    hip = CATALOGUE["hip"]
    theta = np.array([1.0, 2.0, 0.3, 6.0, 4.0, 9.0, 0.8, 0.7, 0.0])
    assert not hip.is_proper(theta)
    turned = hip.canonical_theta(theta)
    assert hip.is_proper(turned)
    assert hip.from_theta(turned)[0]["height"] == pytest.approx(0.7 * 4)


def test_formula_gradient_equals_the_numeric_one():
    expression = (2 * V - q1 * V / q2) * q0 + 3 - U * U / V
    shape = np.array([3.0, 5.0, 2.0, 0.7, 0.9, 0.4])
    for k in range(len(SYMBOLS)):
        step = np.eye(6)[k] * 1e-6
        numeric = (expression(*(shape + step)) - expression(*(shape - step))) / 2e-6
        assert expression.gradient(shape)[k] == pytest.approx(numeric, abs=1e-7)


def test_formula_cancels_and_divides_by_monomials_only():
    assert (V - V).terms == ()
    assert formula(0).terms == ()
    with pytest.raises(ValueError):
        V / (q1 + q2)


def test_unknown_type_is_named_with_the_known_ones():
    with pytest.raises(
        SettingsError, match=r"expected a roof type \(flat, .*corner_mansard\), got 'onion'"
    ):
        get("onion")


def test_missing_parameter_is_named():
    with pytest.raises(FitError, match="none for height"):
        CATALOGUE["gable"].vertices({"width": 8, "length": 12})


def test_tooth_count_out_of_range_is_refused():
    with pytest.raises(FitError, match="2 to 6 teeth"):
        CATALOGUE["shed"].vertices({"width": 8, "length": 12, "height": 1, "teeth": 9})
