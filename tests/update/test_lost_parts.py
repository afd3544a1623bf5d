"""Parts of houses that were pulled down, at any density, and models that stay for better ones."""

import dataclasses

import numpy as np
import pytest
import shapely

from hiproof.errors import InputError
from run_records import by_id
from tiny_town import ORIGIN, make_town, write_footprints
from tiny_updates import lay_bare, raise_house, run_over, take_class, take_kind, update

KEPT = {"house-0": 0.55, "house-2": 0.75, "house-3": 0.45}  # share of the length that stays


@pytest.mark.parametrize(("density", "code"), [(2.0, 2), (4.0, 1), (24.0, 2)])
def test_what_lies_bare_is_lost_at_any_density(dense_run, density, code, tmp_path):
    town = make_town(seed=7, density=density)
    areas = {id: lay_bare(town, id, kept, code) for id, kept in KEPT.items()}
    before, after = by_id(dense_run), update(dense_run, tmp_path / "out", town)
    kinds = {id: take_kind(row) for id, row in after.items()}
    assert kinds == {"house-1": "unchanged"} | dict.fromkeys(KEPT, "part_removed")
    for id, area in areas.items():
        place = after[id]["change"]["places"][0]
        is_fine = density > 2 and code == 2  # others come in cells of a metre
        assert place["area"] == pytest.approx(area, rel=0.2 if is_fine else 0.35), id
        assert after[id]["change"]["class"] == "changed"
        outlines = [
            shapely.Polygon(row["parts"][0]["outlines"][0][0]) for row in (before[id], after[id])
        ]
        assert outlines[0].area - outlines[1].area == pytest.approx(area, rel=0.25), id


@pytest.mark.parametrize("density", [4.0, 12.0])
def test_a_small_rest_that_stands_is_not_demolished(dense_run, density, tmp_path):
    """A quarter of a house, and a tower that is new, are more than nothing."""
    town = make_town(seed=7, density=density)
    lost_m2 = lay_bare(town, "house-0", 0.25)
    lay_bare(town, "house-2", 0.0)
    x0, y0, x1, y1 = town.footprints["house-2"].bounds
    tower = shapely.box(x0, y0, x0 + 0.3 * (x1 - x0), y1)
    is_tower = town.lie_in(tower)
    town.xyz[is_tower, 2] += 9.0
    town.classification[is_tower] = 6
    lay_bare(town, "house-3", 0.0)
    before, after = by_id(dense_run), update(dense_run, tmp_path / "out", town)
    for id, kind in (("house-0", "part_removed"), ("house-2", "rebuilt")):
        assert after[id]["change"]["class"] == "changed", id
        assert take_kind(after[id]) == kind, id
    outlines = [
        shapely.Polygon(row["parts"][0]["outlines"][0][0])
        for row in (before["house-0"], after["house-0"])
    ]
    assert outlines[0].area - outlines[1].area == pytest.approx(lost_m2, rel=0.2)
    assert take_kind(after["house-3"]) == "demolished"


@pytest.mark.parametrize(("east", "kind"), [(2.0, "moved"), (0.9, "moved"), (0.0, "unchanged")])
def test_a_house_built_anew_beside_its_place_was_moved(dense_run, east, kind, tmp_path):
    town = make_town(seed=7, density=8.0)
    x0, y0, x1, y1 = town.footprints["house-0"].bounds
    is_house = town.lie_in(shapely.box(x0, y0, x1, y1))
    heights, classes = town.xyz[is_house] + [east, 0, 0], town.classification[is_house]
    lay_bare(town, "house-0", 0.0)
    is_under = town.lie_in(shapely.box(x0 + east, y0, x1 + east, y1))
    town = dataclasses.replace(
        town,
        xyz=np.concatenate([town.xyz[~is_under], heights]),
        classification=np.concatenate([town.classification[~is_under], classes]),
    )
    before, after = (
        by_id(dense_run)["house-0"],
        update(dense_run, tmp_path / "out", town)["house-0"],
    )
    assert take_kind(after) == kind
    places = [
        row["origin"][0] + shapely.Polygon(row["parts"][0]["outlines"][0][0]).centroid.x
        for row in (before, after)
    ]
    assert places[1] - places[0] == pytest.approx(east, abs=0.15)
    if east:
        assert after["change"]["places"][0]["area"] == pytest.approx(east * (y1 - y0), rel=0.2)


def stand_on_slope(town, slope):
    """Raise the ground of a town to a slope to the east and to the north, and houses with it."""
    places = town.xyz[:, :2].copy()
    for outline in town.footprints.values():
        places[town.lie_in(outline)] = outline.centroid.coords[0]
    is_roof = town.classification == 6
    places[~is_roof] = town.xyz[~is_roof, :2]
    town.xyz[:, 2] += (places - ORIGIN[:2]) @ slope
    return town


