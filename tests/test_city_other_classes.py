"""What a run says of buildings by the points that are not of the building's class."""

import numpy as np
import pytest
import shapely

from hiproof.city.work.other_classes import (
    OtherPoints,
    explain_missing_points,
    ground_under_roof,
    remark_other_classes,
)
from hiproof.settings import Settings
from hiproof.status import Doubt
from run_records import run_points
from tiny_town import ORIGIN, make_town

TOWN = make_town(houses=3)
ON_FIRST = (TOWN.classification == 6) & (TOWN.xyz[:, 0] < ORIGIN[0] + 30)


def run_of(folder, xyz, classification, settings=None):
    """What a run says of the buildings of TOWN by id, and what it counts, over other points."""
    settings = settings or Settings()
    rows, summary = run_points(folder, xyz, classification, TOWN.footprints, settings=settings)
    return {id: (row["status"], row["detail"]) for id, row in rows.items()}, summary.doubts


def make_ground(points):
    """Ground points below others."""
    return np.column_stack([points[:, :2], ORIGIN[2] + 0.01 * (points[:, 0] - ORIGIN[0])])


def test_a_roof_of_another_class_is_not_taken_for_missing(tmp_path):
    classes = np.where(ON_FIRST, 1, TOWN.classification)
    rows, doubts = run_of(tmp_path, TOWN.xyz, classes)
    status, detail = rows["house-0"]
    assert status == "no_points" and "add a cloud" not in detail
    assert "no points of class 6" in detail
    assert "points of other classes" in detail
    assert "--roofs shape" in detail
    assert doubts == {Doubt.POINTS_OF_OTHER_CLASSES: 1}
    by_shape, _ = run_of(
        tmp_path / "shape", TOWN.xyz, classes, Settings.from_dict({"read": {"roofs": "shape"}})
    )
    assert by_shape["house-0"][0] == "modelled", "what the detail advises helps"


def test_bare_ground_where_a_house_should_stand_is_told_of(tmp_path):
    xyz = np.concatenate([TOWN.xyz[~ON_FIRST], make_ground(TOWN.xyz[ON_FIRST])])
    classes = np.concatenate([TOWN.classification[~ON_FIRST], np.full(ON_FIRST.sum(), 2, np.uint8)])
    rows, doubts = run_of(tmp_path, xyz, classes)
    assert "its ground lies bare: nothing stood there" in rows["house-0"][1]
    assert doubts == {Doubt.BARE_GROUND: 1}


def test_nothing_seen_keeps_its_advice(tmp_path):
    is_far = TOWN.xyz[:, 0] > ORIGIN[0] + 32
    rows, doubts = run_of(tmp_path, TOWN.xyz[is_far], TOWN.classification[is_far])
    assert "add a cloud that covers it" in rows["house-0"][1] and not doubts


def test_a_house_pulled_down_between_two_flights_is_told_of(tmp_path):
    later = make_ground(TOWN.xyz[ON_FIRST] + [0.2, 0.1, 0.0])
    xyz = np.concatenate([TOWN.xyz, later])
    classes = np.concatenate([TOWN.classification, np.full(len(later), 2, np.uint8)])
    rows, doubts = run_of(tmp_path, xyz, classes)
    assert rows["house-0"][0] == "modelled"
    assert "ground points lie under the roof: two dates" in rows["house-0"][1]
    assert "ground" not in rows["house-1"][1] and doubts == {Doubt.GROUND_UNDER_ROOF: 1}


def test_ground_that_nobody_saw_is_told_of(tmp_path):
    """As of a house in a yard that other houses close in: its walls are drawn 3 m high, whatever
    its height.
    """
    roofs = TOWN.classification == 6
    rows, doubts = run_of(tmp_path, TOWN.xyz[roofs], TOWN.classification[roofs])
    assert all(
        "its ground is assumed, for none is seen near it" in detail for _, detail in rows.values()
    )
    assert doubts == {Doubt.ASSUMED_GROUND: 3}


def test_a_roof_of_which_half_has_the_class_is_told_of(tmp_path):
    west = ON_FIRST & (TOWN.xyz[:, 0] < ORIGIN[0] + 14)
    rows, doubts = run_of(tmp_path, TOWN.xyz, np.where(west, 1, TOWN.classification))
    assert "without points of its class, points of other classes lie high" in rows["house-0"][1]
    assert doubts[Doubt.POINTS_OF_OTHER_CLASSES] == 1


X, Y = (grid.ravel() + 0.5 for grid in np.meshgrid(np.arange(10.0), np.arange(10.0)))
ALL_OVER = np.column_stack([X, Y, np.zeros(100)])  # a point in each cell of a building of 10 x 10 m
SQUARE = shapely.box(0, 0, 10, 10)


class LevelTerrain:
    """The ground at some height, NaN for unknown."""

    source = "a level"

    def __init__(self, height):
        self.height = height

    def height_at(self, xy):
        return np.full(len(xy), self.height)


@pytest.mark.parametrize("cells", [0, 20, 60])
def test_ground_beside_walls_and_in_a_corner_says_nothing(cells):
    """Of the 64 cells more than a metre inside the outline, so many hold ground."""
    inside = (abs(X - 5) < 4) & (abs(Y - 5) < 4)
    ground = np.concatenate([ALL_OVER[~inside], ALL_OVER[inside][:cells]])
    points = OtherPoints.inside(SQUARE, ground, ALL_OVER[:0], LevelTerrain(0.0))
    assert bool(ground_under_roof(points, ALL_OVER + [0, 0, 6])) == (cells > 0.4 * 64)


@pytest.mark.parametrize("shift", [(0, 0, 0), (-4e6, 1e7, 100)])
def test_leaves_over_bare_ground_are_no_roof(shift):
    cells, crown, area = (
        ALL_OVER + shift,
        ALL_OVER + shift + [0, 0, 8.0],
        shapely.box(*shift[:2], shift[0] + 10, shift[1] + 10),
    )
    level = LevelTerrain(shift[2])
    assert "lies bare" in explain_missing_points(
        OtherPoints.inside(area, cells, crown, level), (6,)
    )
    assert "class 6 or 67 inside" in explain_missing_points(
        OtherPoints.inside(area, cells[:30], crown, level), (6, 67)
    )
    unknown = OtherPoints.inside(area, cells[:30], crown, LevelTerrain(np.nan))
    assert explain_missing_points(unknown, (6,)) == remark_other_classes(unknown, cells[:0]) == ""


@pytest.mark.parametrize("classified, is_doubtful", [(100, False), (85, False), (70, True)])
def test_what_stands_beside_a_roof_of_its_class_is_told_of_where_it_is_much(
    classified, is_doubtful
):
    points = OtherPoints.inside(SQUARE, ALL_OVER[:0], ALL_OVER + [0, 0, 8.0], LevelTerrain(0.0))
    assert bool(remark_other_classes(points, ALL_OVER[:classified])) == is_doubtful
