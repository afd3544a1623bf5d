"""Overrides: the fit obeys them and fits the rest; a run with others redoes those
buildings alone.
"""

import dataclasses
import json

import numpy as np
import pyogrio
import pytest
import shapely

import hiproof
from hiproof.city import run as city_run
from hiproof.city.folder.ledger import Ledger
from hiproof.city.plan.overrides import table_records
from hiproof.city.work.noted import noted_file, save_run_boxes
from hiproof.compose import check_solid
from hiproof.errors import InputError, InputWarning
from hiproof.parametric.override import overridden, read_override
from hiproof.settings import Settings
from hiproof.status import Grade, Status
from hiproof.write.parameters import building_record
from layers import write_layer
from run_records import by_id, records
from tiny_town import make_town, write_cloud, write_footprints

PLAIN = Settings.from_dict({"segment": {"network": "never"}})


@pytest.fixture(scope="module")
def gable_scan():
    """Points of a gable of 12 by 8 m with its ridge at 8 m and eaves at 5 m, and its footprint."""
    rng = np.random.default_rng(0)
    xy = rng.uniform((0, 0), (12, 8), (800, 2))
    z = 8.0 - 0.75 * np.abs(xy[:, 1] - 4.0) + rng.normal(0, 0.02, len(xy))
    return np.column_stack([xy, z]), shapely.box(0, 0, 12, 8)


def override(scanned, **said):
    return overridden(read_override({"id": "a", **said}), *scanned, settings=PLAIN, id="a")


def test_a_type_is_obeyed_and_the_rest_fitted(gable_scan):
    house = override(gable_scan, type="hip")
    assert house.type == "hip" and not check_solid(house.solid)
    assert "overridden: type hip" in house.detail


def test_a_ridge_is_obeyed_and_the_contradiction_is_said(gable_scan):
    house = override(gable_scan, ridge_height=12.0)
    assert house.solid.vertices[:, 2].max() == pytest.approx(12.0, abs=0.01)
    assert house.grade is Grade.POOR and "overridden: ridge_height 12.0" in house.detail
    assert override(gable_scan, ridge_height=8.0, who="anna", note="seen").detail.endswith(
        "ridge_height 8.0 (seen, anna)"
    )


def test_a_ground_given_settles_the_doubt_about_a_terrain_above_the_eaves(gable_scan):
    class Above:
        source = "a wrong terrain model"

        def height_at(self, xy):
            return np.full(len(xy), 50.0)

    for overrides, is_told in (({"type": "gable"}, True), ({"z_ground": 1.0}, False)):
        house = overridden(
            read_override({"id": "a", **overrides}), *gable_scan, Above(), settings=PLAIN, id="a"
        )
        assert ("above its eaves" in house.detail) == is_told


def test_a_ground_above_the_eaves_is_said(gable_scan):
    assert "ground given" not in override(gable_scan, z_ground=1.0).detail
    assert "ground given" not in override(gable_scan, z_ground=-500.0).detail
    house = override(gable_scan, z_ground=7.0)
    assert "the ground given lies above its lowest eave; overridden: z_ground 7.0" in house.detail
    assert house.solid.vertices[:, 2].min() < 5.0 and not check_solid(house.solid)


def test_no_more_parts_than_asked_for():
    rng = np.random.default_rng(1)
    xy = rng.uniform((0, 0), (16, 8), (1600, 2))
    z = np.where(xy[:, 0] < 10, 8.0 - 0.75 * np.abs(xy[:, 1] - 4.0), 3.0)
    scan = np.column_stack([xy, z]), shapely.box(0, 0, 16, 8)
    assert len(hiproof.reconstruct(*scan, settings=PLAIN).parts) == 2
    single_part = override(scan, parts=1)
    assert len(single_part.parts) == 1 and not check_solid(single_part.solid)


def test_parts_given_stand_where_the_run_moved_the_footprint():
    """What a run wrote of a footprint beside its roof is an override that gives the run's own
    building again, moved and measured.
    """
    rng = np.random.default_rng(3)
    xy = rng.uniform((0, 0), (12, 8), (800, 2))
    scan = np.column_stack([xy, 8.0 - 0.75 * np.abs(xy[:, 1] - 4.0) + rng.normal(0, 0.02, len(xy))])
    moved_footprint = shapely.box(0.9, -1.1, 12.9, 6.9)
    house = hiproof.reconstruct(scan, moved_footprint, settings=PLAIN, id="a")
    assert np.hypot(*house.shift) > 1.0
    rebuilt = overridden(
        read_override(building_record(house)), scan, moved_footprint, settings=PLAIN, id="a"
    )
    assert rebuilt.shift == house.shift and np.array_equal(
        rebuilt.solid.vertices, house.solid.vertices
    )
    assert rebuilt.quality == house.quality and "moved by" in rebuilt.detail
    block = override((scan, moved_footprint), block_height=6.0, z_ground=1.0)
    assert block.shift == house.shift and block.roof.outline.area == pytest.approx(96.0, abs=0.01)


