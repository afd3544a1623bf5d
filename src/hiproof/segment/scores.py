"""Figures of a classification: confusion matrix, accuracies, recalls, mean IoU."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Scores:
    """Figures of a confusion matrix (true, predicted) of classes `names`.

    Classes that never occur count nowhere.

    >>> scores = Scores.of(np.array([0, 0, 1, 1]), np.array([0, 0, 1, 0]), ("flat", "gable"))
    >>> scores.accuracy, scores.balanced_accuracy
    (0.75, 0.75)
    """

    names: tuple[str, ...]
    confusion: np.ndarray

    @classmethod
    def of(cls, true: np.ndarray, predicted: np.ndarray, names: tuple[str, ...]) -> Scores:
        """Score `true` (n,) against `predicted` (n,), indices 0 .. len(names) - 1."""
        size = len(names)
        counts = np.bincount(np.asarray(true) * size + np.asarray(predicted), minlength=size * size)
        return cls(tuple(names), counts.reshape(size, size))

    @property
    def accuracy(self) -> float:
        return float(np.trace(self.confusion) / max(self.confusion.sum(), 1))

    @property
    def recalls(self) -> dict[str, float]:
        """Share of each true class told rightly, of those that occur."""
        counts = zip(self.names, np.diag(self.confusion), self.confusion.sum(axis=1), strict=True)
        return {name: float(right / total) for name, right, total in counts if total}

    @property
    def balanced_accuracy(self) -> float:
        """Mean of the recalls: what always naming the commonest class cannot raise."""
        return float(np.mean(list(self.recalls.values())))

    @property
    def mean_iou(self) -> float:
        """Mean over the classes that occur of intersection over union."""
        union = self.confusion.sum(axis=0) + self.confusion.sum(axis=1) - np.diag(self.confusion)
        occurs = self.confusion.sum(axis=1) > 0
        return float(np.mean(np.diag(self.confusion)[occurs] / union[occurs]))
