"""Editing a building: other types, ridges at a height, parts more or less, refits; every edit is a
valid solid or one sentence.
"""

import numpy as np
import pytest

import hiproof
from hiproof.compose import check_solid
from hiproof.compose.settle import settled_roof
from hiproof.errors import FitError, InputError
from hiproof.parametric.arrange import replace_part, with_recess
from hiproof.parametric.building import build, with_model
from hiproof.parametric.refit import UNBOUNDED_M, Heights, list_unknowns
from hiproof.primitives import CATALOGUE
from hiproof.settings import ComposeSettings
from hiproof.simulate import random_building, random_compound
from hiproof.status import Grade, Status
from hiproof.write.parameters import building_record
from parametric_house import gable_house
from random_edits import count_outcomes

EDITS, BUILDINGS = 150, 30
RIDGED = [name for name in CATALOGUE if name not in ("flat", "shed")]
RECOVERED = (
    "gable",
    "hip",
    "monopitch",
    "pyramid",
    "half_hip",
    "mansard",
    "asymmetric_gable",
    "gambrel",
    "shed",
)


def build_house(roof, id="house"):
    return with_model(hiproof.Building(id, Status.MODELLED, z_ground=0.0), settled_roof(roof))


@pytest.fixture(scope="module")
def gable():
    return gable_house()


def test_a_changed_building_is_composed_as_it_was(gable):
    deep = ComposeSettings(ground_clearance_m=9.0)  # so that it shows in every solid
    house = hiproof.build(building_record(gable), deep)
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(-4, 4, 20), np.linspace(-3, 3, 20)))
    points = np.column_stack([x, y, 9.0 - 0.5 * np.abs(y)]) + house.roof.frame.origin
    larger = house.with_part(1, type="flat", width=2.0, length=2.0, position=[0.0, 0.0, 12.0])
    for changed in (
        house.with_part(0, type="hip"),
        larger,
        larger.without_part(1),
        house.refit(points),
    ):
        record = building_record(changed)
        assert np.array_equal(changed.solid.vertices, hiproof.build(record, deep).solid.vertices)
        assert (
            changed.solid.vertices[:, 2].min()
            < hiproof.build(record).solid.vertices[:, 2].min() - 1.0
        )


@pytest.mark.parametrize("kind", CATALOGUE)
def test_another_type_keeps_the_eave(gable, kind):
    other = gable.with_part(0, type=kind)
    assert other.type == kind and not check_solid(other.solid)
    assert other.parts[0].translation[2] == pytest.approx(5.0)
    assert (other.parts[0].parameters["width"], other.parts[0].parameters["length"]) == (8.0, 12.0)
    assert not np.isfinite(other.quality.rmse) and other.attributes == gable.attributes


@pytest.mark.parametrize("kind", RIDGED)
def test_a_ridge_comes_to_its_height(gable, kind):
    other = gable.with_part(0, type=kind, ridge_height=12.4)
    assert other.solid.vertices[:, 2].max() == pytest.approx(12.4, abs=2e-3)


def test_a_flat_roof_becomes_a_gable_and_its_volume_grows(gable):
    flat = gable.with_part(0, type="flat", ridge_height=7.0)
    ridged = flat.with_part(0, type="gable", ridge_height=10.0)
    volumes = [b.solid.volume for b in (flat, ridged)]
    assert volumes == pytest.approx([96 * 5.0, 96 * 6.5], rel=1e-6)


def test_a_level_gable_gets_a_ridge(gable):
    for level in (
        gable.with_part(0, height=0.0),
        gable.with_part(0, pitch_front=0.0, pitch_back=0.0),
    ):
        assert level.with_part(0, ridge_height=9.0).solid.vertices[:, 2].max() == pytest.approx(
            9.0, abs=1e-3
        )


def test_sides_move_one_by_one(gable):
    other = gable.with_part(0, pitch_front=30.0)
    assert other.parts[0].parameters["pitch_back"] == pytest.approx(
        np.degrees(np.arctan(0.75)), abs=1e-5
    )
    slopes = sorted(
        round(s, 3) for s in hiproof.write.roof_figures(other.solid).face_slope_deg if s == s
    )
    assert slopes == [30.0, 36.87]


