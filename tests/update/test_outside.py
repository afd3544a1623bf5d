"""Roofs outside all outlines: built, extended, pulled down, and those that stood before."""

import csv
import json
import time

import numpy as np
import pyogrio
import pytest
import shapely
from jsonschema import Draft202012Validator

from hiproof.errors import InputError
from hiproof.frames import turn_points
from hiproof.model import PointCloud
from hiproof.parametric.run import build_file
from hiproof.parametric.schema import schema
from hiproof.settings import ReadSettings
from hiproof.update.change_tables import write_changes
from hiproof.update.outside import SurveyCells, load_survey
from hiproof.update.run import update_area
from tiny_town import ORIGIN, make_town
from tiny_updates import DATE, make_request, run_over

BUILT, STOOD, GONE = (5, 28, 15, 36), (40, 28, 48, 36), (70, 28, 78, 36)
EXTENSION = (20, 12, 24, 20)  # beside the first house
SMALL, TREE = (100, 28, 102, 30), (105, 28, 115, 38)


def place(corners):
    """A box of the town in the world."""
    return shapely.affinity.translate(shapely.box(*corners), *ORIGIN[:2])


def put_block(town, corners, height=4.0, scatter=0.0):
    """Raise the ground of the town to the roof of a block."""
    inside = town.lie_in(place(corners)) & (town.classification == 2)
    noise = np.random.default_rng(3).uniform(-scatter, scatter, inside.sum())
    town.xyz[inside, 2] += height + noise
    town.classification[inside] = 6


def compare(folder, before, after, shifts=(0.0, 0.0), changes=None):
    """Run over a town, and return the summary of its update by the points of another."""
    run = run_over(folder, before, shifts[0])
    cloud = after.write(folder / "second.laz", shifts[1])
    return update_area(make_request(run, cloud, folder / "out"), changes)


def read_outside(folder):
    """The rows of roofs outside in the table of changes."""
    with (folder / "out" / "changes.csv").open() as file:
        return [row for row in csv.DictReader(file) if row["class"] == "outside"]


@pytest.fixture(scope="module")
def update(tmp_path_factory):
    folder, before, after = tmp_path_factory.mktemp("outside"), make_town(), make_town(seed=7)
    for block in (STOOD, GONE):
        put_block(before, block)
    for block in (STOOD, BUILT, EXTENSION, SMALL):
        put_block(after, block)
    put_block(after, TREE, 6.0, scatter=2.0)
    return compare(folder, before, after), folder / "out"


@pytest.mark.parametrize("far_m", [5e5, 2e6])
def test_points_far_away_cost_no_time(far_m, tmp_path):
    """As those of a file in another CRS: thousands of kilometres of squares lie between."""
    town = make_town()
    run = run_over(tmp_path, town)
    clouds = town.write(tmp_path / "b.laz", 0.01), town.write(tmp_path / "c.laz", [far_m, far_m, 0])
    start = time.process_time()
    summary = update_area(make_request(run, "", tmp_path / "out", clouds=clouds))
    assert time.process_time() - start < 60.0
    assert summary.by_change == {"unchanged": len(town.footprints)}


def test_roofs_outside_all_outlines_are_told_apart(update):
    summary, out = update
    assert summary.outside == {"built": 1, "demolished": 1, "extended": 1, "unmapped": 1}
    table = read_outside(out.parent)
    rows, areas = {row["kind"]: row for row in table}, [float(row["area_m2"]) for row in table]
    assert areas == sorted(areas, reverse=True) and len(set(areas)) > 1
    assert rows["extended"]["id"] == "house-0" and rows["built"]["id"] == ""
    for kind, row in rows.items():
        assert float(row["height_m"]) == pytest.approx(4.0, abs=0.3), kind
        assert 0.9 < float(row["confidence"]) <= 1.0, kind
    meta, _, geometry, columns = pyogrio.raw.read(out / "changes.gpkg", layer="changed_places")
    kinds = columns[list(meta["fields"]).index("kind")].tolist()
    places = dict(zip(kinds, shapely.from_wkb(geometry), strict=True))
    for kind, corners in (("built", BUILT), ("demolished", GONE), ("unmapped", STOOD)):
        box = place(corners)
        common = places[kind].intersection(box).area / places[kind].union(box).area
        assert common > 0.75, kind
    box = place(EXTENSION)
    assert places["extended"].intersection(box).area > 0.75 * box.area


