"""Check that fold lines end in corners, steps at eaves, and ridges in roofs.

They do not where points contradict.
"""

import numpy as np
import pytest
import shapely

from hiproof.compose import compose
from hiproof.fit.roof import fit_building
from hiproof.frames import LocalFrame
from hiproof.model import ROOF, Roof
from points_of_roofs import sample_heights

DRAWN_M = 0.3  # a draughtsman draws no shorter edge on these roofs
EAVE, SLOPE = 3.0, 0.8
# Each wing has a rectangle (low x, low y, high x, high y), and the sides (of west, east, south and
# north) with a gable.
HOUSES = {
    "L of hips": (((0, 0, 14, 8), ""), ((0, 0, 7, 15), "")),
    "L of gables": (((0, 0, 14, 8), "we"), ((0, 0, 7, 15), "ns")),
    "T of hips": (((0, 0, 16, 8), ""), ((5, 0, 11, 13), "s")),
    "T of gables": (((0, 0, 16, 8), "we"), ((5, 0, 11, 13), "ns")),
    "hip with a gabled wing": (((0, 0, 16, 8), ""), ((5, 0, 11, 13), "ns")),
    "cross": (((0, 4, 18, 11), ""), ((6, 0, 12, 15), "")),
}


def compute_wing(x, y, rectangle, gables, eave=EAVE):
    """Return the height of one wing, minus infinity beside it."""
    west, south, east, north = rectangle
    inside = (x >= west) & (x <= east) & (y >= south) & (y <= north)
    is_away = {"w": x - west, "e": east - x, "s": y - south, "n": north - y}
    rise = np.min([d for side, d in is_away.items() if side not in gables], axis=0)
    return np.where(inside, eave + SLOPE * rise, -np.inf)


def make_house(name):
    """Return the outline and height of one of HOUSES."""
    outline = shapely.union_all([shapely.box(*rectangle) for rectangle, _ in HOUSES[name]])
    return outline, lambda x, y: np.max([compute_wing(x, y, *own) for own in HOUSES[name]], axis=0)


def measure_roof_edges(fit):
    """Return lengths in plan (m,) of all edges of the solid's roof."""
    solid = compose(Roof(fit.roof_parts, fit.outline, LocalFrame(np.zeros(3))), -3.0)
    rings = [
        solid.vertices[list(ring)][:, :2]
        for face in solid.select_faces(ROOF)
        for ring in face.rings
    ]
    return np.concatenate([np.hypot(*(np.roll(ring, -1, axis=0) - ring).T) for ring in rings])


@pytest.mark.parametrize(
    ("name", "beside"),
    list(zip(HOUSES, 2 * [(0.05, 0.04), (-0.06, 0.03), (0.0, 0.0)], strict=True)),
)
def test_creases_end_in_corners_where_points_lie_a_little_beside_the_outline(name, beside):
    (outline, height), right = make_house(name), 0
    for seed in range(6):
        points = sample_heights(height, outline, 5.0, 0.02, seed) + (*beside, 0.0)
        fit = fit_building(points, outline)
        right += len(fit.roof_parts) == 2 and measure_roof_edges(fit).min() > DRAWN_M
    assert right >= 5


@pytest.mark.parametrize("lower", [0.25, 0.5])
def test_eaves_of_two_heights_keep_them_though_their_hip_ends_beside_the_corner(lower):
    outline = shapely.box(0, 0, 14, 8)

    def height(x, y):
        return np.minimum(compute_wing(x, y, (0, 0, 14, 8), ""), EAVE - lower + SLOPE * x)

    points = sample_heights(height, outline, 10.0, 0.02)
    fit = fit_building(points, outline)
    error = Roof(fit.roof_parts, fit.outline, None).height_at(points[:, :2]) - points[:, 2]
    assert np.sqrt(np.mean(error**2)) < 0.04


def test_a_step_below_a_hip_lies_where_its_plane_meets_the_eaves():
    """Of sixty, 49 lie within 10 cm, so of twenty hardly ever fewer than 13."""
    outline, right = shapely.box(0, 0, 16, 8), 0

    def height(x, y):
        return np.where(x < 10.3, compute_wing(x, y, (0, 0, 10.3, 8), ""), 1.0)

    for seed in range(20):
        fit = fit_building(sample_heights(height, outline, 2.0, 0.02, seed), outline)
        lowest = min(fit.roof_parts, key=lambda part: part.pieces[0].planes[:, 2].min())
        step = min(piece.outline.bounds[0] for piece in lowest.pieces)
        is_near = lowest.type == "flat" and abs(step - 10.3) < 0.1
        right += is_near and measure_roof_edges(fit).min() > DRAWN_M
    assert right >= 13
