"""Rings in space: which way they face, and how large they are."""

from __future__ import annotations

import numpy as np


def ring_normal(ring: np.ndarray) -> np.ndarray:
    """Vector area (3,) of a closed ring (m, 3) without its repeated last vertex (Newell)."""
    centred = ring - ring.mean(axis=0)
    return np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0) / 2
