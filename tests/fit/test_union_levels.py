"""Check that level volumes that touch at one height are one part."""

from itertools import combinations

import numpy as np
import pytest
import shapely

from hiproof.fit.roof import fit_building
from points_of_roofs import sample_heights

# West, south, east, north (m) of the boxes at one level, above a lower one all around.
STAGGERED = {
    "L": [(2, 2, 14, 8), (2, 8, 8, 14)],
    "stairs": [(2, 2, 7, 6), (2, 6, 11, 10), (2, 10, 15, 14)],
    "T": [(2, 9, 16, 14), (7, 2, 11, 9)],
}


@pytest.mark.parametrize("name", STAGGERED)
@pytest.mark.parametrize("seed", range(3))
def test_boxes_that_touch_at_one_level_are_one_part(name, seed):
    top = shapely.union_all([shapely.box(*ends) for ends in STAGGERED[name]])
    outline = shapely.box(0, 0, 18, 16)

    def height(x, y):
        return np.where(shapely.contains_xy(top, x, y), 7.0, 4.0)

    fit = fit_building(sample_heights(height, outline, 6.0, 0.02, seed), outline)
    flat = [part for part in fit.roof_parts if part.type == "flat"]
    for part, other in combinations(flat, 2):
        outlines = [shapely.union_all(one.outlines) for one in (part, other)]
        shared = shapely.intersection(*[one.boundary for one in outlines]).length
        same = abs(part.translation[2] - other.translation[2]) < 1e-6
        assert not (same and shared > 0.1)
    assert len(flat) == 2


@pytest.mark.parametrize("pitch", [1.0])
def test_a_hall_and_its_annex_with_a_pitch_of_a_degree_are_not_level(pitch):
    """They rise by 23 cm, more than a person would leave out."""
    outline, slope, found = shapely.box(0, 0, 45, 40), np.tan(np.radians(pitch)), 0

    def height(x, y):
        return np.where(y > 14.0, 6.5 + slope * (13.0 - np.abs(y - 27.0)), 4.0 + slope * y)

    for seed in range(20):
        fit = fit_building(sample_heights(height, outline, 5.0, 0.02, seed), outline)
        rises = {part.type: part.parameters.get("height") for part in fit.roof_parts}
        true = {"gable": 13.0 * slope, "monopitch": 14.0 * slope}
        found += rises == pytest.approx(true, abs=0.03)
    assert found >= 17


def test_parapets_a_hand_wide_are_no_parts():
    outline, whole = shapely.box(0, 0, 14, 10), 0

    def height(x, y):
        return np.where(np.minimum(x, y) < 0.3, 7.0, np.where(x > 9.0, 4.0, 6.0))

    for seed in range(20):
        fit = fit_building(sample_heights(height, outline, 4.0, 0.03, seed), outline)
        whole += all(min(part.parameters.values()) > 1.0 for part in fit.roof_parts)
    assert whole >= 17