@pytest.mark.parametrize("kind", [name for name in CATALOGUE if name != "flat"])
def test_another_type_of_another_size_is_one_of_that_size(gable, kind):
    at_once = gable.with_part(0, type=kind, width=3.0, length=4.0)
    sized = gable.with_part(0, width=3.0, length=4.0)
    one_by_one = sized.with_part(0, type=kind)
    assert at_once.parts[0].parameters == pytest.approx(one_by_one.parts[0].parameters)


@pytest.mark.parametrize("eave", [0.4, -0.4])
def test_heights_count_from_the_lowest_eave_whichever_it_becomes(gable, eave):
    shed = gable.with_part(0, type="monopitch")
    raised = shed.with_part(0, eave_front=eave)
    assert raised.parts[0].parameters["eave_front"] == 0.0
    assert raised.parts[0].translation[2] == pytest.approx(shed.parts[0].translation[2] + eave)
    top = raised.with_part(0, ridge_height=14.0)
    assert top.solid.vertices[:, 2].max() == pytest.approx(14.0, abs=1e-3)
    lowered = raised.with_part(0, eave_height=6.0).roof
    assert lowered.height_at(
        lowered.parts[0].pieces[0].outline.exterior.coords
    ).min() == pytest.approx(6.0 - lowered.frame.origin[2])


def test_a_moved_part_roofs_what_its_rectangle_covers(gable):
    two_parts = gable.with_part(1, type="flat", position=[0, 0, 9.0], width=2.0, length=2.0)
    assert two_parts.parts[1].area == pytest.approx(4.0)
    assert two_parts.solid.vertices[:, 2].max() == pytest.approx(11.0)
    moved_part = two_parts.with_part(1, position=[6.0, 0.0, 9.0])
    assert moved_part.parts[1].area == pytest.approx(2.0)
    assert len(two_parts.without_part(1).parts) == 1


def test_arrays_tuples_and_numbers_of_numpy_are_what_lists_and_numbers_are(gable):
    place = gable.parts[0].translation + (1.0, 0.0, 0.5)
    sizes = {"width": 3.0, "length": 4.0, "type": "gable"}
    changes = [
        sizes | {"position": place.tolist()},
        sizes | {"position": tuple(place)},
        sizes | {"position": place, "width": np.float32(3.0), "length": np.int64(4)},
    ]
    for index in (0, 1):
        first, *remainder = (gable.with_part(index, **change) for change in changes)
        assert all(
            np.array_equal(first.solid.vertices, other.solid.vertices) for other in remainder
        )


def test_what_cannot_be_is_one_sentence(gable):
    for change, message in [
        ({"width": -1.0}, "positive width"),
        ({"type": "igloo"}, "roof type"),
        ({"ridge_height": 3.0}, "ridge above the eave"),
        ({"ridge_height": "12"}, "number as ridge_height, got '12'"),
        ({"eave_height": np.nan}, "number as eave_height, got nan"),
        ({"type": ["hip"]}, "roof type"),
        ({"position": [99.0, 0.0, 5.0]}, "outside"),
        ({"colour": 3.0}, "got also colour"),
    ]:
        with pytest.raises(InputError, match=message):
            gable.with_part(0, **change)
    for call, message in [
        (lambda: gable.with_part(7, type="hip"), "part from 0 to 1"),
        (lambda: gable.with_part(1, type="hip"), "of a new part"),
        (lambda: gable.without_part(0), "two or more parts"),
        (lambda: hiproof.Building("b", Status.NO_POINTS).with_part(0, type="hip"), "with a model"),
        (lambda: gable.refit(np.zeros((9, 3)), fixed={0: ("ridge",)}), "parameters of part 0"),
    ]:
        with pytest.raises(InputError, match=message):
            call()
    with pytest.raises(FitError, match="3 points or more"):
        gable.refit(np.zeros((9, 3)))