def test_ground_block_and_leaving_out(gable_scan):
    assert override(gable_scan, z_ground=1.5).solid.vertices[:, 2].min() == pytest.approx(1.5)
    block = override(gable_scan, block_height=6.0, z_ground=1.0)
    assert block.type == "flat" and np.ptp(block.solid.vertices[:, 2]) == pytest.approx(6.0)
    omitted = override(gable_scan, leave_out=True, note="torn down")
    assert (
        omitted.status is Status.LEFT_OUT
        and omitted.built is None
        and "torn down" in omitted.detail
    )


def test_a_block_around_a_courtyard_needs_no_points(gable_scan):
    court = shapely.box(4.0, 3.0, 8.0, 5.0)
    footprint = gable_scan[1].difference(court)
    block = override((np.zeros((0, 3)), footprint), block_height=6.0, z_ground=1.0)
    assert block.volume == pytest.approx(6.0 * footprint.area)


def test_parts_given_are_the_parts(gable_scan):
    part = {
        "type": "hip",
        "parameters": {"width": 8, "length": 12, "height": 3, "ridge_length": 5},
        "position": [0, 0, 5],
    }
    house = override(gable_scan, parts=[part], origin=[6, 4, 0])
    assert house.type == "hip" and house.parts[0].parameters["ridge_length"] == 5.0
    assert house.quality.points > 500 and house.attributes == {} and "fitted" not in house.detail
    empty = overridden(
        read_override({"id": "a", "parts": [part], "origin": [6, 4, 0], "z_ground": 0}),
        np.zeros((0, 3)),
        gable_scan[1],
    )
    assert empty.status is Status.MODELLED and not check_solid(empty.solid)


def test_a_part_list_that_makes_no_roof_is_one_sentence(gable_scan):
    part = {"type": "hip", "parameters": {"width": -8, "length": 12}, "position": [0, 0, 5]}
    house = override(gable_scan, parts=[part], origin=[6, 4, 0])
    assert house.status is Status.NOT_BUILT and "positive width" in house.detail


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({}, "expected the id"),
        ({"id": "a", "colour": "red"}, "got also colour"),
        ({"id": "a", "type": "igloo"}, "got 'igloo'"),
        ({"id": "a", "types": "gable,igloo"}, "got 'igloo'"),
        ({"id": "a", "type": "hip", "types": ["gable"]}, "the type among the types"),
        ({"id": "a", "types": []}, "name one at least"),
        ({"id": "a", "types": 5}, "expected a list of roof types"),
        ({"id": "a", "types": [["hip"]]}, r"got \['hip'\]"),
        ({"id": "a", "type": ["hip"]}, r"got \['hip'\]"),
        ({"id": "a", "leave_out": True, "type": "hip"}, "leave_out without"),
        (
            {"id": "a", "leave_out": "false"},
            "true or false as leave_out of the override of 'a', got 'false'",
        ),
        ({"id": "a", "leave_out": ["no"]}, "true or false as leave_out"),
        ({"id": "a", "block_height": 3, "ridge_height": 3}, "block_height without"),
        ({"id": "a", "block_height": -3}, "block_height from 0.1 to 900 .* got -3"),
        ({"id": "a", "parts": 1.5}, "whole number"),
        ({"id": "a", "parts": 0}, "parts from 1 to"),
        ({"id": "a", "parts": []}, "the origin of its parts"),
        (
            {"id": "a", "parts": [], "origin": [0, 0, 0], "type": "hip", "ridge_height": 3},
            "list of parts without",
        ),
        ({"id": "a", "ridge_height": float("nan")}, "a number as ridge_height"),
        ({"id": "a", "fixed": {"height": "high"}}, "a number as height"),
        (
            {"id": "a", "ridge_height": 1e9},
            "ridge_height from -600 to 9000 in the override of 'a', got 1e\\+09",
        ),
        ({"id": "a", "z_ground": -9999}, "z_ground from -600 to 9000 in the override of 'a'"),
        ({"id": "a", "block_height": 999}, "block_height from 0.1 to 900 in the override of 'a'"),
        ("hip", "an object as an override"),
    ],
)
def test_what_an_override_cannot_say_is_one_sentence(overrides, message):
    with pytest.raises(InputError, match=message):
        read_override(overrides)