@pytest.mark.parametrize("gap", [1.0, 2.5])
def test_lines_of_a_scan_far_apart_show_what_lies_between_them(dense_run, gap, tmp_path):
    """Sixty points a metre of line, 6 cm wide: cells between the lines are empty."""
    town = make_town(seed=7, density=60.0)
    areas = {id: lay_bare(town, id, kept) for id, kept in KEPT.items()}
    on_line = (town.xyz[:, 1] - ORIGIN[1]) % gap < 0.06
    town = town.select(on_line)
    after = update(dense_run, tmp_path / "out", town)
    assert take_kind(after["house-1"]) == "unchanged"
    for id, area in areas.items():
        place = after[id]["change"]["places"][0]
        assert place["kind"] == "part_removed"
        assert 0.6 * area < place["area"] < 1.1 * area


@pytest.mark.parametrize("slope", [(-0.1, 0.12), (0.2, 0.15)])
def test_what_lies_bare_on_a_slope_is_lost(slope, tmp_path):
    """The ground under a house is higher than its lowest place by more than a metre."""
    town = stand_on_slope(make_town(density=8.0), np.array(slope))
    run = run_over(tmp_path, town)
    town = make_town(seed=7, density=8.0)
    for id, kept in (KEPT | {"house-3": 0.0}).items():
        lay_bare(town, id, kept)
    town = stand_on_slope(town, np.array(slope))
    after = update(run, tmp_path / "out", town)
    kinds = {id: take_kind(row) for id, row in after.items()}
    expected = {"house-1": "unchanged"} | dict.fromkeys(KEPT, "part_removed")
    assert kinds == expected | {"house-3": "demolished"}


def test_a_survey_of_bare_ground_alone_is_used_where_its_classes_hold(dense_run, tmp_path):
    town = make_town(seed=7, density=8.0)
    for id in town.footprints:
        lay_bare(town, id, 0.0)
    town.classification[:] = 2
    with pytest.raises(InputError, match="update a run with --roofs class"):
        update(dense_run, tmp_path / "out", town)
    after = update(dense_run, tmp_path / "bare", town, {"read": {"roofs": "class"}})
    assert {take_kind(row) for row in after.values()} == {"demolished"}


def test_roofs_of_a_class_that_is_not_looked_for_are_uncertain(dense_run, tmp_path):
    """All ground under them is hidden, so none of them is gone but the one that was pulled down."""
    town = make_town(seed=7, density=8.0)
    lay_bare(town, "house-1", 0.0)
    town.classification[town.classification == 6] = 67
    after = update(dense_run, tmp_path / "out", town, {"read": {"roofs": "class"}})
    classes = {id: row["change"]["class"] for id, row in after.items()}
    assert classes == dict.fromkeys(classes, "uncertain") | {"house-1": "gone"}


def lay_corner_bare(town, id, size):
    """Pull down a triangle at a corner of a house; return it."""
    x0, y0, _, _ = town.footprints[id].bounds
    corner = shapely.Polygon([(x0, y0), (x0 + size[0], y0), (x0, y0 + size[1])])
    gone = town.lie_in(corner)
    town.xyz[gone, 2] = ORIGIN[2] + 0.01 * (town.xyz[gone, 0] - ORIGIN[0])
    town.classification[gone] = 2
    return corner


@pytest.mark.parametrize(
    ("size", "density"), [((6.0, 5.0), 8.0), ((4.0, 3.0), 4.0), ((10.0, 7.0), 16.0)]
)
def test_a_model_loses_a_corner_that_lies_bare_or_is_not_good(dense_run, size, density, tmp_path):
    town = make_town(seed=7, density=density)
    corner = lay_corner_bare(town, "house-1", size)
    after = update(dense_run, tmp_path / "out", town)
    kinds = {id: take_kind(row) for id, row in after.items()}
    assert kinds == dict.fromkeys(town.footprints, "unchanged") | {"house-1": "part_removed"}
    row = after["house-1"]
    outline = shapely.transform(
        shapely.Polygon(row["outline"][0]), lambda xy: xy + row["origin"][:2]
    )
    if outline.intersection(corner).area > 0.5 * corner.area:
        assert row["quality"] != "good"
        assert "of bare ground inside its footprint is roofed over" in row["detail"]


def test_full_trust_in_footprints_keeps_the_model_and_says_so(dense_run, tmp_path):
    town = make_town(seed=7, density=8.0)
    lay_bare(town, "house-1", 0.6)
    row = update(dense_run, tmp_path / "out", town, {"reconstruct": {"footprint_trust": "full"}})
    assert take_kind(row["house-1"]) == "part_removed"
    assert row["house-1"]["quality"] == "fair"
    assert "of bare ground inside its footprint is roofed over" in row["house-1"]["detail"]


