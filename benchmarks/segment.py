"""Roof types by the network, by the fit and by both.

usage: python -m benchmarks.segment [--count 600] [--densities 2 5 10] [--calibrate]

Roofs of all types are scanned by simulation with all of the scanner's defects. Printed: balanced
accuracies in per cent. `--calibrate` prints instead how the exponents of `hiproof.segment.combine`
change that of both, on buildings of another seed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from hiproof.errors import FitError
from hiproof.fit import fit_roof
from hiproof.segment import combine, segment
from hiproof.segment.scores import Scores
from hiproof.settings import Settings
from hiproof.simulate import ROOF_TYPES

from .samples import draw_sample
from .tables import FigureTable, make_parser

TYPES = ROOF_TYPES
TEST_SEED = 2024
METHODS = ("network alone", "fit alone", "combined")


@dataclass
class Tally:
    """Truths and answers of many buildings, by method, as indices of TYPES."""

    truth: list[int] = field(default_factory=list)
    told: dict[str, list[int]] = field(default_factory=dict)

    def add(self, truth: str, *answers: str | None) -> None:
        """Add the answers of METHODS."""
        self.truth.append(TYPES.index(truth))
        for method, answer in zip(METHODS, answers, strict=True):
            self.told.setdefault(method, []).append(
                TYPES.index(answer) if answer in TYPES else len(TYPES)
            )

    def scores(self, method: str) -> Scores:
        return Scores.of(np.array(self.truth), np.array(self.told[method]), (*TYPES, "none"))


@dataclass(frozen=True)
class Opinion:
    """Answers of the network, and of the fit to the points that it calls roof."""

    network: dict[str, float]
    bics: dict[str, float]
    points: int
    fit_alone: str | None

    @property
    def answers(self) -> tuple[str, str | None, str]:
        """The types by METHODS."""
        combined = next(iter(combine(self.network, self.bics, self.points)))
        return max(self.network, key=self.network.get), self.fit_alone, combined


def collect_opinion(points: np.ndarray, types: tuple[str, ...] = TYPES) -> Opinion:
    """Collect the answers of the network alone, the fit alone, and both."""
    recognition = segment(points, Settings().replace({"fit": {"types": types}}))
    from_all, informed = fit_or_none(points, types), fit_or_none(points, types, recognition.weights)
    bics, n_used = (informed.bics, informed.points_used) if informed else ({}, 0)
    return Opinion(recognition.types, bics, n_used, from_all.type if from_all else None)


def fit_or_none(points: np.ndarray, types: tuple[str, ...], weights: np.ndarray | None = None):
    try:
        return fit_roof(
            points, settings=Settings.from_dict({"fit": {"types": types}}), weights=weights
        )
    except FitError:
        return None


def simulate_samples(
    count: int, density: float, seed: int = TEST_SEED
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield (type, points) of `count` buildings at one density."""
    for index in range(count):
        rng = np.random.default_rng([seed, int(10 * density), index])
        sample = draw_sample(rng, (30, 3000), (density, density))
        yield TYPES[sample.type], sample.xyz


def calibrate(count: int) -> None:
    """Print the combination's balanced accuracy over exponents of the evidence."""
    for density in (1.0, 2.0, 5.0, 10.0):
        opinions = [
            (truth, collect_opinion(points))
            for truth, points in simulate_samples(count, density, TEST_SEED + 1)
        ]
        truth = np.array([TYPES.index(name) for name, _ in opinions])
        line = []
        for exponent in (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 1.0):
            types = [
                next(iter(combine(o.network, o.bics, o.points, exponent))) for _, o in opinions
            ]
            scores = Scores.of(truth, np.array([TYPES.index(name) for name in types]), TYPES)
            line.append(f"{exponent:g}: {100 * scores.balanced_accuracy:.1f}")
        print(f"{density:g} points/m2  " + "  ".join(line), flush=True)


def main() -> None:
    parser = make_parser(__doc__, count=600, densities=[2.0, 5.0, 10.0])
    parser.add_argument("--calibrate", action="store_true", help="print accuracies by exponent")
    a = parser.parse_args()
    if a.calibrate:
        calibrate(a.count)
        return
    with FigureTable(a.record, "points/m2", *METHODS) as table:
        for density in a.densities:
            tally = Tally()
            for truth, points in simulate_samples(a.count, density):
                tally.add(truth, *collect_opinion(points).answers)
            accuracies = [tally.scores(method).balanced_accuracy for method in METHODS]
            table.add(density, *(f"{100 * accuracy:.1f}" for accuracy in accuracies))
            recalls = tally.scores(METHODS[-1]).recalls.items()
            print("  recall: " + ", ".join(f"{type} {recall:.3f}" for type, recall in recalls))


if __name__ == "__main__":
    main()
