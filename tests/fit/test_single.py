"""fit_roof as its users meet it: laws of recovery and equivariance, evidence, and bad input."""

import numpy as np
import pytest
import shapely

from hiproof.errors import FitError, SettingsError
from hiproof.fit import fit_roof
from hiproof.primitives import CATALOGUE
from hiproof.settings import Settings
from points_of_roofs import sample_roof, typical_theta

NAMES = tuple(CATALOGUE)


def only(*types):
    return Settings.from_dict({"fit": {"types": types}})


@pytest.fixture(scope="module")
def gable_points():
    return sample_roof("gable", typical_theta("gable"), outlier_share=0.03)


@pytest.mark.parametrize("name", NAMES)
def test_a_generated_roof_is_recovered_with_its_type(name):
    theta = typical_theta(
        name, height=1.5 if name == "shed" else 3.0, teeth=3 if name == "shed" else None
    )
    fit = fit_roof(sample_roof(name, theta, density=6.0, teeth=3))
    assert fit.type == name
    truth = CATALOGUE[name].variant({"teeth": 3}) if name == "shed" else CATALOGUE[name]
    theta_p, kappa, translation = truth.from_theta(truth.canonical_theta(theta))
    for key, value in theta_p.items():
        assert fit.parameters[key] == pytest.approx(value, abs=0.35), key
    assert np.sin(fit.kappa - kappa) == pytest.approx(0, abs=0.02)
    np.testing.assert_allclose(fit.translation + fit.global_translation, translation, atol=0.2)
    assert fit.noise_m == pytest.approx(0.05, abs=0.03)


@pytest.mark.parametrize("name", ["hexagonal_spire", "broach"])
@pytest.mark.parametrize("seed", range(4))
def test_a_lone_spire_stands_on_a_regular_polygon(name, seed):
    """A hexagon is 15 % longer from corner to corner than across."""
    points = sample_roof(name, typical_theta(name, 7.0, 7.0, 9.0), density=8.0, seed=seed)
    fit = fit_roof(points)
    assert fit.type == name
    assert fit.parameters["width"] == pytest.approx(fit.parameters["length"], abs=1e-9)
    assert fit.parameters["width"] == pytest.approx(7.0, rel=0.04)
    assert fit.parameters["height"] / fit.parameters["width"] == pytest.approx(9.0 / 7.0, rel=0.02)


def test_errors_are_a_few_standard_deviations():
    theta = typical_theta("hip")
    truth, _, _ = CATALOGUE["hip"].from_theta(theta)
    scores = []
    for seed in range(20):
        fit = fit_roof(sample_roof("hip", theta, seed=seed), settings=only("hip"))
        scores.append(
            [(fit.parameters[key] - value) / fit.sigma[key] for key, value in truth.items()]
        )
    assert np.sqrt(np.mean(np.square(scores))) == pytest.approx(1.0, abs=0.5)


@pytest.mark.parametrize(("name", "seed"), [("gable", 0), ("hip", 0), ("corner_mansard", 1)])
def test_a_wide_steep_roof_among_outliers_keeps_its_type(name, seed):
    """Starts were too large where outliers lie around, and too far apart in slope: other
    types won.
    """
    width, length, height = (10.6, 22.0, 5.4) if name == "corner_mansard" else (11.8, 25.0, 5.9)
    theta = typical_theta(name, width, length, height, kappa=0.97)
    points = sample_roof(name, theta, density=5.0, noise_m=0.08, outlier_share=0.05, seed=seed)
    assert fit_roof(points).type == name


