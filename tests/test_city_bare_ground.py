"""Runs over footprints that hold bare ground, or nothing but it: yards are cut out, and what is
gone gets no model.
"""

import numpy as np
import pytest
import shapely

import hiproof
from hiproof.compose import check_solid
from hiproof.edit.folder import measure_doubt
from hiproof.errors import InputWarning
from hiproof.settings import Settings
from hiproof.status import Doubt, Status
from run_records import run_points
from tiny_town import ORIGIN, make_town

X, Y = ORIGIN[:2]
HOUSE, YARD = shapely.box(X, Y, X + 16, Y + 12), shapely.box(X + 9, Y, X + 16, Y + 6)
WALLS_M = 5.0


def scan(has_house=True, density=4.0, seed=0, around=15):
    """Points and classes of level ground at ORIGIN's height with a flat house, its yard at a
    corner, in the middle.
    """
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = HOUSE.buffer(around).bounds
    xy = rng.uniform((x0, y0), (x1, y1), (int(density * (x1 - x0) * (y1 - y0)), 2))
    on_roof = shapely.intersects_xy(HOUSE - YARD, *xy.T) & has_house
    z = ORIGIN[2] + WALLS_M * on_roof + rng.normal(0, 0.03, len(xy))
    return np.column_stack([xy, z]), np.where(on_roof, 6, 2).astype(np.uint8)


def run(folder, xyz, classes, footprint=HOUSE, **settings):
    """The only building, as `folder` has it after a run, and the run's summary."""
    settings = Settings.from_dict({"reconstruct": settings})
    rows, summary = run_points(folder, xyz, classes, {"a": footprint}, settings=settings)
    return rows["a"], summary


def volume(record):
    return hiproof.build(record).volume


@pytest.mark.parametrize("has_classes", [True, False])
@pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")
def test_a_yard_is_cut_out_of_its_footprint(tmp_path, has_classes):
    xyz, classes = scan()
    record, summary = run(tmp_path, xyz, classes if has_classes else np.ones_like(classes))
    assert (
        record["status"] == "modelled"
        and "m2 of bare ground inside its footprint was cut out" in record["detail"]
    )
    assert volume(record) == pytest.approx((HOUSE.area - YARD.area) * WALLS_M, rel=0.04)
    assert not check_solid(hiproof.build(record).solid)
    assert summary.doubts == {Doubt.BARE_GROUND_INSIDE: 1}


