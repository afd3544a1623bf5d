"""Prior times evidence."""

import numpy as np
import pytest

from hiproof.segment import combine, fit_prior
from hiproof.segment.posterior import EVIDENCE_EXPONENT, SMALLEST_PRIOR

TYPES = {"gable": 0.6, "hip": 0.3, "flat": 0.1}


def test_equal_evidence_leaves_the_prior():
    posterior = combine(TYPES, dict.fromkeys(TYPES, 100.0), prior_exponent=1.0)
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


def test_fit_prior_chooses_as_combine_does():
    rng = np.random.default_rng(1)
    for _ in range(50):
        prior = dict(zip("abcde", rng.dirichlet(np.ones(5)), strict=True))
        bics = {name: rng.normal(0, 20) for name in prior}
        log_prior = fit_prior(prior)
        chosen = min(prior, key=lambda name: bics[name] / 2 - log_prior[name])
        assert chosen == next(iter(combine(prior, bics)))


def test_a_zero_probability_is_bounded_so_that_evidence_can_undo_it():
    needed = -2 * np.log(SMALLEST_PRIOR) / EVIDENCE_EXPONENT * 10
    assert next(iter(combine({"gable": 1.0, "hip": 0.0}, {"gable": needed, "hip": 0.0}))) == "hip"


def test_types_without_evidence_or_without_prior():
    assert combine(TYPES, {}) == TYPES
    assert set(combine(TYPES, {"gable": 1.0, "cone": 1.0})) == {"gable", "cone"}
    assert set(combine(TYPES, {"gable": 1.0, "hip": float("inf")})) == {"gable"}
    assert sum(combine(TYPES, {"gable": float("inf"), "hip": float("nan")}).values()) == pytest.approx(1.0)
