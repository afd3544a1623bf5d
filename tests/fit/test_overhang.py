"""How far roofs reach beyond their outlines, by their points alone."""

import numpy as np
import pytest
import shapely

import hiproof
from hiproof.fit.overhang import measure_reach

EAVE_M = 0.4


def build_roof(length=20.0, width=8.0):
    """A gable along x about the origin, its eaves at 5 m."""
    x, y = length / 2, width / 2
    ring = [[-x, -y], [x, -y], [x, y], [-x, y]]
    part = {
        "type": "gable",
        "parameters": {"width": width, "length": length, "height": 3.0},
        "position": [0, 0, 5.0],
        "outlines": [[ring]],
    }
    record = {"id": "a", "origin": [0, 0, 0], "outline": [ring], "z_ground": 0, "parts": [part]}
    return hiproof.build(record).roof


def scan(roof, xy):
    """Points over `xy`: on the roof up to 0.4 m beyond its eaves, else on the ground."""
    z = 8.0 - 0.75 * np.abs(xy[:, 1])
    is_roof = (np.abs(xy[:, 0]) <= 10.0) & (np.abs(xy[:, 1]) <= 4.0 + EAVE_M)
    return np.column_stack([xy, np.where(is_roof, z, 0.0)])


def draw_even(rng):
    return rng.uniform((-13, -7), (13, 7), (26 * 14 * 8, 2))


def draw_lines(rng, first=0.0):
    """As many points on scan lines along the eaves, 1 m apart."""
    lines = np.arange(-7.0 + first, 7.0)
    y = np.repeat(lines, 26 * 8) + rng.normal(0.0, 0.02, len(lines) * 26 * 8)
    return np.column_stack([rng.uniform(-13, 13, len(y)), y])


def measure_eaves(xy):
    roof = build_roof()
    reach = measure_reach(roof, scan(roof, xy), shapely.Polygon())
    return reach.lengths[[0, 2]], reach.sigmas[[0, 2]]


def test_points_that_lie_evenly_show_an_overhang_to_a_few_centimetres():
    lengths, sigmas = measure_eaves(draw_even(np.random.default_rng(1)))
    assert lengths == pytest.approx([EAVE_M, EAVE_M], abs=0.05) and (sigmas < 0.05).all()


@pytest.mark.parametrize("first", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_scan_lines_along_an_eave_leave_it_uncertain_by_their_distance(first):
    lengths, sigmas = measure_eaves(draw_lines(np.random.default_rng(1), first))
    assert (sigmas > 0.1).all()
    assert (np.abs(lengths - EAVE_M)[lengths > 0.0] < 3.0 * sigmas[lengths > 0.0]).all()
