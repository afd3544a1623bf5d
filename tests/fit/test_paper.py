"""The paper's objective: its terms against plain formulas, and roofs it must find again."""

import math

import numpy as np
import pytest
import shapely

from hiproof.errors import FitError
from hiproof.fit.paper import BETA, PaperFit, fit_paper, outline_misfit, plane_distances
from hiproof.frames import LocalFrame
from hiproof.geometry.alpha_shape import alpha_shape
from hiproof.primitives import CATALOGUE
from hiproof.simulate import random_building, uniform_points


def dense_points(kind, seed=0, density=6.0, noise=0.02):
    rng = np.random.default_rng(seed)
    building = random_building(rng, kind)
    return building, uniform_points(building, rng, density, noise)


def test_plane_distances_equal_the_plane_equation():
    primitive = CATALOGUE["hip"]
    vertices = primitive.vertices({"width": 8, "length": 12, "height": 3, "ridge_length": 5})
    points = np.random.default_rng(0).normal(0, 3, (20, 3))
    for face, distances in zip(
        primitive.faces, plane_distances(points, vertices, primitive.faces), strict=True
    ):
        a, b, c = vertices[list(face[:3])]
        normal = np.cross(b - a, c - a)
        np.testing.assert_allclose(
            np.abs(distances), np.abs((points - a) @ normal) / np.linalg.norm(normal), atol=1e-9
        )


def test_outline_misfit_is_one_minus_iou():
    square = np.array([[0.0, 0, 1], [2, 0, 1], [2, 2, 1], [0, 2, 1], [1, 1, 3]])
    assert outline_misfit(square, shapely.box(0, 0, 2, 2)) == pytest.approx(0)
    assert outline_misfit(square, shapely.box(1, 0, 3, 2)) == pytest.approx(1 - 2 / 6)


def test_objective_is_j1_plus_beta_j2():
    _, points = dense_points("gable")
    xyz = LocalFrame.around(points).to_local(points)
    fitted = PaperFit(CATALOGUE["gable"], xyz, alpha_shape(xyz[:, :2]))
    vertices = fitted.vertices(fitted.theta)
    j1 = np.mean(
        [
            min(abs(d) for d in column)
            for column in plane_distances(xyz, vertices, CATALOGUE["gable"].faces).T
        ]
    )
    assert fitted.objective(fitted.theta) == pytest.approx(
        j1 + BETA * outline_misfit(vertices, fitted.boundary)
    )


@pytest.mark.parametrize("kind", ["gable", "hip", "pyramid"])
def test_finds_the_roofs_of_the_paper_again(kind):
    building, points = dense_points(kind, seed=3)
    fit = fit_paper(points, [kind], outline=building.footprint)
    truth = building.roof.parts[0]
    for name, value in truth.parameters.items():
        assert fit.parameters[name] == pytest.approx(value, abs=0.12)
    centre = fit.translation + fit.global_translation
    np.testing.assert_allclose(centre, truth.translation, atol=0.1)
    assert abs(math.sin(2 * (fit.kappa - truth.kappa))) < 0.03
    assert fit.objective == "paper" and fit.bics == {kind: fit.value} and fit.noise_m < 0.1


def test_parameters_reproduce_the_vertices():
    _, points = dense_points("hip", seed=1, density=3)
    fit = fit_paper(points + [85000, 446000, 10], ["hip"])
    heights = fit.height_at(fit.vertices[2:4, :2])
    np.testing.assert_allclose(heights, fit.vertices[2:4, 2], atol=1e-6)


def test_the_smallest_j_decides_between_types():
    _, points = dense_points("pyramid", seed=2, density=3)
    fit = fit_paper(points, ["flat", "pyramid"])
    assert fit.type == "pyramid" and fit.bics["pyramid"] < fit.bics["flat"]


def test_every_primitive_starts_as_a_roof_with_a_finite_objective():
    _, points = dense_points("gable", density=3)
    xyz = LocalFrame.around(points).to_local(points)
    boundary = alpha_shape(xyz[:, :2])
    for primitive in CATALOGUE.values():
        for variant in primitive.variants:
            fitted = PaperFit(variant, xyz, boundary)
            assert math.isfinite(fitted.objective(fitted.theta)) and fitted.is_roof(fitted.theta), (
                variant.name
            )


@pytest.mark.parametrize(
    "points",
    [
        np.empty((0, 3)),
        np.ones((3, 3)),
        np.ones((20, 3)),
        np.arange(30.0).reshape(10, 3),
        np.full((9, 3), np.nan),
    ],
    ids=["none", "three", "coincident", "collinear", "nan"],
)
def test_points_without_area_are_refused(points):
    with pytest.raises(FitError, match="expected"):
        fit_paper(points, ["gable"])
