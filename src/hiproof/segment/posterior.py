"""Prior times evidence: the network's probabilities and the fits' BIC into the posterior of the roof type."""

from __future__ import annotations

import numpy as np

# Calibrated on simulated buildings of 1-10 points/m2 (`benchmarks/segment.py --calibrate`): both sources are tempered,
# since points share their errors (occlusion, clutter) and are no independent witnesses.
PRIOR_EXPONENT = 1.0
EVIDENCE_EXPONENT = 0.1
SMALLEST_PRIOR = 1e-4


def combine(
    types: dict[str, float],
    bics: dict[str, float],
    prior_exponent: float = PRIOR_EXPONENT,
    evidence_exponent: float = EVIDENCE_EXPONENT,
) -> dict[str, float]:
    """Posterior probability of every roof type that was fitted, best first.

    `types` the network's probability by type, `bics` by type from `Fit.bics` (lower is better, on the scale of twice a
    negative log-likelihood); posterior proportional to prior^a exp(-BIC / 2)^b. A type the network does not know gets
    the mean prior; a BIC that is not finite rules its type out. Empty `bics` give the prior itself.

    >>> combine({"gable": 0.5, "hip": 0.5}, {"gable": 100.0, "hip": 160.0})["gable"] > 0.9
    True
    """
    if not bics:
        return dict(types)
    names = [name for name, bic in bics.items() if np.isfinite(bic)] or list(bics)
    prior = log_prior(types, tuple(names))
    bic = np.array([bics[name] if np.isfinite(bics[name]) else 0.0 for name in names])
    log_posterior = prior_exponent * np.array([prior[name] for name in names]) - evidence_exponent * 0.5 * bic
    posterior = np.exp(log_posterior - log_posterior.max())
    posterior /= posterior.sum()
    ranked = np.argsort(-posterior, kind="stable")
    return {names[i]: float(posterior[i]) for i in ranked}


def log_prior(types: dict[str, float], names: tuple[str, ...] = ()) -> dict[str, float]:
    """Natural logarithm of the network's probability of each of `names` (all of `types` by default), bounded below.

    A network may be wrong with confidence; no evidence could undo a prior of zero.
    """
    mean_prior = 1.0 / max(len(types), 1)
    return {name: float(np.log(max(types.get(name, mean_prior), SMALLEST_PRIOR))) for name in names or tuple(types)}


def fit_prior(types: dict[str, float]) -> dict[str, float]:
    """Log prior on the scale of `fit_roof(type_log_prior=...)`: its choice is then the best of `combine`."""
    return {name: PRIOR_EXPONENT / EVIDENCE_EXPONENT * value for name, value in log_prior(types).items()}
