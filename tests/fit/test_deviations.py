"""Laws: errors of a roof's parameters are as large as their standard deviations say."""

from collections import defaultdict
from functools import cache
from zlib import crc32

import numpy as np
import pytest
from benchmarks.compounds import compare_parts

from hiproof.fit.roof import fit_building
from hiproof.simulate import COMPOUND_KINDS, ScanSettings, random_building, random_compound, scan
from hiproof.simulate.scene import Defects

TYPES = (
    "flat",
    "monopitch",
    "gable",
    "asymmetric_gable",
    "hip",
    "side_hip",
    "half_hip",
    "side_half_hip",
    "pyramid",
    "corner",
    "mansard",
    "side_mansard",
    "corner_mansard",
    "truncated_gable",
)
COMPOUNDS = ("L", "T", "U", "cross", "extension", "dormered", "row")
SCENES = 10
PARAMETERS = (
    "width",
    "length",
    "height",
    "t_z",
    "ridge_length",
    "hip_height",
    "end_height",
    "ridge_offset",
    "top_width",
    "top_length",
)


@cache
def measure_scenes(kind):
    """Return the errors over deviations, with names, of each scene of a kind."""
    scenes = []
    for number in range(SCENES):
        rng = np.random.default_rng([crc32(kind.encode()), number])
        draw = random_compound if kind in COMPOUND_KINDS else random_building
        building = draw(rng, kind)
        cloud = scan(building, rng, ScanSettings(density=5.0, defects=Defects.none()))
        points = building.roof.frame.to_local(cloud.points[cloud.source != 2])
        parts = fit_building(points, building.outline).roof_parts
        scenes.append(compare_parts(building.roof, parts)[2])
    return scenes


@pytest.mark.parametrize("kind", TYPES)
def test_no_error_of_a_type_is_more_than_three_deviations_in_most_scenes(kind):
    scenes = [[abs(ratio) for _, ratio in scene] for scene in measure_scenes(kind)]
    assert sum(len(scene) > 0 for scene in scenes) >= 6
    assert sum(max(scene, default=0.0) <= 3.0 for scene in scenes) >= 9


@pytest.mark.parametrize("name", PARAMETERS)
def test_two_thirds_of_the_errors_of_a_parameter_are_within_one_deviation(name):
    ratios = defaultdict(list)
    for scene in (scene for kind in (*TYPES, *COMPOUNDS) for scene in measure_scenes(kind)):
        for one, ratio in scene:
            ratios[one].append(abs(ratio))
    assert len(ratios[name]) >= 7
    assert 0.5 < np.quantile(ratios[name], 0.683) < 1.5
    # a blunder now and then: seven in a hundred, or three of few
    assert np.count_nonzero(np.array(ratios[name]) > 3.0) <= max(3, 0.07 * len(ratios[name]))
