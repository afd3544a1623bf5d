"""Parts that did not change keep their parameters and their place, and buildings their identity."""

import copy
import dataclasses

import numpy as np
import pytest
import shapely

from hiproof.compose import check_solid
from hiproof.parametric.building import build
from hiproof.update.lineage import continue_parts
from hiproof.update.members import Successor, match_outlines
from hiproof.write.parameters import building_record

NEAR_M = 0.1
RING = [[0, 0], [20, 0], [20, 8], [0, 8]]
WEST, EAST = [[0, 0], [12, 0], [12, 8], [0, 8]], [[12, 0], [20, 0], [20, 8], [12, 8]]
HOUSE = {
    "id": "a",
    "origin": [1000.0, 2000.0, 3.0],
    "z_ground": 3.0,
    "outline": [RING],
    "parts": [
        {
            "type": "gable",
            "parameters": {"width": 8, "length": 12, "height": 3},
            "position": [6, 4, 5],
            "outlines": [[WEST]],
        },
        {
            "type": "flat",
            "parameters": {"width": 8, "length": 8},
            "position": [16, 4, 3],
            "outlines": [[EAST]],
        },
    ],
}


def build_new(rise_west=0.0, rise_east=0.0, east=EAST):
    """The house from a later survey: another origin, its parts the other way round."""
    record = copy.deepcopy(HOUSE)
    gable, flat = record["parts"]
    gable["position"][2] += rise_west
    flat["position"][2] += rise_east
    flat["outlines"] = [[east]]
    record["parts"] = [flat, gable]
    shift = (2.5, -1.25, 0.5)
    record["origin"] = [a + b for a, b in zip(record["origin"], shift, strict=True)]
    for part in record["parts"]:
        part["position"] = [a - b for a, b in zip(part["position"], shift, strict=True)]
        part["outlines"] = [[move(ring, shift) for ring in rings] for rings in part["outlines"]]
    record["outline"] = [move(ring, shift) for ring in record["outline"]]
    return build(record)


def move(ring, shift):
    return [[x - shift[0], y - shift[1]] for x, y in ring]


def scan(building):
    """Points on the roof of a building, in the world."""
    x, y = np.meshgrid(np.arange(0.5, 20, 0.5), np.arange(0.5, 8, 0.5))
    local = np.column_stack([x.ravel(), y.ravel()]) - (
        building.roof.frame.origin[:2] - [1000, 2000]
    )
    xyz = np.column_stack([local, building.roof.height_at(local)])
    return building.roof.frame.to_world(xyz[np.isfinite(xyz).all(axis=1)])


def find_tops(building):
    return building.roof.height_at([[6.0, 4.0], [16.0, 4.0]]) + building.roof.frame.origin[2]


def test_an_unchanged_part_keeps_its_parameters_beside_one_that_was_raised():
    old, new = build(HOUSE), build_new(rise_west=0.03, rise_east=2.0)
    result, lineage = continue_parts(old, new, NEAR_M, scan(new))
    assert lineage == [0, 1]
    before, after = building_record(old), building_record(result)
    assert after["origin"] == before["origin"] and after["outline"] == before["outline"]
    assert after["parts"][0] == before["parts"][0]
    assert find_tops(result) == pytest.approx([11.0, 8.0], abs=1e-6)
    assert not check_solid(result.solid)


def test_figures_of_a_building_with_kept_parts_are_those_of_its_own_roof():
    old, new = build(HOUSE), build_new(rise_west=0.06, rise_east=2.0)
    result, _ = continue_parts(old, new, NEAR_M, scan(new))
    slope = 3 / 4  # points lie 0.06 m over a slope of the gable, and on the flat part
    distance = 0.06 / np.hypot(1.0, slope)
    assert result.quality.p95 == pytest.approx(distance, abs=2e-3)
    assert 0.6 * distance < result.quality.rmse < 0.9 * distance