def request(town_files, out, path, *lines, **changes):
    if path is not None:
        path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    settings = PLAIN.replace(changes.pop("settings", {}))
    return hiproof.Request(
        (town_files[0],),
        out,
        town_files[1],
        settings=settings,
        overrides=path and str(path),
        **changes,
    )


def test_a_run_with_other_overrides_redoes_those_buildings_alone(town_files, tmp_path, solved_ids):
    out, path = tmp_path / "out", tmp_path / "o.jsonl"
    run = city_run.reconstruct_area
    run(request(town_files, out, None))
    plain, rows = records(out), by_id(out)
    assert sorted(solved_ids) == [f"house-{i}" for i in range(4)]
    solved_ids.clear()
    run(request(town_files, out, path, {"id": "house-1", "type": "hip"}))
    assert solved_ids == ["house-1"]
    changed = by_id(out)
    assert {id for id in rows if changed[id] != rows[id]} == {"house-1"} and changed["house-1"][
        "type"
    ] == "hip"
    solved_ids.clear()
    run(request(town_files, out, path, {"id": "house-1", "type": "hip"}))
    assert solved_ids == []
    run(request(town_files, out, path, {"id": "house-2", "leave_out": True}))
    assert (
        sorted(solved_ids) == ["house-1", "house-2"]
        and by_id(out)["house-2"]["status"] == "left_out"
    )
    together = records(out)
    solved_ids.clear()
    run(request(town_files, out, None))
    assert solved_ids == ["house-2"] and records(out) == plain
    run(request(town_files, tmp_path / "new", path, {"id": "house-2", "leave_out": True}))
    assert records(tmp_path / "new") == together


def points_read(out):
    """How many points the last run in `out` read."""
    return sum(
        json.loads(t.message)["points"]
        for t in Ledger(out / ".hiproof/ledger.sqlite").tasks()
        if t.kind == "sort"
    )


@pytest.mark.parametrize("keeps_points", ["noted", "lost", "of another file"])
def test_what_is_redone_reads_the_points_near_it_alone(keeps_points, tmp_path, monkeypatch):
    monkeypatch.setattr("hiproof.read.points.runs.RUN_POINTS", 50)
    town, out, path = make_town(), tmp_path / "out", tmp_path / "o.jsonl"
    flown = np.argsort(town.xyz[:, 0].round(-1), kind="stable")
    cloud = str(write_cloud(tmp_path / "cloud.laz", town.xyz[flown], town.classification[flown]))
    files = cloud, str(write_footprints(tmp_path / "footprints.geojson", town.footprints))
    city_run.reconstruct_area(request(files, out, None))
    assert points_read(out) == len(town.xyz)
    noted = noted_file(out / ".hiproof", 0)
    if keeps_points == "lost":
        noted.unlink()
    elif keeps_points == "of another file":
        save_run_boxes(noted, [np.zeros((3, 4))], 150)
    lines = ({"id": "house-0", "ridge_height": 8.0},)
    city_run.reconstruct_area(request(files, out, path, *lines))
    n_points = points_read(out)
    assert n_points < 0.7 * len(town.xyz) if keeps_points == "noted" else n_points == len(town.xyz)
    city_run.reconstruct_area(request(files, tmp_path / "new", path, *lines))
    assert records(out) == records(tmp_path / "new")