@pytest.mark.parametrize("has_house", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_classes_that_footprints_made_hide_no_bare_ground(has_house, seed, tmp_path):
    """All points inside are of the building class, and hedges and cars outside are ground."""
    rng = np.random.default_rng(seed)
    xyz, _ = scan(has_house, density=2.0, seed=seed)
    inside = shapely.intersects_xy(HOUSE, *xyz[:, :2].T)
    for corner in rng.uniform((X - 15, Y - 15), (X + 31, Y + 27), (140, 2)):
        is_thing = ((xyz[:, :2] > corner) & (xyz[:, :2] < corner + rng.uniform(2, 6, 2))).all(
            axis=1
        )
        xyz[is_thing & ~inside, 2] = ORIGIN[2] + rng.uniform(0.5, 7.0)
    record, _ = run(tmp_path, xyz, np.where(inside, 6, 2).astype(np.uint8))
    assert record["status"] == ("modelled" if has_house else "no_building"), record["detail"]


def test_a_footprint_that_is_trusted_is_roofed_over_and_that_is_said(tmp_path):
    record, _ = run(tmp_path, *scan(), footprint_trust="full")
    assert (
        "of bare ground inside its footprint is roofed over; --footprint-trust points cuts it out"
        in record["detail"]
    )
    assert volume(record) == pytest.approx(HOUSE.area * WALLS_M, rel=0.02)


def test_leaves_over_a_yard_leave_it_to_the_footprint(tmp_path):
    xyz, classes = scan()
    is_over_yard = shapely.intersects_xy(YARD, *xyz[:, :2].T)
    leaves = xyz[is_over_yard] + [0.2, 0.1, 6.0]
    is_leaf = (
        np.concatenate([xyz, leaves]),
        np.concatenate([classes, np.full(len(leaves), 5, np.uint8)]),
    )
    record, _ = run(tmp_path, *is_leaf)
    assert "bare ground" not in record["detail"] and record["status"] == "modelled"


def test_where_a_cloud_without_classes_holds_ground_alone_there_is_no_building(tmp_path):
    xyz, _ = scan(has_house=False)
    town = make_town(houses=1)  # so that there are roofs in the cloud
    xyz = np.concatenate([xyz, town.xyz + [100, 0, 0]])
    with pytest.warns(InputWarning):
        record, summary = run(tmp_path, xyz, np.ones(len(xyz), np.uint8))
    assert (
        record["status"] == "no_building" and not record["parts"] and "ground" in record["detail"]
    )
    assert summary.exit_code == 0 and summary.by_status == {"no_building": 1}
    amount, reasons = vars(measure_doubt(record)).values()
    assert amount >= 0.5 and reasons == ("nothing stands on the footprint",)
    with pytest.warns(InputWarning):
        rows, _ = run(
            tmp_path / "asked", xyz, np.ones(len(xyz), np.uint8), empty_footprints="model"
        )
    assert (
        rows["parts"]
        and "perhaps nothing stands there: 100 % of its points lie on the ground" in rows["detail"]
    )


def add_heaps(xyz, classes, class_of_heaps):
    """The cloud with three heaps of rubble and bushes, up to 2 m high, on a quarter of the
    footprint.
    """
    heaps = shapely.union_all(
        shapely.buffer(shapely.points([(X + 3, Y + 8), (X + 9, Y + 4), (X + 14, Y + 9)]), 2.3)
    )
    heap = shapely.intersects_xy(heaps, *xyz[:, :2].T)
    heap_height = np.random.default_rng(1).uniform(0.2, 2.0, len(xyz))
    return xyz + np.outer(heap * heap_height, (0, 0, 1)), np.where(
        heap, class_of_heaps, classes
    ).astype(np.uint8)


def test_heaps_of_the_building_class_on_bare_ground_are_no_building(tmp_path):
    xyz, classes = add_heaps(*scan(has_house=False), 6)
    record, _ = run(tmp_path, xyz, classes)
    assert (
        record["status"] == "no_building"
        and "% of its points lie on the ground" in record["detail"]
    )


@pytest.mark.parametrize("has_classes", [True, False])
@pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")
def test_a_parcel_around_a_house_is_named(has_classes, tmp_path):
    xyz, classes = scan(density=3.0, around=25)
    parcel = shapely.box(X - 22, Y - 22, X + 38, Y + 34)
    record, _ = run(tmp_path, xyz, classes if has_classes else np.ones_like(classes), parcel)
    assert record["status"] == "no_building"
    assert "if that is a house and the footprint its parcel, pass the outline" in record["detail"]


class Level:
    """Level ground at ORIGIN's height."""

    source = "a level"

    def height_at(self, xy):
        return np.full(len(xy), ORIGIN[2])


def test_from_python_ground_points_cut_and_a_terrain_tells_what_is_gone():
    xyz, classes = scan()
    roof, ground = xyz[classes == 6], xyz[classes == 2]
    cut = hiproof.reconstruct(roof, HOUSE, Level(), ground=ground)
    assert cut.volume == pytest.approx((HOUSE.area - YARD.area) * WALLS_M, rel=0.04)
    assert hiproof.reconstruct(roof, HOUSE, Level()).volume == pytest.approx(
        HOUSE.area * WALLS_M, rel=0.02
    )
    building = hiproof.reconstruct(scan(has_house=False)[0], HOUSE, Level())
    assert building.status is Status.NO_BUILDING and building.built is None


@pytest.mark.parametrize("height", [1.0, 2.2])
def test_a_low_shed_stands(height):
    xyz, classes = scan()
    shed = xyz[classes == 6] - [0, 0, WALLS_M - height]
    assert hiproof.reconstruct(shed, HOUSE - YARD, Level()).status is Status.MODELLED


def test_an_override_says_that_a_building_stands(tmp_path):
    (tmp_path / "o.jsonl").write_text('{"id": "a", "type": "flat"}')
    xyz, classes = add_heaps(*scan(has_house=False), 6)
    overrides = str(tmp_path / "o.jsonl")
    row = run_points(tmp_path, xyz, classes, {"a": HOUSE}, overrides=overrides)[0]["a"]
    assert row["parts"] and "overridden: type flat" in row["detail"]


@pytest.mark.parametrize("lone", [1, 2])
def test_returns_below_the_ground_put_no_house_deeper(lone, tmp_path):
    """Returns that came by way of a wall, of the ground's class, under a corner of each house."""
    town = make_town(density=8.0)
    low = [
        [*(np.array(outline.bounds[:2]) + 0.5 + k), ORIGIN[2] - 20.0]
        for outline in town.footprints.values()
        for k in range(lone)
    ]
    xyz, classes = np.concatenate([town.xyz, low]), np.append(town.classification, [2] * len(low))
    found, _ = run_points(tmp_path / "low", xyz, classes, town.footprints)
    usual, _ = run_points(tmp_path / "usual", town.xyz, town.classification, town.footprints)
    for id, row in usual.items():
        assert found[id]["z_ground"] == pytest.approx(row["z_ground"], abs=0.05)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_returns_below_the_ground_are_no_ground_where_no_class_marks_it(seed, tmp_path):
    town, rng = make_town(density=8.0), np.random.default_rng(seed)
    west, south, east, north = town.footprints["house-1"].bounds
    low = rng.uniform((west - 4, south - 4, -18.0), (east + 4, north + 4, -17.0), (12, 3))
    classes = np.where(town.classification == 2, 1, town.classification)
    given = np.concatenate([town.xyz, low]), np.append(classes, [1] * len(low))
    found, _ = run_points(tmp_path / "low", *given, town.footprints)
    assert found["house-1"]["z_ground"] == pytest.approx(2.36, abs=0.1)