def test_a_gable_is_one_wherever_its_ridge_lies():
    offset = CATALOGUE["gable"].variant({"width": 0, "length": 0, "height": 0, "ridge_offset": 0})
    truth = {"width": 9.0, "length": 13.0, "height": 3.5, "ridge_offset": 1.2}
    theta = offset.to_theta(truth, 0.4, np.array([0.6, -0.3, 5.0]))
    rng = np.random.default_rng(0)
    uv = rng.uniform((-6.5, -4.5), (6.5, 4.5), (700, 2))
    c, s = np.cos(0.4), np.sin(0.4)
    xy = uv @ np.array([[c, s], [-s, c]]) + theta[:2]
    fit = fit_roof(
        np.column_stack([xy, offset.height_at(theta, xy) + rng.normal(0, 0.05, len(xy))])
    )
    assert fit.type == "gable" and fit.parameters == pytest.approx(truth, abs=0.15)


def test_order_of_points_does_not_matter(gable_points):
    shuffled = np.random.default_rng(0).permutation(gable_points)
    first, second = fit_roof(gable_points), fit_roof(shuffled)
    assert first.parameters == second.parameters and first.bics == second.bics
    np.testing.assert_array_equal(first.vertices, second.vertices)


@pytest.mark.parametrize("name", ["gable", "hip", "half_hip"])
def test_the_fit_moves_with_the_points(name):
    points = sample_roof(name, typical_theta(name))
    shift = np.array([1e7, -1e7, 500.0])
    moved = fit_roof(points + shift)
    unmoved = fit_roof(points)
    np.testing.assert_allclose(moved.vertices - shift, unmoved.vertices, atol=2e-3)


@pytest.mark.parametrize("name", ["gable", "hip", "half_hip"])
def test_the_fit_turns_with_the_points(name):
    points = sample_roof(name, typical_theta(name))
    c, s = np.cos(1.1), np.sin(1.1)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    unturned, turned = fit_roof(points), fit_roof(points @ turn)
    assert turned.type == unturned.type
    assert turned.parameters == pytest.approx(unturned.parameters, abs=0.02)
    np.testing.assert_allclose(
        shapely.centroid(shapely.MultiPoint(turned.vertices[:, :2])).coords[0],
        (unturned.vertices @ turn)[:, :2].mean(axis=0),
        atol=0.02,
    )


def test_outline_gives_the_plan_and_only_heights_are_fitted():
    theta = typical_theta("gable", kappa=0.4)
    points = sample_roof("gable", theta, density=4.0)
    plan = CATALOGUE["gable"].part(theta).pieces[0].outline.buffer(0.8, join_style="mitre")
    outliers = np.random.default_rng(2).uniform(-12, 12, (60, 3))
    fit = fit_roof(np.vstack([points, outliers]), plan, only("gable"))
    assert fit.parameters["width"] == pytest.approx(8 + 1.6, abs=0.02)
    assert fit.parameters["length"] == pytest.approx(13 + 1.6, abs=0.02)
    assert fit.parameters["height"] / (fit.parameters["width"] / 2) == pytest.approx(0.75, abs=0.03)
    assert fit.sigma["width"] == 0
    assert fit.points_used < len(points) + 60


def test_what_points_do_not_tell_has_no_deviation(gable_points):
    level = np.column_stack([gable_points[:, :2], np.full(len(gable_points), 5.0)])
    flat = fit_roof(level, settings=only("flat"))
    assert "kappa" not in flat.sigma and 0.0 < flat.sigma["width"] < 0.5
    plan = shapely.box(*gable_points[:, :2].min(axis=0), *gable_points[:, :2].max(axis=0))
    gambrel = fit_roof(gable_points, plan, only("gambrel"))  # a gable has no break
    assert max(gambrel.sigma.values()) < 100.0


def test_height_at_and_vertices_agree(gable_points):
    fit = fit_roof(gable_points)
    inside = fit.vertices.mean(axis=0) + 0.98 * (fit.vertices - fit.vertices.mean(axis=0))
    heights = fit.height_at(inside[:, :2])
    assert np.abs(heights - fit.vertices[:, 2]).max() < 0.2
    assert np.isnan(fit.height_at(np.array([[1e3, 1e3]]))).all()


