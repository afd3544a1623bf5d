"""Dormers in a row are found each, and a strip between them is not."""

import numpy as np
import pytest
import shapely

from hiproof.fit.roof import fit_building
from hiproof.model import Roof
from points_of_roofs import sample_heights

OUTLINE = shapely.box(-12, -5, 12, 5)
EAVES = {"two": (-9.0, 3.0), "four": (-9.0, -5.0, -1.0, 3.0), "a row with a gap": (-9.0, -5.0, 7.0)}


def make_height(begins):
    """Return the heights of a monopitch with level dormers 2 m wide at its lower side."""

    def height(x, y):
        z = 4.0 + 0.6 * (y + 5.0)
        for x0 in begins:
            z = np.where((x0 < x) & (x < x0 + 2.0) & (y < -1.5), np.maximum(z, 7.0), z)
        return z

    return height


@pytest.mark.parametrize("name", EAVES)
@pytest.mark.parametrize("seed", range(2))
def test_each_dormer_of_a_row_is_found(name, seed):
    height = make_height(EAVES[name])
    points = sample_heights(height, OUTLINE, 8.0, 0.02, seed)
    fit = fit_building(points, OUTLINE)
    dormers = [part for part in fit.roof_parts if part.type == "flat"]
    assert len(dormers) == len(EAVES[name])
    roof = Roof(fit.roof_parts, fit.outline, None)
    assert np.mean(np.abs(roof.height_at(points[:, :2]) - points[:, 2]) < 0.1) > 0.95
