"""Roofs put together by hand: each is as many parts as a person sees, and lies on its points."""

import math

import numpy as np
import pytest
import shapely
from shapely import box

from hiproof.fit.roof import fit_building
from points_of_roofs import sample_heights


def make_level(z):
    return lambda x, y: np.full(np.shape(x), float(z))


def make_gable(lower, upper, eave=5.0, slope=0.7, along="x"):
    """Of a ridge along x or y midway between `lower` and `upper` of the other."""
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    return lambda x, y: eave + slope * (half - np.abs((y if along == "x" else x) - middle))


def make_hip(x0, x1, y0, y1, eave=5.0, slope=0.7):
    return lambda x, y: (
        eave + slope * np.minimum(np.minimum(x - x0, x1 - x), np.minimum(y - y0, y1 - y))
    )


HOUSE = (box(0, 0, 12, 8), make_gable(0, 8))
HIPPED = (box(0, 0, 12, 8), make_hip(0, 12, 0, 8))
# by name: rectangles and the height over each, of which the highest counts; so many parts are seen
ROOFS = {
    "a low annex at the end": [HOUSE, (box(12, 0, 16, 8), make_level(4))],
    "a high annex at the end": [HOUSE, (box(12, 0, 17, 8), make_level(6.2))],
    "an annex along the side": [HOUSE, (box(0, -4, 8, 0), make_level(4.2))],
    "annexes at both ends": [
        HOUSE,
        (box(12, 0, 16, 8), make_level(4.2)),
        (box(-4, 0, 0, 8), make_level(3.1)),
    ],
    "like annexes at both ends": [
        HOUSE,
        (box(12, 0, 16, 8), make_level(4.2)),
        (box(-4, 0, 0, 8), make_level(4.2)),
    ],
    "annexes of two heights along the side": [
        HOUSE,
        (box(0, -4, 6, 0), make_level(4.4)),
        (box(6, -4, 12, 0), make_level(3.2)),
    ],
    "an annex behind a hip": [HIPPED, (box(12, 1, 16, 7), make_level(4.3))],
    "a high annex behind a hip": [HIPPED, (box(12, 0, 17, 8), make_level(5.6))],
    "a lean-to along a hip": [HIPPED, (box(0, -3.5, 12, 0), lambda x, y: 4.4 + 0.25 * y)],
    "a tower on a level roof": [
        (box(0, 0, 16, 14), make_level(5)),
        (box(3, 3, 8, 9), make_level(8)),
    ],
    "a penthouse and its shaft": [
        (box(0, 0, 16, 12), make_level(5)),
        (box(3, 3, 11, 9), make_level(8)),
        (box(5, 5, 8, 8), make_level(9.5)),
    ],
    "stairs of level roofs": [
        (box(5 * k, 0, 5 * k + 5, 8), make_level(5 + 0.7 * k)) for k in range(4)
    ],
    "a pyramid on a level roof": [
        (box(0, 0, 14, 12), make_level(5)),
        (box(3, 3, 8, 8), make_hip(3, 8, 3, 8, 6.0, 0.8)),
    ],
    "a monopitch beside a level roof": [
        (box(0, 0, 12, 8), lambda x, y: 5 + 0.3 * y),
        (box(12, 0, 17, 8), make_level(4.5)),
    ],
    "a low wing": [HOUSE, (box(3.8, 4, 8.2, 13), make_gable(3.8, 8.2, along="y"))],
    "two wings of one height": [
        (box(0, 0, 14, 8), make_gable(0, 8)),
        (box(0, 0, 8, 15), make_gable(0, 8, along="y")),
    ],
    "a higher wing across the end": [
        HOUSE,
        (box(12, -2, 19, 10), make_gable(12, 19, 6.0, along="y")),
    ],
    "a step in a row": [HOUSE, (box(12, 0, 19, 8), make_gable(0, 8, 5.9))],
    "a row whose houses are set back": [HOUSE, (box(12, 1.5, 19, 9.5), make_gable(1.5, 9.5))],
    "gables side by side": [
        (box(0, 8 * k, 12, 8 * k + 8), make_gable(8 * k, 8 * k + 8)) for k in range(3)
    ],
    "four wings around a yard": [
        (box(0, 0, 22, 7), make_gable(0, 7)),
        (box(0, 15, 22, 22), make_gable(15, 22)),
        (box(0, 0, 7, 22), make_gable(0, 7, along="y")),
        (box(15, 0, 22, 22), make_gable(15, 22, along="y")),
    ],
    "a level dormer and an annex": [
        (box(0, 0, 12, 8), make_gable(0, 8, slope=0.9)),
        (box(12, 0, 16, 8), make_level(4)),
        (box(4.3, 0.6, 7.7, 4), make_level(8.1)),
    ],
    "a hip with a flatter skirt": [
        (box(0, 0, 14, 10), make_hip(0, 14, 0, 10, slope=0.35)),
        (box(1.6, 1.6, 12.4, 8.4), make_hip(1.6, 12.4, 1.6, 8.4, 5.56, 1.2)),
    ],
    "a pyramid with a flatter skirt": [
        (box(0, 0, 11, 11), make_hip(0, 11, 0, 11, slope=0.3)),
        (box(1.8, 1.8, 9.2, 9.2), make_hip(1.8, 9.2, 1.8, 9.2, 5.54, 1.1)),
    ],
    "slopes back to back with a step between": [
        (box(0, 0, 12, 5), lambda x, y: 6 + 0.35 * y),
        (box(0, 5, 12, 10), lambda x, y: 7.2 + 0.35 * (10 - y)),
    ],
    "a clerestory": [
        (box(0, 0, 14, 5), lambda x, y: 5 + 0.3 * y),
        (box(0, 5, 14, 10), lambda x, y: 7.5 - 0.3 * (y - 5)),
    ],
    "a monopitch that falls to a corner": [(box(0, 0, 12, 8), lambda x, y: 5 + 0.12 * x + 0.2 * y)],
    "a butterfly": [
        (box(0, 0, 12, 4.5), lambda x, y: 6.5 - 0.3 * y),
        (box(0, 4.5, 12, 9), lambda x, y: 3.8 + 0.3 * y),
    ],
    "a shed dormer": [
        (box(0, 0, 12, 9), make_gable(0, 9, slope=1.0)),
        (box(1.5, 0.5, 10.5, 4.5), lambda x, y: 7.2 + 0.25 * y),
    ],
    "a steeple": [
        (box(0, 0, 18, 8), make_gable(0, 8, slope=1.2)),
        (box(-4, 1.5, 1, 6.5), make_hip(-4, 1, 1.5, 6.5, 14, 1.8)),
    ],
    "a mansard and an annex": [
        (box(0, 0, 12, 8), lambda x, y: np.minimum(make_hip(0, 12, 0, 8, 5.0, 1.3)(x, y), 7.2)),
        (box(12, 1, 16, 7), make_level(4)),
    ],
}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", ["slopes back to back with a step between", "a clerestory"])
def test_slopes_with_a_step_between_are_two_monopitches(name, seed):
    """One of them could be drawn as the end of a gable of the other, and a piece of the rest."""
    parts = ROOFS[name]
    outline = shapely.union_all([rectangle for rectangle, _ in parts])

    def z(x, y):
        return np.where(y < 5.0, *(height(x, y) for _, height in parts))

    result = fit_building(sample_heights(z, outline, seed=seed), outline).roof_parts
    assert [part.type for part in result] == ["monopitch", "monopitch"]
    assert [part.parameters["width"] for part in result] == pytest.approx([5.0, 5.0], abs=0.05)


@pytest.mark.parametrize("name", ROOFS)
def test_a_roof_by_hand_is_the_parts_a_person_sees(name):
    parts, turn = ROOFS[name], 0.4 + len(name)
    outline = shapely.union_all([rectangle for rectangle, _ in parts])

    def z(x, y):
        return np.max(
            [
                np.where(shapely.intersects_xy(item, x, y), height(x, y), 0.0)
                for item, height in parts
            ],
            axis=0,
        )

    axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    points, places = sample_heights(z, outline), sample_heights(z, outline, noise=0.0, seed=1)
    for cloud in points, places:
        cloud[:, :2] = cloud[:, :2] @ axes
    result = fit_building(points, shapely.transform(outline, lambda xy: xy @ axes)).roof_parts
    height = np.max([part.height_at(places[:, :2]) for part in result], axis=0)
    assert len(result) == len(parts)
    assert np.mean(np.abs(height - places[:, 2]) > 0.15) < 0.02
