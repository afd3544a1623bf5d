"""Heights of the terrain along an outline."""

from __future__ import annotations

import numpy as np


def measure_terrain(lines: tuple[np.ndarray, ...]) -> tuple[float, float, float] | None:
    """Return the lowest, highest and mean height of terrain `lines` (m, 3).

    The mean is by length. None where no line is known.

    >>> line = np.array([[0, 0, 1], [3, 0, 1], [3, 1, 3], [0, 0, 1]], float)
    >>> measure_terrain((line[:3],))
    (1.0, 3.0, 1.25)
    """
    lines = tuple(line for line in lines if len(line) > 1 and np.isfinite(line).all())
    if not lines:
        return None
    z = np.concatenate([line[:, 2] for line in lines])
    middle = np.concatenate([0.5 * (line[1:, 2] + line[:-1, 2]) for line in lines])
    length = np.concatenate([np.hypot(*np.diff(line[:, :2], axis=0).T) for line in lines])
    mean = np.average(middle, weights=length) if length.any() else z.mean()
    return float(z.min()), float(z.max()), float(mean)