@pytest.mark.parametrize("kind", RECOVERED)
def test_a_refit_finds_what_was_changed(kind):
    roof = random_building(np.random.default_rng(5), kind).roof
    house = build_house(roof)
    points = sample_house(house, np.random.default_rng(6))
    name = "height"
    true = house.parts[0].parameters[name]
    changed = house.with_part(
        0, height=1.3 * true, eave_height=house.parts[0].translation[2] - 0.5 + roof.frame.origin[2]
    )
    refitted = changed.refit(points)
    assert refitted.parts[0].parameters[name] == pytest.approx(true, abs=0.05)
    assert refitted.quality.share_within_20cm > 0.95 and refitted.parts[0].sigma[name] < 0.05
    assert refitted.status is Status.MODELLED and "fitted" in refitted.detail


def sample_house(house, rng, noise=0.03):
    """Points (n, 3) on the roof of a building, world metres."""
    x0, y0, x1, y1 = house.roof.outline.bounds
    xy = rng.uniform((x0, y0), (x1, y1), (1500, 2))
    z = house.roof.height_at(xy)
    xyz = np.column_stack([xy, z + rng.normal(0.0, noise, len(z))])[np.isfinite(z)]
    return house.roof.frame.to_world(xyz)


def test_a_refit_keeps_what_is_held(gable):
    points = sample_house(gable, np.random.default_rng(1))
    changed = gable.with_part(0, height=2.0)
    assert changed.refit(points, fixed={0: ("height",)}).parts[0].parameters["height"] == 2.0
    assert changed.refit(points).parts[0].parameters["height"] == pytest.approx(3.0, abs=0.02)


def test_a_wrong_type_fits_poorly_and_says_so(gable):
    points = sample_house(gable.with_part(0, ridge_height=14.0), np.random.default_rng(2))
    flat = gable.with_part(0, type="flat").refit(points)
    assert flat.grade is Grade.POOR and "%" in flat.detail


def test_an_edit_is_what_is_written_of_it(gable):
    edited = gable.with_part(0, type="hip", rotation=1.0 / 3.0, ridge_height=9.87654321)
    assert building_record(hiproof.build(building_record(edited))) == building_record(edited)


def test_random_edits_are_valid_or_one_sentence():
    outcomes = count_outcomes(EDITS, BUILDINGS, seed=3)
    assert outcomes.keys() == {"valid", "one sentence"} and outcomes["valid"] > EDITS / 2


STEP = 1e-6


def scene(seed):
    """A compound with one pitch changed, so that parts meet anew, and points about its outline,
    some beside it.
    """
    rng = np.random.default_rng(seed)
    roof = random_compound(rng).roof
    west, south, east, north = roof.outline.bounds
    xy = rng.uniform((west - 1.0, south - 1.0), (east + 1.0, north + 1.0), (400, 2))
    points = np.column_stack([xy, rng.normal(3.0, 2.0, len(xy))])
    return roof, points, list_unknowns(roof.parts, {})


@pytest.mark.parametrize("seed", range(6))
def test_heights_are_the_roofs(seed):
    roof, points, unknowns = scene(seed)
    expected = points[:, 2] - roof.height_at(points[:, :2])
    gaps = Heights(roof.parts, points, unknowns).at(unknowns.start).gaps
    covered = np.isfinite(expected)
    np.testing.assert_allclose(gaps[covered], expected[covered], atol=1e-6)
    assert (np.abs(gaps[~covered]) == UNBOUNDED_M).all()


@pytest.mark.parametrize("seed", range(6))
def test_slopes_are_differences_of_heights_away_from_creases(seed):
    roof, points, unknowns = scene(seed)
    heights, x = Heights(roof.parts, points, unknowns), unknowns.start
    surface = heights.at(x)
    slopes = heights.jacobian(x, surface)
    for column in range(len(x)):
        moved = [heights.at(x + sign * STEP * np.eye(len(x))[column]) for sign in (1.0, -1.0)]
        is_one_plane = np.logical_and.reduce(
            [(m.part == surface.part) & (m.row == surface.row) for m in moved]
        )
        numeric = (moved[1].gaps - moved[0].gaps) / (2.0 * STEP)
        assert is_one_plane.mean() > 0.9
        np.testing.assert_allclose(
            slopes[is_one_plane, column], numeric[is_one_plane], atol=1e-2, rtol=1e-3
        )