@pytest.mark.parametrize("density", [0.5, 1.0])
def test_a_sparse_survey_covers_what_it_covers(dense_run, density, tmp_path):
    town = make_town(seed=8, density=density)
    lay_bare(town, "house-2", 0.0)
    raise_house(town, "house-1", 2.0)
    west = town.xyz[:, 0] < ORIGIN[0] + 90.0
    town = town.select(west)
    after = update(dense_run, tmp_path / "out", town)
    assert {id: take_class(row) for id, row in after.items()} == {
        "house-0": "unchanged",
        "house-1": "changed",
        "house-2": "gone",
        "house-3": "not_covered",
    }


def test_a_model_stays_where_a_crown_hides_its_roof(dense_run, tmp_path):
    """The crown is smooth, in the class of buildings: on its points no roof is better."""
    town = make_town(seed=7, density=12.0)
    x0, _, x1, _ = town.footprints["house-1"].bounds
    x, y, z = town.xyz.T
    inside = shapely.intersects_xy(town.footprints["house-1"], x, y) & (x > x0 + 0.3 * (x1 - x0))
    rng = np.random.default_rng(4)
    waves = np.sin(1.7 * x[inside]) + np.cos(1.3 * y[inside])
    town.xyz[inside, 2] = z[inside].max() + 3.0 + 1.5 * waves + rng.normal(0, 0.3, inside.sum())
    before, after = (
        by_id(dense_run)["house-1"],
        update(dense_run, tmp_path / "out", town)["house-1"],
    )
    assert after["change"]["class"] == "uncertain"
    assert after["parts"] == before["parts"]


@pytest.mark.parametrize("rise", [0.25, -0.35])
def test_a_roof_that_moved_a_little_moved_as_a_whole(dense_run, rise, tmp_path):
    """Of its cells a quarter differs by more than chance: the others are too few points."""
    town = make_town(seed=7)
    town.xyz[town.classification == 6, 2] += rise
    after = update(dense_run, tmp_path / "out", town)
    kind = "roof_raised" if rise > 0 else "roof_lowered"
    assert {take_kind(row) for row in after.values()} == {kind}
    for row in after.values():
        (place,) = row["change"]["places"]
        assert place["difference"] == pytest.approx(rise, abs=0.05)


def test_most_houses_may_grow_while_the_survey_is_shifted(dense_run, tmp_path):
    town = make_town(seed=7)
    for id in ("house-0", "house-1", "house-3"):
        raise_house(town, id, 2.8)
    town.xyz[:, 2] += 0.3
    with pytest.warns(UserWarning, match="3 of 4 sampled roofs lie elsewhere than the ground"):
        after = update(dense_run, tmp_path / "out", town)
    raised = dict.fromkeys(("house-0", "house-1", "house-3"), "roof_raised")
    assert {id: take_kind(row) for id, row in after.items()} == {"house-2": "unchanged"} | raised
    for id in raised:
        place = after[id]["change"]["places"][0]
        assert place["difference"] == pytest.approx(2.8, abs=0.05)


@pytest.mark.parametrize("is_seen", [True, False], ids=["bare", "not covered"])
def test_a_half_that_is_gone_is_no_unchanged_part_of_a_split(dense_run, is_seen, tmp_path):
    town = make_town(seed=7)
    x0, y0, x1, y1 = town.footprints["house-0"].bounds
    x, outlines = x0 + 0.5 * (x1 - x0), {**town.footprints}
    lay_bare(town, "house-0", 0.5)
    if not is_seen:
        far = ~town.lie_in(shapely.box(x, y0, x1, y1))
        town = town.select(far)
    del outlines["house-0"]
    outlines |= {"west": shapely.box(x0, y0, x, y1), "east": shapely.box(x, y0, x1, y1)}
    path = str(write_footprints(tmp_path / "split.gpkg", outlines))
    after = update(dense_run, tmp_path / "out", town, footprints=path, id_attribute="id")
    assert take_kind(after["west"]) == "split"
    change = after["east"]["change"]
    assert change["class"] == ("gone" if is_seen else "not_covered")
    assert change["predecessors"] == ["house-0"]
    assert [place["kind"] for place in change["places"]] == ["demolished"] * is_seen


def test_copies_of_an_outline_are_the_same_building(dense_run, tmp_path):
    town, outlines = make_town(seed=7), {}
    for id, outline in town.footprints.items():
        outlines[id] = outline
        outlines[f"copy of {id}"] = shapely.transform(outline, lambda xy: xy + 1e-9)
    path = str(write_footprints(tmp_path / "copies.gpkg", outlines))
    with pytest.warns(UserWarning, match="4 copies of other footprints are left out"):
        after = update(dense_run, tmp_path / "out", town, footprints=path, id_attribute="id")
    assert {id: take_kind(row) for id, row in after.items()} == dict.fromkeys(
        town.footprints, "unchanged"
    )
