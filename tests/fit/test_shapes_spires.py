"""How near points lie to a spire is known without its rotation and its exact middle."""

import math

import numpy as np
import pytest

from hiproof.fit.shapes.spires import SIDES_OF_SPIRES, measure_spires


def make_spire(sides: int, facing: float, noise_m: float = 0.0) -> np.ndarray:
    """Return points (n, 3) of a spire around (2, 1) that falls by 1.2 m a metre."""
    rng = np.random.default_rng(sides)
    x, y = rng.uniform(-4.0, 4.0, (2, 400))
    facet = 2.0 * math.pi / sides
    aside = (np.arctan2(y, x) - facing + 0.5 * facet) % facet - 0.5 * facet
    z = 30.0 - 1.2 * np.hypot(x, y) * np.cos(aside) + rng.normal(0.0, noise_m, len(x))
    return np.column_stack([x + 2.0, y + 1.0, z])


@pytest.mark.parametrize("sides", SIDES_OF_SPIRES.values())
@pytest.mark.parametrize("facing", [0.0, 0.1, 0.35])
def test_a_spire_lies_near_itself_from_a_middle_beside_its_own(sides, facing):
    assert measure_spires(make_spire(sides, facing), np.array([2.1, 0.9]), 0.3) < 0.02


def test_noise_and_other_roofs_leave_what_they_deviate_by():
    noisy = measure_spires(make_spire(8, 0.2, noise_m=0.05), np.array([2.0, 1.0]), 0.3)
    assert noisy == pytest.approx(0.05 * math.sqrt(2.0 / math.pi), rel=0.1)
    points = make_spire(8, 0.2)
    points[:, 2] = 30.0 - 1.2 * np.abs(points[:, 0])
    assert measure_spires(points, np.array([2.0, 1.0]), 0.3) > 0.2


def test_a_level_roof_lies_on_a_spire_without_a_rise():
    points = make_spire(6, 0.0)
    points[:, 2] = 5.0
    assert measure_spires(points, np.array([2.0, 1.0]), 0.3) < 1e-6
