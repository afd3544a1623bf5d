"""Prior times evidence."""

import numpy as np
import pytest

from hiproof.segment import choose_most_probable, combine
from hiproof.segment.posterior import (
    EVIDENCE_EXPONENT,
    OUTLIER_DISTANCE_M,
    SMALLEST_PRIOR,
    expected_distance,
)

TYPES = {"gable": 0.6, "hip": 0.3, "flat": 0.1}


def test_equal_evidence_leaves_the_prior():
    posterior = combine(TYPES, dict.fromkeys(TYPES, 100.0))
    assert posterior == pytest.approx(TYPES)


def test_strong_evidence_overrules_the_prior():
    assert next(iter(combine(TYPES, {"gable": 5000.0, "hip": 5000.0, "flat": 100.0}))) == "flat"


def test_posterior_is_a_distribution_best_first():
    rng = np.random.default_rng(0)
    for _ in range(50):
        prior = dict(zip("abcde", rng.dirichlet(np.ones(5)), strict=True))
        posterior = combine(prior, {name: rng.normal(0, 200) for name in prior})
        assert sum(posterior.values()) == pytest.approx(1.0)
        assert list(posterior.values()) == sorted(posterior.values(), reverse=True)


def test_adding_a_constant_to_all_bics_changes_nothing():
    bics = {"gable": 10.0, "hip": 14.0, "flat": 90.0}
    shifted = {name: bic + 1e4 for name, bic in bics.items()}
    assert combine(TYPES, bics) == pytest.approx(combine(TYPES, shifted))


def test_a_zero_probability_is_bounded_so_that_evidence_can_undo_it():
    evidence = -2 * np.log(SMALLEST_PRIOR) / EVIDENCE_EXPONENT * 10
    assert next(iter(combine({"gable": 1.0, "hip": 0.0}, {"gable": evidence, "hip": 0.0}))) == "hip"


def test_types_without_evidence_or_without_prior():
    assert combine(TYPES, {}) == pytest.approx(TYPES)
    assert combine(TYPES, {"gable": float("inf"), "hip": float("nan")}) == pytest.approx(TYPES)
    assert set(combine(TYPES, {"gable": 1.0, "cone": 1.0})) == {*TYPES, "cone"}
    assert combine({}, {"gable": 10.0, "hip": 10.0}) == pytest.approx({"gable": 0.5, "hip": 0.5})
    assert combine({}, {}) == {}


def test_a_type_the_fit_gave_up_is_behind_the_best_but_its_evidence_says_little():
    bics = {"gable": 0.0, "hip": 4.0}
    even = dict.fromkeys(TYPES, 1 / 3)
    assert list(combine(even, bics, points=200)) == ["gable", "hip", "flat"]
    assert (
        next(iter(combine({"flat": 0.99, "gable": 0.005, "hip": 0.005}, bics, points=200)))
        == "flat"
    )
    many_points = combine(even, bics, points=2000)["flat"]
    few_points = combine(even, bics, points=20)["flat"]
    assert many_points < few_points


class FakeFit:
    """What `choose_most_probable` needs of a fit."""

    points_used = 100

    def __init__(self, names, noise_m=0.05, outlier_share=0.0, objective="likelihood"):
        self.type, self.bics = (
            (names[0], {names[0]: 50.0}) if names else ("gable", {"gable": 0.0, "hip": 8.0})
        )
        self.noise_m, self.outlier_share, self.objective = noise_m, outlier_share, objective


def test_most_probable_fits_again_only_where_the_network_disagrees_with_the_evidence():
    requests = []

    def fit(names):
        requests.append(names)
        return FakeFit(names)

    choice, posterior = choose_most_probable(fit, {"gable": 0.9, "hip": 0.1})
    assert choice.type == "gable" == next(iter(posterior)) and requests == [()]
    choice, posterior = choose_most_probable(fit, {"gable": 0.01, "hip": 0.99})
    assert choice.type == "hip" == next(iter(posterior)) and requests == [(), (), ("hip",)]


@pytest.mark.parametrize("worse", [{"noise_m": 0.09}, {"outlier_share": 0.05}])
def test_a_named_type_far_from_the_points_is_not_built(worse):
    def fit(names):
        return FakeFit(names, **(worse if names else {}))

    choice, posterior = choose_most_probable(fit, {"gable": 0.01, "hip": 0.99})
    assert next(iter(posterior)) == "hip" and choice.type == "gable"


def test_with_the_papers_objective_the_named_type_is_built():
    def fit(names):
        return FakeFit(names, noise_m=0.9 if names else 0.5, objective="paper")

    choice, _ = choose_most_probable(fit, {"gable": 0.01, "hip": 0.99})
    assert choice.type == "hip"


def test_expected_distance_is_the_mean_over_noise_and_outliers():
    distances = np.abs(np.random.default_rng(0).normal(0, 0.05, 100_000))
    assert expected_distance(FakeFit(())) == pytest.approx(distances.mean(), rel=0.01)
    assert expected_distance(FakeFit((), outlier_share=1.0)) == OUTLIER_DISTANCE_M