@pytest.mark.parametrize("classes, name", [((6, 1), "new"), ((1, 6), "earlier")])
def test_a_survey_without_ground_says_that_no_roofs_outside_are_found(classes, name, tmp_path):
    before, after = make_town(houses=2), make_town(houses=2, seed=7)
    put_block(after, BUILT)
    for town, code in zip((before, after), classes, strict=True):
        town.classification[:] = np.where(code == 1, 1, town.classification)
    with pytest.warns(UserWarning, match=f"the {name} survey has no points of a ground class"):
        assert compare(tmp_path, before, after).outside == {}


@pytest.mark.parametrize("turn", [0.0, 0.3, 0.7])
@pytest.mark.parametrize("gap", [(11, 20, 16.5, 23.5), (11, 20, 17, 23)])
def test_an_extension_that_fills_a_gap_between_others_is_found(gap, turn, tmp_path):
    """Most of its cells lie beside an outline: of 20 m2 four square metres do not."""
    x0, y0, x1, y1 = gap
    before, after = make_town(houses=1, density=8.0), make_town(houses=1, seed=7, density=8.0)
    sides = {"west": (x0 - 3, y0, x0, y1), "east": (x1, y0, x1 + 3, y1)}
    for town in (before, after):
        for side in sides.values():
            put_block(town, side, 3.0)
    put_block(after, gap, 3.0)
    outlines = before.footprints | {id: place(side) for id, side in sides.items()}

    def turn_places(xy):
        return ORIGIN[:2] + turn_points(xy - ORIGIN[:2], turn)

    for town in (before, after):
        town.xyz[:, :2] = turn_places(town.xyz[:, :2])
    for id, outline in outlines.items():
        before.footprints[id] = shapely.transform(outline, turn_places)
    assert compare(tmp_path, before, after).outside == {"extended": 1}
    (row,) = read_outside(tmp_path)
    assert row["id"] == "house-0"


def test_a_shift_is_taken_off_roofs_outside(tmp_path):
    """Else an extension stands apart from its house, and all roofs reach beyond their outlines."""
    before, after = make_town(density=8.0), make_town(seed=7, density=8.0)
    put_block(after, (20, 12, 24, 20))
    given = {"read": {"shift": "0.8,0.3,0.5"}}
    summary = compare(tmp_path, before, after, (0.0, [0.8, 0.3, 0.5]), given)
    assert summary.outside == {"extended": 1}
    roof = json.loads((tmp_path / "out" / "parameters.jsonl").read_text().splitlines()[0])
    (ring,) = roof["update"]["roofs_outside"][0]["outlines"][0]
    box = place((20, 12, 24, 20))
    common = shapely.intersection(shapely.Polygon(ring), box).area
    assert common > 0.75 * max(box.area, shapely.Polygon(ring).area)


@pytest.mark.parametrize("aside", [0.3, 0.5, 0.8])
def test_an_extension_of_three_metres_is_found_wherever_it_lies(aside, tmp_path):
    """Its cells beside the outline count where those beyond them are few."""
    before, after = make_town(houses=1), make_town(houses=1, seed=7)
    put_block(after, (20, 12, 22.8, 20))
    move_outlines(before, aside)
    shifts = ([aside, aside, 0],) * 2
    assert compare(tmp_path, before, after, shifts).outside == {"extended": 1}


def move_outlines(town, aside, inwards_m=0.0):
    """Move all outlines to the north-east, and draw them in."""
    for id, outline in town.footprints.items():
        wall = shapely.buffer(outline, -inwards_m, join_style="mitre")
        town.footprints[id] = shapely.transform(wall, lambda xy: xy + aside)


