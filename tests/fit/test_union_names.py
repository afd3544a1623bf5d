"""Check parts' names, and where their rectangles end if no points determine it."""

import math

import numpy as np
import pytest

from hiproof.fit.roof import fit_building
from hiproof.fit.roof.parts import find_visible_planes, regularise
from hiproof.simulate import ScanSettings, random_compound, scan
from hiproof.simulate.scene import Defects

SLOPE, EAVE = 0.8, 3.0


def make_hip_rows(half_u, half_v):
    """Return planes (5, 3, 1) of a hip about the origin with all eaves at EAVE.

    The eaves are on the sides of the rectangle.
    """
    rows = [(SLOPE, 0.0, EAVE + SLOPE * half_u), (-SLOPE, 0.0, EAVE + SLOPE * half_u)]
    rows += [
        (0.0, SLOPE, EAVE + SLOPE * half_v),
        (0.0, -SLOPE, EAVE + SLOPE * half_v),
        (np.nan,) * 3,
    ]
    return np.array(rows)[:, :, None]


@pytest.mark.parametrize("by", [-2.0, -0.9, 0.9, 2.0])
def test_a_hidden_side_lies_where_its_eave_is_level(by):
    ends = np.array([[-6.0], [6.0 + by], [-4.0], [4.0]])
    member = regularise(make_hip_rows(6.0, 4.0), ends, 0.0, hidden=[1]).those(0)
    assert member.name == "hip"
    assert member.eaves == pytest.approx(EAVE)
    assert member.half == pytest.approx([6.0, 4.0]) and member.centre == pytest.approx(
        [0.0, 0.0], abs=1e-9
    )


@pytest.mark.parametrize("by", [-2.0, -0.9])
def test_a_side_that_points_tell_stays_where_it_is(by):
    ends = np.array([[-6.0], [6.0 + by], [-4.0], [4.0]])
    member = regularise(make_hip_rows(6.0, 4.0), ends, 0.0).those(0)
    assert member.half[0] == pytest.approx(6.0 + 0.5 * by)
    assert member.eaves[1] == pytest.approx(EAVE - SLOPE * by) and math.isfinite(member.slopes[1])


def test_where_only_planes_over_walls_show_one_of_the_shapes_own_stays():
    """A shape without planes has no name, and the building failed on it."""
    gable = make_hip_rows(6.0, 4.0)[:, :, 0]
    gable[:2] = np.nan
    over_wall = np.array([[-1.0, -1.0, 11.9]])
    rows = np.concatenate([gable, over_wall])
    corner = np.array([[5.9, 3.9, 1.0], [5.9, 3.0, 1.0], [5.0, 3.9, 1.0]])
    assert (corner @ over_wall[0] < np.nanmin(corner @ gable.T, axis=1)).all()
    is_present = find_visible_planes(rows, corner)
    assert is_present.tolist() == [False, False, False, True, False, True]
    assert np.nanmin(corner @ rows[is_present].T, axis=1) == pytest.approx(
        np.nanmin(corner @ rows.T, axis=1)
    )


def test_a_wing_that_ends_in_a_roof_is_a_gable():
    """It has a plane of that roof as its hidden end, and was called a hip at one end."""
    right = []
    for seed in range(6100, 6116):
        rng = np.random.default_rng(seed)
        building = random_compound(rng, ("L", "T", "U")[seed % 3])
        if {part.type for part in building.roof.parts} == {"gable"}:
            scanned = scan(building, rng, ScanSettings(density=6.0, defects=Defects.none()))
            points = building.roof.frame.to_local(scanned.points[scanned.source != 2])
            parts = fit_building(points, building.outline).roof_parts
            right.append({part.type for part in parts} == {"gable"})
    assert len(right) > 10 and np.mean(right) >= 0.9