DEPTH_M, SIDE_M = 2.5, 3.0


def rebuild(house, parts):
    return build({**building_record(house), "parts": parts})


@pytest.fixture(scope="module")
def house():
    return gable_house()


@pytest.fixture(scope="module")
def sunk(house):
    """The house with a recess in the middle of its ridge."""
    return rebuild(house, with_recess(building_record(house)["parts"], house.roof, 0))


def test_a_recess_is_as_deep_as_it_says_and_changes_nothing_beside_it(house, sunk):
    x, y = np.meshgrid(np.linspace(-5.9, 5.9, 40), np.linspace(-3.9, 3.9, 40))
    xy = np.column_stack([x.ravel(), y.ravel()])
    inside = (np.abs(xy) < 0.5 * SIDE_M).all(axis=1)
    old, new = house.roof.height_at(xy), sunk.roof.height_at(xy)
    ridge = house.roof.height_at(np.zeros((1, 2)))[0]
    assert new[inside] == pytest.approx(np.full(inside.sum(), ridge - DEPTH_M), abs=1e-6)
    assert new[~inside] == pytest.approx(old[~inside], abs=1e-6)
    assert not check_solid(sunk.solid)


@pytest.mark.parametrize(
    "change", [{"width": 4.0, "length": 1.5}, {"position": [2.0, 1.0, 5.0]}, {"rotation": 30.0}]
)
def test_where_a_recess_goes_the_roof_comes_back(house, sunk, change):
    position = [float(v) for v in sunk.parts[1].translation]
    moved = sunk.with_part(1, **change)
    back = moved.with_part(1, position=position, rotation=0.0, width=SIDE_M, length=SIDE_M)
    assert not check_solid(moved.solid)
    assert back.solid.volume == pytest.approx(sunk.solid.volume, abs=0.01)
    direct = rebuild(house, with_recess(building_record(house)["parts"], house.roof, 0)).with_part(
        1, **change
    )
    assert moved.solid.volume == pytest.approx(direct.solid.volume, abs=0.01)


def test_a_recess_of_the_same_area_takes_the_same_volume_anywhere_on_a_level_roof(house):
    flat = house.with_part(0, type="flat")
    sunk = rebuild(flat, with_recess(building_record(flat)["parts"], flat.roof, 0))
    volume = flat.solid.volume - sunk.solid.volume
    moved = sunk.with_part(1, position=[2.5, -1.5, float(sunk.parts[1].translation[2])])
    assert volume == pytest.approx(SIDE_M**2 * DEPTH_M, abs=0.01)
    assert flat.solid.volume - moved.solid.volume == pytest.approx(volume, abs=0.01)


def test_a_part_that_leaves_nothing_out_stays_as_it_is(house):
    parts = building_record(
        house.with_part(1, type="flat", width=2.0, length=2.0, position=[0.0, 0.0, 12.0])
    )["parts"]
    moved = {**parts[1], "position": [2.0, 0.0, 12.0], "outlines": None}
    assert replace_part(parts, 1, moved)[0] == parts[0]


def test_a_recess_beside_the_roof_or_over_all_of_a_part_is_one_sentence(house):
    parts = building_record(house)["parts"]
    with pytest.raises(InputError, match="outside it"):
        rebuild(house, with_recess(parts, house.roof, 0, (99.0, 0.0)))
    small = house.with_part(1, type="flat", width=1.0, length=1.0, position=[0.0, 0.0, 12.0])
    with pytest.raises(InputError, match="delete the part"):
        with_recess(building_record(small)["parts"], small.roof, 0, (0.0, 0.0))