@pytest.mark.parametrize("rise_east", [2.0, -0.4])
def test_a_part_that_only_moved_keeps_all_but_its_height(rise_east):
    old, new = build(HOUSE), build_new(rise_west=0.3, rise_east=rise_east)
    result, lineage = continue_parts(old, new, NEAR_M, scan(new))
    assert lineage == [0, 1]
    assert find_tops(result) == pytest.approx([11.3, 6.0 + rise_east], abs=1e-6)
    before, after = building_record(old)["parts"], building_record(result)["parts"]
    for was, part, rise in zip(before, after, (0.3, rise_east), strict=True):
        x, y, z = was["position"]
        assert part == was | {"position": [x, y, pytest.approx(z + rise, abs=1e-6)]}


def test_a_part_of_another_shape_is_new():
    old = build(HOUSE)
    record = building_record(build_new())
    record["parts"][1]["parameters"]["height"] += 0.5
    new = build(record)
    result, lineage = continue_parts(old, new, NEAR_M, scan(new))
    assert lineage == [0, 1]
    gable, flat = building_record(result)["parts"]
    assert gable["parameters"]["height"] == pytest.approx(3.5)
    assert flat == building_record(old)["parts"][1]


def test_a_part_keeps_its_parameters_over_another_outline():
    """The flat part now begins half a metre away from the earlier gable."""
    narrow = [[12.5, 0], [20, 0], [20, 8], [12.5, 8]]
    old, new = build(HOUSE), build_new(rise_east=2.0, east=narrow)
    result, _ = continue_parts(old, new, NEAR_M, scan(new))
    before, after = (building_record(building)["parts"][0] for building in (old, result))
    assert [after[name] for name in ("type", "parameters", "position")] == [
        before[name] for name in ("type", "parameters", "position")
    ]
    gaps = shapely.difference(result.roof.outline, shapely.union_all(find_outlines(result)))
    assert gaps.area < 0.05


def find_outlines(building):
    return [piece.outline for piece in building.roof.pieces]


def test_a_part_whose_ring_crosses_itself_is_matched_as_any():
    old, new = build(HOUSE), build_new()
    gable, flat = old.model.roof.parts
    ring = [(0, 0), (12, 0), (12, 8), (6, 8), (5, 8.1), (6, 8.1), (5, 8), (0, 8)]
    (piece, *others) = gable.pieces
    crossing = dataclasses.replace(piece, outline=shapely.Polygon(ring))
    gable = dataclasses.replace(gable, pieces=(crossing, *others))
    roof = dataclasses.replace(old.model.roof, parts=(gable, flat))
    old = dataclasses.replace(old, built=dataclasses.replace(old.built, roof=roof))
    assert continue_parts(old, new, NEAR_M, scan(new))[1] == [0, 1]


def box(x, width=10.0, y=0.0):
    return shapely.box(x, y, x + width, y + 8.0)


def test_the_same_outlines_are_the_same_buildings_in_any_order():
    found = match_outlines([box(0), box(20)], [box(20.1), box(0)])
    assert found == [Successor(1, True), Successor(0, True)]


def test_a_moved_outline_is_the_same_building_over_another_outline():
    assert match_outlines([box(0)], [box(2)]) == [Successor(0, False)]


def test_a_split_names_its_predecessor_and_a_merge_all_of_them():
    halves = [box(0, 5), box(5, 5)]
    assert match_outlines([box(0)], halves) == [Successor(predecessors=(0,))] * 2
    assert match_outlines(halves, [box(0)]) == [Successor(predecessors=(0, 1))]


def test_neighbours_that_overlap_by_a_sliver_are_not_linked():
    found = match_outlines([box(0), box(10)], [box(0.2), box(10.2)])
    assert found == [Successor(0, True), Successor(1, True)]


def test_where_several_stand_on_both_sides_pairs_of_one_outline_stay():
    found = match_outlines([box(0), box(10)], [box(0, 9.5), box(9.5, 5), box(14.5, 5.5)])
    assert found == [Successor(0, True), Successor(predecessors=(1,)), Successor(predecessors=(1,))]


def test_what_overlaps_nothing_is_new():
    assert match_outlines([box(0)], [box(0), box(50)]) == [Successor(0, True), Successor()]
