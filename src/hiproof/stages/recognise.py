"""The network's opinion of a building, where it is asked for one."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import FitError
from ..settings import Settings


@dataclass(frozen=True)
class Recognised:
    """The network's opinion: probabilities by roof type, empty without it, and point weights.

    Weights (n,) are 1 for a roof and 0 else, for a fit of one primitive; a fit of several weighs
    all points alike.
    """

    weights: np.ndarray | None = None
    types: dict[str, float] = field(default_factory=dict)


def fits_one(settings: Settings) -> bool:
    """Return whether one primitive is fitted to a building, as in the paper."""
    return settings.fit.parts == "one" or settings.fit.objective == "paper"


def asks_network(settings: Settings) -> bool:
    """Return whether the network is used: with `auto` only to fit one primitive."""
    network = settings.segment.network
    return network == "always" or (network == "auto" and fits_one(settings))


def recognise(points: np.ndarray, settings: Settings) -> Recognised:
    """Return the network's opinion (paper section 3.1), none if unheeded or it cannot tell."""
    if not asks_network(settings):
        return Recognised()
    from ..segment import segment

    try:
        result = segment(points, settings)
    except FitError:
        return Recognised()
    return Recognised(result.weights if fits_one(settings) else None, result.types)
