"""Prior times evidence: the posterior of the roof type.

The prior is the network's probabilities, the evidence the fits' BIC. A type that the network does
not know has the first one that it knows of the same CityGML code.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ..model import Fit
from collections.abc import Iterable

from ..primitives import CATALOGUE

# Calibrated on simulated buildings of 2-10 points/m2 and on scanned real shapes (`python -m
# benchmarks.segment --calibrate`). The evidence is tempered because it counts the points as
# independent and the roof as exactly of its type, and real roofs are neither.
EVIDENCE_EXPONENT = 0.1
SMALLEST_PRIOR = 1e-4  # probability; the network is never so sure that evidence cannot overrule it
# A type missing from the BICs was given up by the fit as far behind. How far is not known, and an
# annex or a dormer alone can set a type back so much that it says little: it counts as this many
# nats behind the best.
GIVEN_UP_NATS, GIVEN_UP_NATS_A_POINT = 2.0, 0.006
# The network may name a roof against the evidence, but a shape that lies farther from the points
# than the evidence's by more than this is not built: a gable over a house and its porch is named so
# and fits neither.
FARTHER_AT_MOST_M = 0.01
OUTLIER_DISTANCE_M = 1.0  # m from the roof at which an outlier is counted when fits are compared


def combine(
    types: dict[str, float],
    bics: dict[str, float],
    points: int = 0,
    evidence_exponent: float = EVIDENCE_EXPONENT,
) -> dict[str, float]:
    """Return the posterior probability of every roof type, best first.

    `types` the network's probability by type, `bics` by type from `Fit.bics` (lower is better, on
    the scale of twice a negative log-likelihood, without a prior in them) of a fit to `points`
    points; posterior proportional to prior * exp(-BIC / 2)^b. A type the fit gave up gets a BIC
    some way behind the best; one the network does not know the prior of the nearest that it does;
    one of probability 0 that was not fitted is left out. Without finite `bics` the prior is the
    posterior, and without `types` the evidence alone counts.

    >>> combine({"gable": 0.5, "hip": 0.5}, {"gable": 100.0, "hip": 260.0})["gable"] > 0.9
    True
    """
    finite_bics = {name: bic for name, bic in bics.items() if np.isfinite(bic)}
    names = [name for name in types if types[name] > 0 or name in finite_bics]
    names += [name for name in finite_bics if name not in types]
    if not names:
        return {}
    if not finite_bics or not types:
        evidence_exponent = 0.0 if types else 1.0
    behind = 2 * (GIVEN_UP_NATS + GIVEN_UP_NATS_A_POINT * points)
    given_up = min(finite_bics.values(), default=0.0) + behind
    bic = np.array([finite_bics.get(name, given_up) for name in names])
    prior = np.array(list(log_prior(types, names).values()))
    posterior = softmax(prior - evidence_exponent * bic / 2)
    ranked = np.argsort(-posterior, kind="stable")
    return {names[i]: float(posterior[i]) for i in ranked}


def softmax(logits: np.ndarray) -> np.ndarray:
    """Return probabilities along the last axis, in float64."""
    shifted = np.exp(np.asarray(logits, float) - logits.max(axis=-1, keepdims=True))
    return shifted / shifted.sum(axis=-1, keepdims=True)


def log_prior(types: dict[str, float], names: Iterable[str] = ()) -> dict[str, float]:
    """Return the natural logarithm of the network's probabilities.

    They are those of `names` (all of `types` by default), of the nearest type for one that the
    network does not know, or the mean. They are bounded below: a network may be wrong with
    confidence, and no evidence could undo a prior of zero.
    """
    mean = 1.0 / max(len(types), 1)
    priors = {name: types.get(find_nearest_type(name, types), mean) for name in names or types}
    return {name: float(np.log(max(p, SMALLEST_PRIOR))) for name, p in priors.items()}


def choose_most_probable(
    fit: Callable[[tuple[str, ...]], Fit], types: dict[str, float]
) -> tuple[Fit, dict[str, float]]:
    """Return the fit to build, and the posterior by type, best first.

    It is the fit of the type with the highest posterior, unless its roof lies clearly farther from
    the points than the most evident one: then that. (By the paper's objective, which knows no
    outliers, the type decides.) `fit` fits a roof of the types named (empty: all of them), such as
    `fit_roof` with its points bound; it is called a second time only where the network disagrees
    with the evidence.
    """
    result = fit(())
    posterior = combine(types, result.bics, result.points_used)
    best = next(iter(posterior))
    if best == result.type:
        return result, posterior
    names = fit((best,))
    farther = expected_distance(names) - expected_distance(result)
    keeps_name = names.objective == "paper" or farther <= FARTHER_AT_MOST_M
    return (names if keeps_name else result), posterior


def expected_distance(fit: Fit) -> float:
    """Return the mean distance (m) of points that a fit expects by noise and outliers."""
    on_roof = np.sqrt(2 / np.pi) * fit.noise_m  # mean of the absolute value of a normal
    return (1 - fit.outlier_share) * on_roof + fit.outlier_share * OUTLIER_DISTANCE_M


def find_nearest_type(name: str, known_types: Iterable[str]) -> str:
    """Return `name`, or the first of the `known_types` with its code.

    `name` also where there is none.

    >>> find_nearest_type("side_hip", ("gable", "hip", "pyramid")), find_nearest_type("shed",
    ...     ("gable", "hip"))
    ('hip', 'shed')
    """
    codes = {other: CATALOGUE[other].citygml_code for other in known_types if other in CATALOGUE}
    if name in codes or name not in CATALOGUE:
        return name
    code = CATALOGUE[name].citygml_code
    return next((other for other in codes if codes[other] == code), name)