@pytest.mark.parametrize("aside", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_eaves_hide_no_small_extension(aside, tmp_path):
    """Of 10 m2 beside a wall, 2.5 m deep, the earlier survey shows eaves over 0.4 m."""
    before, after = (make_town(houses=1, seed=seed, density=8.0) for seed in (0, 7))
    put_block(after, (20, 13, 22.1, 17))
    move_outlines(before, aside, 0.4)
    shifts = ([aside, aside, 0],) * 2
    assert compare(tmp_path, before, after, shifts).outside == {"extended": 1}


@pytest.mark.parametrize("densities", [(8.0, 1.0), (1.0, 1.0), (1.0, 8.0)])
def test_roofs_outside_are_found_in_sparse_surveys(densities, tmp_path):
    """Of a survey of 1 point/m2 a third of the cells hold no points, which part no roof."""
    before, after = (
        make_town(houses=2, seed=seed, density=density)
        for seed, density in zip((0, 7), densities, strict=True)
    )
    put_block(before, (40, 28, 46, 34))
    for block in ((5, 28, 11, 34), (20, 12, 25, 18)):
        put_block(after, block)
    assert compare(tmp_path, before, after).outside == {"built": 1, "demolished": 1, "extended": 1}
    areas = [float(row["area_m2"]) for row in read_outside(tmp_path)]
    assert sorted(areas) == pytest.approx([30, 36, 36], rel=0.35)


def test_build_makes_the_same_tables_of_the_parameters(update, tmp_path):
    _, out = update
    build_file(out / "parameters.jsonl", tmp_path)
    write_changes(tmp_path)
    for name in ("changes.csv", "changes.gpkg"):
        assert (tmp_path / name).read_bytes() == (out / name).read_bytes(), name
    validator = Draft202012Validator(schema())
    lines = (out / "parameters.jsonl").read_text().splitlines()
    assert not [
        error.message for line in lines for error in validator.iter_errors(json.loads(line))
    ]


def test_a_change_without_a_place_has_its_class_as_kind(update, tmp_path):
    """Such as a shed that the survey does not cover: too small for a place of its own."""
    lines = (update[1] / "parameters.jsonl").read_text().splitlines()
    change = {"class": "not_covered", "survey": DATE, "chance": 1.0, "places": [], "lineage": []}
    change |= {"predecessors": [], "valid_from": None, "valid_to": None}
    lines[1] = json.dumps(json.loads(lines[1]) | {"change": change})
    (tmp_path / "parameters.jsonl").write_text("\n".join(lines) + "\n")
    write_changes(tmp_path)
    with (tmp_path / "changes.csv").open() as file:
        assert next(csv.DictReader(file))["kind"] == "not_covered"


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ({"survey": 5}, "expected text as survey"),
        ({"survey": DATE, "roofs": []}, "expected the keys survey, roofs_outside of the update"),
        (
            {"survey": DATE, "roofs_outside": [{"kind": "built", "area": "x"}]},
            "as the area of roof 0 of roofs_outside",
        ),
    ],
)
def test_a_head_that_no_update_wrote_is_refused(value, words, update, tmp_path):
    head, *rest = (update[1] / "parameters.jsonl").read_text().splitlines()
    head = json.dumps(json.loads(head) | {"update": value})
    (tmp_path / "parameters.jsonl").write_text("\n".join([head, *rest]) + "\n")
    with pytest.raises(InputError, match=words):
        build_file(tmp_path / "parameters.jsonl", tmp_path / "built")


def test_buildings_inside_their_outlines_are_not_reported(update):
    summary, _ = update
    assert summary.by_change == {"unchanged": 4}


def test_cells_do_not_depend_on_how_points_are_cut(tmp_path):
    rng = np.random.default_rng(1)
    points = np.round(rng.uniform(0, 9, (500, 3)), 3)
    whole, halves = SurveyCells(ReadSettings()), SurveyCells(ReadSettings())
    classes = np.where(np.arange(500) % 2, 6, 2).astype(np.uint8)
    whole.add(PointCloud(points, classes))
    for half in (slice(0, 250), slice(250, None)):
        halves.add(PointCloud(points[half], classes[half]))
    whole.save(tmp_path / "whole" / "0.npz")
    halves.save(tmp_path / "halves" / "0.npz")
    corners = np.zeros(2), np.full(2, 9.0)
    surveys = [load_survey(tmp_path / name, *corners) for name in ("whole", "halves")]
    for kind in ("roof", "ground"):
        cells = [survey[kind] for survey in surveys]
        assert len(cells[0]) > 70
        np.testing.assert_allclose(*cells, atol=1e-9)


def test_without_a_building_class_level_places_high_above_ground_are_roofs(tmp_path):
    town = make_town()
    for block in (BUILT, TREE):
        put_block(town, block, 6.0, scatter=2.0 if block == TREE else 0.02)
    classes = np.where(town.classification == 6, 1, town.classification).astype(np.uint8)
    cells = SurveyCells(ReadSettings(roofs="shape"))
    cells.add(PointCloud(town.xyz, classes))
    cells.save(tmp_path / "0.npz")
    cells = load_survey(tmp_path, ORIGIN[:2] - 10, ORIGIN[:2] + 200)
    xy = cells["roof"][:, :2] - ORIGIN[:2]
    built, tree = (
        shapely.intersects_xy(shapely.box(*corners), *xy.T).sum() for corners in (BUILT, TREE)
    )
    assert built > 70 and tree < 20
    assert len(xy) < 600