def test_weights_take_a_tree_out_of_the_roof():
    theta = typical_theta("gable", kappa=0.0)
    roof = sample_roof("gable", theta)
    tree = np.random.default_rng(3).normal((8.0, 0.0, 6.0), (1.0, 2.0, 1.0), (150, 3))
    weights = np.concatenate([np.ones(len(roof)), np.full(len(tree), 0.01)])
    fit = fit_roof(np.vstack([roof, tree]), weights=weights)
    assert fit.type == "gable"
    assert fit.parameters["length"] == pytest.approx(13.0, abs=0.2)


def test_log_prior_decides_between_what_points_cannot():
    level = sample_roof("flat", typical_theta("flat"), density=1.0)
    assert fit_roof(level, settings=only("flat", "gable")).type == "flat"
    prior = {"gable": 0.0, "flat": -1e4}
    assert fit_roof(level, settings=only("flat", "gable"), type_log_prior=prior).type == "gable"


def test_types_narrow_the_choice(gable_points):
    fit = fit_roof(gable_points, settings=only("half_hip", "flat"))
    assert set(fit.bics) <= {"half_hip", "flat"}


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_too_few_points_are_one_sentence(count):
    with pytest.raises(
        FitError, match=f"expected at least 4 finite points .* got {count} of {count}"
    ):
        fit_roof(np.arange(3.0 * count).reshape(-1, 3) ** 2)


@pytest.mark.parametrize("count", [4, 5, 8])
def test_four_points_and_more_have_a_fit(count):
    points = sample_roof("flat", typical_theta("flat"), density=1.0)[:count]
    assert np.isfinite(fit_roof(points).vertices).all()


def test_coincident_points_are_refused():
    with pytest.raises(FitError, match="20 points in one place"):
        fit_roof(np.tile([5.0, 6.0, 7.0], (20, 1)))


def test_points_on_a_line_are_refused():
    line = np.linspace(0, 10, 30)[:, None] * [1.0, 2.0, 0.1]
    with pytest.raises(FitError, match="30 points on one line"):
        fit_roof(line)


def test_points_that_are_not_finite_are_dropped(gable_points):
    spoilt = np.vstack([gable_points, [[np.nan, 0, 0], [0, np.inf, 0], [0, 0, -np.inf]]])
    fit = fit_roof(spoilt)
    assert fit.points_used == len(gable_points)
    assert fit.parameters == fit_roof(gable_points).parameters
    with pytest.raises(FitError, match="got 0 of 9 given"):
        fit_roof(np.full((9, 3), np.nan))


def test_wrong_shapes_names_and_weights_are_refused(gable_points):
    with pytest.raises(FitError, match=r"shape \(n, 3\)"):
        fit_roof(gable_points[:, :2])
    with pytest.raises(FitError, match="weights between 0 and 1"):
        fit_roof(gable_points, weights=np.full(len(gable_points), 2.0))
    with pytest.raises(SettingsError, match="expected a roof type"):
        fit_roof(gable_points, settings=only("igloo"))
    with pytest.raises(SettingsError, match="one of likelihood, paper"):
        fit_roof(gable_points, settings=Settings.from_dict({"fit": {"objective": "magic"}}))


def test_points_none_of_which_may_be_roof_are_refused(gable_points):
    with pytest.raises(FitError, match="got 0 of"):
        fit_roof(gable_points, weights=np.zeros(len(gable_points)))


@pytest.mark.parametrize(
    "outline", [shapely.MultiPolygon([shapely.box(-6, -4, 6, 4)]), "POLYGON EMPTY"]
)
def test_an_outline_that_is_no_polygon_is_refused(gable_points, outline):
    with pytest.raises(FitError, match="expected a polygon of shapely as outline"):
        fit_roof(gable_points, outline)


def test_an_outline_without_points_is_refused(gable_points):
    with pytest.raises(FitError, match="inside the outline"):
        fit_roof(gable_points, outline=shapely.box(100, 100, 110, 110))
