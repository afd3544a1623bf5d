"""Which earlier building a new footprint is."""

import shapely

from hiproof.update.members import Successor, match_outlines


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