def test_a_run_killed_while_it_redoes_goes_on(town_files, tmp_path, solved_ids, monkeypatch):
    out, path = tmp_path / "out", tmp_path / "o.jsonl"
    city_run.reconstruct_area(request(town_files, out, None))
    ask = request(town_files, out, path, {"id": "house-0", "block_height": 4.0})
    with monkeypatch.context() as patch:
        patch.setattr(city_run, "solve_tile", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            city_run.reconstruct_area(ask)
    solved_ids.clear()
    city_run.reconstruct_area(ask)
    assert solved_ids == ["house-0"] and by_id(out)["house-0"]["type"] == "flat"


def test_without_kept_texts_all_is_made_again(town_files, tmp_path, solved_ids):
    out, path = tmp_path / "out", tmp_path / "o.jsonl"
    city_run.reconstruct_area(request(town_files, out, None))
    for file in (out / ".hiproof/tiles").iterdir():
        file.unlink()
    solved_ids.clear()
    city_run.reconstruct_area(request(town_files, out, path, {"id": "house-0", "type": "hip"}))
    assert len(solved_ids) == 4 and by_id(out)["house-0"]["type"] == "hip"


def test_a_runs_own_parameters_are_overrides_that_change_nothing(
    town_files, reference_run, tmp_path
):
    first = tmp_path / "first"
    city_run.reconstruct_area(request(town_files, first, None))
    ask = request(town_files, tmp_path / "again", None)
    city_run.reconstruct_area(
        hiproof.Request(**{**vars(ask), "overrides": str(first / "parameters.jsonl")})
    )
    old, new = by_id(first), by_id(tmp_path / "again")
    for id in old:
        assert new[id]["parts"] == old[id]["parts"] and new[id]["z_ground"] == old[id]["z_ground"]
        assert new[id]["residuals"] == old[id]["residuals"]


def columns_request(town_files, tmp_path, pair):
    """A run over footprints that have a column `daktype`, of whose settings `pair` is the only one
    of override_columns.
    """
    meta, _, outlines, columns = pyogrio.raw.read(town_files[1])
    columns = dict(zip(meta["fields"], columns, strict=True))
    columns["daktype"] = np.array(["hip", *[None] * (len(outlines) - 1)], object)
    path = write_layer(tmp_path / "footprints.gpkg", shapely.from_wkb(outlines), columns)
    settings = PLAIN.replace({"read": {"override_columns": [pair]}})
    return hiproof.Request((town_files[0],), tmp_path / "out", str(path), settings=settings)


def columns_run(folder, key, values, town):
    """What a run writes, by id, of a town whose footprints have a column that holds `values` of the
    override's `key`.
    """
    cloud = write_cloud(folder / "cloud.laz", town.xyz, town.classification)
    columns = {"id": list(town.footprints), "known": values}
    path = write_layer(folder / "footprints.gpkg", town.footprints.values(), columns)
    settings = PLAIN.replace({"read": {"override_columns": [f"known={key}"]}})
    city_run.reconstruct_area(
        hiproof.Request((str(cloud),), folder / "out", str(path), settings=settings)
    )
    return by_id(folder / "out")


@pytest.mark.parametrize("kind", [float, str])
def test_a_ground_of_0_counts_and_codes_are_left_out_and_told(tmp_path, kind):
    town = make_town(houses=4)
    values = [kind(value) for value in (0.0, -0.5, -9999.0, 3.4e38)]
    with pytest.warns(
        InputWarning, match="z_ground from -600 to 9000, left out 2 of its values: -9999"
    ):
        rows = columns_run(tmp_path, "z_ground", values, town)
    z = {id: row["z_ground"] for id, row in rows.items()}
    assert (
        z["house-0"] == 0.0
        and z["house-1"] == -0.5
        and rows["house-0"]["ground_source"] == "override"
    )
    assert z["house-2"] == pytest.approx(2.7, abs=0.1) and z["house-3"] == pytest.approx(
        3.0, abs=0.1
    )
    assert "overridden" not in rows["house-2"]["detail"]


def test_a_ridge_at_0_counts(tmp_path):
    town = make_town(houses=1)
    lowered = dataclasses.replace(town, xyz=town.xyz - [0, 0, 10.0])
    (row,) = columns_run(tmp_path, "ridge_height", [0.0], lowered).values()
    assert "overridden: ridge_height 0.0" in row["detail"]
    (part,) = row["parts"]
    assert part["position"][2] + row["origin"][2] + part["parameters"]["height"] == pytest.approx(
        0.0, abs=0.01
    )


@pytest.mark.parametrize(
    "key, value", [("parts", 0), ("block_height", 0.0), ("block_height", -9999.0)]
)
def test_sizes_of_0_in_a_column_are_left_out_and_told(tmp_path, key, value):
    with pytest.warns(
        InputWarning, match=f"expected {key} from .*, left out 1 of its values: .* of house-0"
    ):
        (row,) = columns_run(tmp_path, key, [value], make_town(houses=1)).values()
    assert row["status"] == "modelled" and "overridden" not in row["detail"]


def test_a_ground_given_far_from_the_ground_points_is_obeyed_and_told(tmp_path):
    (row,) = columns_run(tmp_path, "z_ground", [-99.0], make_town(houses=1)).values()
    assert (
        row["z_ground"] == -99.0
        and "the ground given lies 101.1 m below the ground points" in row["detail"]
    )


@pytest.mark.parametrize(
    "overrides", [{"leave_out": True}, {"block_height": 5.0}, {"types": ["gable"]}]
)
def test_where_a_file_says_something_else_than_columns_the_file_counts(
    town_files, tmp_path, overrides
):
    (tmp_path / "o.jsonl").write_text(json.dumps({"id": "house-0", "type": "", **overrides}))
    request = columns_request(town_files, tmp_path, "daktype=type")
    given = {"overrides": str(tmp_path / "o.jsonl"), "where": "daktype = 'hip'"}
    city_run.reconstruct_area(dataclasses.replace(request, **given))
    house = by_id(tmp_path / "out")["house-0"]
    assert (
        house["type"] != "hip"
        and "overridden: " in house["detail"]
        and "hip" not in house["detail"]
    )


WRONG_PAIRS = {
    "roof=type": r"columns of the footprints \(.*daktype.*\) .*got 'roof'",
    "daktype=tipe": "keys of an override .*got 'tipe'",
    "daktype": "keys of an override .*got ''",
}


def test_columns_override_too_and_others_are_refused_and_hold_the_folder_not(town_files, tmp_path):
    for pair, message in WRONG_PAIRS.items():
        with pytest.raises(InputError, match=message):
            city_run.reconstruct_area(columns_request(town_files, tmp_path, pair))
        (tmp_path / "footprints.gpkg").unlink()
    city_run.reconstruct_area(columns_request(town_files, tmp_path, "daktype=type"))
    rows = by_id(tmp_path / "out")
    assert rows["house-0"]["type"] == "hip" and "overridden: type hip" in rows["house-0"]["detail"]
    assert "overridden" not in rows["house-1"]["detail"]


def test_a_table_of_typed_columns_says_what_it_says_where_rows_leave_gaps(tmp_path):
    """A yes beside a row without one was read as 1.0, which said nothing: the house that was pulled
    down stayed.
    """
    gaps = np.array([True, False, False])
    columns = [np.array([7, 8, 9]), np.array([False, True, False]), np.array([0, 0, 2], np.int32)]
    path = str(tmp_path / "o.gpkg")
    masks = [None, gaps, np.array([True, True, False])]
    pyogrio.raw.write(path, None, columns, ["id", "leave_out", "parts"], masks)
    rows = table_records(path)
    assert rows == [
        {"id": "7"},
        {"id": "8", "leave_out": True},
        {"id": "9", "leave_out": False, "parts": 2},
    ]


@pytest.mark.parametrize(
    "text, value",
    [("yes", True), ("Y", True), ("1.0", True), ("no", False), ("0", False), ("", None)],
)
def test_a_table_says_yes_in_many_ways_and_what_is_none_is_refused(tmp_path, text, value):
    (tmp_path / "o.csv").write_text(f"id,leave_out\na,{text}\n")
    (row,) = table_records(str(tmp_path / "o.csv"))
    assert read_override(row).leave_out == bool(value)
    (tmp_path / "o.csv").write_text("id,leave_out\na,perhaps\n")
    with pytest.raises(InputError, match="true or false as leave_out"):
        read_override(*table_records(str(tmp_path / "o.csv")))


def run_with_overrides(town_files, folder, name):
    cloud, footprints = town_files
    options = {"settings": PLAIN, "overrides": str(folder / name)}
    city_run.reconstruct_area(hiproof.Request((cloud,), folder / "out", footprints, **options))


def test_tables_override_too(town_files, tmp_path):
    (tmp_path / "o.csv").write_text(
        "id,type,ridge_height,leave_out\nhouse-0,hip,,\nhouse-1,,,true\nelsewhere,,9.5,\n"
    )
    with pytest.warns(
        InputWarning, match="no building of this run for 1 of 3 overrides: elsewhere"
    ):
        run_with_overrides(town_files, tmp_path, "o.csv")
    rows = by_id(tmp_path / "out")
    assert rows["house-0"]["type"] == "hip" and rows["house-1"]["status"] == "left_out"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"id": "a", "type": "hip"}\n{"id": "a", "type": "gable"}\n', "two that differ of 'a'"),
        ('{"id": "a", "type": "hip"\n', "line 1 of .* column"),
        ('\n{"id": "a", "type": "igloo"}\n', "line 2 of .*: expected a roof type"),
        ('{"id": "café", "type": "hip"}\n'.encode("latin-1"), "save it as UTF-8"),
    ],
)
def test_overrides_that_cannot_be_read_are_refused_before_anything_is_redone(
    text, message, town_files, tmp_path
):
    (tmp_path / "o.jsonl").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=message):
        run_with_overrides(town_files, tmp_path, "o.jsonl")
    assert not list((tmp_path / "out").glob("*.gml"))
