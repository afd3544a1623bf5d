"""What the page may ask, without a browser: edits that change the model, accepted ones that last,
two windows that lose nothing.
"""

import base64
import json
import shutil
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import hiproof
from flat_town import make_request
from hiproof.city.plan.overrides import read_overrides
from hiproof.compose import check_solid
from hiproof.edit.desk import Desk
from hiproof.edit.edits import EDITS_FILE, UNTOUCHED, Edits, OtherVersion
from hiproof.edit.folder import measure_doubt
from hiproof.errors import HiproofError, InputError, InputWarning
from hiproof.evaluate.run import evaluate_run
from hiproof.read.models.solids import read_solids
from run_records import by_id

ID = "house-0"


@pytest.fixture
def desk(folder):
    return Desk(folder, "anna")


def edit(desk, parts, id=ID, **asked):
    return desk.change(id, {"parts": parts, "asked": asked})


def test_from_a_wrong_type_to_a_rebuilt_city(town_files, folder, desk):
    old = by_id(folder)
    start = desk.building(ID)
    assert start["type"] == "flat" and start["version"] == UNTOUCHED
    gable = edit(desk, start["parts"], action="change", part=0, change={"type": "gable"})
    fitted = edit(desk, gable["parts"], action="refit")
    assert fitted["type"] == "gable"
    assert fitted["figures"]["share_within_20cm"] > 0.95 > start["figures"]["share_within_20cm"]
    desk.accept(
        ID, {"parts": fitted["parts"], "version": start["version"], "note": "seen from the street"}
    )
    hiproof.reconstruct_area(make_request(town_files, folder, folder / EDITS_FILE))
    new = by_id(folder)
    assert new[ID]["type"] == "gable" and "(seen from the street, anna, " in new[ID]["detail"]
    assert new[ID]["parts"] == fitted["parts"]
    # the page goes on
    assert next(row for row in desk.buildings()["rows"] if row["id"] == ID)["type"] == "gable"
    assert all(new[id] == old[id] for id in old if id != ID)
    solids = dict(read_solids(folder / "buildings.gml"))
    assert len(solids) == len(old)
    assert not any(check_solid(solid, planarity_m=0.01) for solid in solids.values())


def test_on_a_level_roof_a_dormer_is_a_block_that_a_hand_can_size(desk):
    start = desk.building("house-3")  # flat indeed
    block = edit(desk, start["parts"], id="house-3", action="dormer", part=0)
    assert [part["type"] for part in block["parts"]] == ["flat", "flat"]
    grown = (
        block["figures"]["ridge_height"]
        - edit(desk, start["parts"], id="house-3", action="show")["figures"]["ridge_height"]
    )
    assert grown == pytest.approx(2.5, abs=1e-3)
    wide = edit(desk, block["parts"], id="house-3", action="change", part=1, change={"width": 4.0})
    assert wide["figures"]["volume_m3"] > block["figures"]["volume_m3"] + 1.0


def test_ground_and_leaving_out_are_kept_in_place_of_each_other(desk):
    start = desk.building(ID)
    assert start["said"] == {"z_ground": None, "leave_out": None}
    raised = desk.change(
        ID, {"parts": start["parts"], "z_ground": 1.25, "asked": {"action": "show"}}
    )
    assert (
        raised["figures"]["z_ground"]
        == 1.25
        != edit(desk, start["parts"], action="show")["figures"]["z_ground"]
    )
    version = desk.accept(ID, {"parts": start["parts"], "z_ground": 1.25, "version": UNTOUCHED})[
        "version"
    ]
    assert desk.building(ID)["said"]["z_ground"] == 1.25 == desk.building(ID)["figures"]["z_ground"]
    # the run's own ground again
    version = desk.accept(ID, {"parts": start["parts"], "version": version})["version"]
    assert "z_ground" not in desk.edits.of(ID)[0]
    desk.accept(ID, {"leave_out": True, "version": version, "note": "torn down"})
    assert {name: desk.edits.of(ID)[0].get(name) for name in ("leave_out", "parts", "note")} == {
        "leave_out": True,
        "parts": None,
        "note": "torn down",
    }
    assert desk.building(ID)["said"]["leave_out"] is True
    with pytest.raises(InputError, match="z_ground"):
        desk.change(ID, {"parts": start["parts"], "z_ground": "low", "asked": {"action": "show"}})
    with pytest.raises(InputError, match="nowhere"):
        desk.accept("nowhere", {"leave_out": True, "version": UNTOUCHED})


def test_the_most_doubtful_come_first(desk):
    rows = desk.buildings()["rows"]
    assert [row["doubt"] for row in rows] == sorted((row["doubt"] for row in rows), reverse=True)
    # the only one that is flat indeed
    assert rows[-1]["id"] == "house-3" and rows[-1]["reasons"] == ()
    assert desk.buildings("house-2")["found"] == 1


@pytest.mark.parametrize(
    ("remark", "reason"),
    [
        ({"quality": "poor"}, "poor"),
        ({"status": "flat_fallback"}, "flat block"),
        (
            {"detail": "modelled; over 60 % of its area points lie on two surfaces, 0.4 m apart"},
            "two surfaces",
        ),
        (
            {
                "status": "no_points",
                "detail": "no points of class 6, but points of other classes lie high above the "
                "ground",
            },
            "points of other classes",
        ),
        ({"types": {"hip": 0.5, "gable": 0.45}}, "hip or gable"),
        ({"change": {"class": "uncertain"}}, "uncertain change"),
        (
            {"parts": [{"sigma": {"t_z": 0.5}}, {"sigma": {"rotation": 5.0}}]},
            "1 of 2 parts on few points",
        ),
        (
            {"unexplained_area_m2": 12.0, "outline": [[[0, 0], [10, 0], [10, 8], [0, 8]]]},
            "12 m² of points off the roof",
        ),
    ],
)
def test_whatever_speaks_against_a_model_adds_to_its_doubt(remark, reason):
    plain = {"status": "modelled", "parts": [], "residuals": {"share_within_20cm": 0.95}}
    result = measure_doubt(plain | remark)
    assert result.amount > measure_doubt(plain).amount and result.reasons == (reason,)


def raise_gable(desk):
    change = {"type": "gable", "ridge_height": 12.0}
    return edit(desk, desk.building(ID)["parts"], action="change", part=0, change=change)


def test_every_edit_gives_a_valid_model(desk):
    gable = raise_gable(desk)
    halves = edit(desk, gable["parts"], action="split", part=0)
    assert len(halves["parts"]) == 2
    assert halves["figures"]["volume_m3"] == pytest.approx(gable["figures"]["volume_m3"], abs=0.2)
    merged = edit(desk, halves["parts"], action="merge", part=0, other=1)
    assert len(merged["parts"]) == 1
    assert merged["figures"]["volume_m3"] == pytest.approx(gable["figures"]["volume_m3"], abs=0.2)
    assert merged["parts"][0]["parameters"]["length"] == pytest.approx(
        gable["parts"][0]["parameters"]["length"], abs=1e-3
    )
    dormer = edit(desk, merged["parts"], action="dormer", part=0)
    assert len(dormer["parts"]) == 2
    assert dormer["figures"]["volume_m3"] > merged["figures"]["volume_m3"] + 0.1
    without_dormer = edit(desk, dormer["parts"], action="remove", part=1)
    assert without_dormer["mesh"] == merged["mesh"]


def test_what_is_held_is_not_refitted(desk):
    raised = raise_gable(desk)
    fixed = edit(desk, raised["parts"], action="refit", held={"0": ["height", "z"]})
    assert fixed["figures"]["ridge_height"] == pytest.approx(12.0, abs=0.01)
    assert edit(desk, raised["parts"], action="refit")["figures"]["ridge_height"] == pytest.approx(
        10.1, abs=0.1
    )


def test_types_are_tried_and_the_right_one_wins(desk):
    start = desk.building(ID)
    candidates = desk.alternatives(ID, {"parts": start["parts"], "part": 0})["types"]
    share = {row["type"]: row["share"] for row in candidates}
    assert share["gable"] > 0.95 > share["flat"] and candidates[0]["share"] >= share["gable"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({}, "expected an edit"),
        ({"action": "explode"}, "got 'explode'"),
        ({"action": "change", "part": 7, "change": {}}, "part from 0 to 0, got 7"),
        ({"action": "change", "part": "0", "change": {}}, "got '0'"),
        ({"action": "change", "part": 0, "change": {"type": "igloo"}}, "got 'igloo'"),
        ({"action": "change", "part": 0, "change": {"width": -3.0}}, "positive width"),
        ({"action": "change", "part": 0, "change": {"width": float("nan")}}, "got nan"),
        ({"action": "remove", "part": 0}, "two or more parts"),
        ({"action": "merge", "part": 0, "other": 0}, "got one twice"),
        ({"action": "split", "part": 0, "share": 2.0}, "between 0 and 1"),
        ({"action": "split", "part": 0, "side": "height"}, "length or width"),
        ({"action": "refit", "held": {"0": ["colour"]}}, "got colour"),
        ({"action": "refit", "held": {"first": []}}, "names by part"),
    ],
)
def test_an_edit_that_cannot_be_is_one_sentence(desk, change, message):
    with pytest.raises(HiproofError, match=message) as caught:
        desk.change(ID, {"parts": desk.building(ID)["parts"], "asked": change})
    assert "\n" not in str(caught.value)


def test_two_windows_lose_nothing(folder):
    first_desk, other = Desk(folder, "anna"), Desk(folder, "ben")
    buildings = first_desk.building(ID), other.building(ID)
    flat = buildings[0]["parts"]
    gable = edit(other, buildings[1]["parts"], action="change", part=0, change={"type": "gable"})
    accepted = first_desk.accept(ID, {"parts": flat, "version": buildings[0]["version"]})
    with pytest.raises(OtherVersion, match="anna accepted") as caught:
        other.accept(ID, {"parts": gable["parts"], "version": buildings[1]["version"]})
    assert caught.value.version == accepted["version"]
    assert other.building(ID)["accepted"]["who"] == "anna"
    other.accept("house-1", {"parts": other.building("house-1")["parts"], "version": UNTOUCHED})
    other.accept(ID, {"parts": gable["parts"], "version": caught.value.version})
    stored = dict(read_overrides(str(folder / EDITS_FILE)))
    assert {id: record["who"] for id, record in stored.items()} == {ID: "ben", "house-1": "ben"}
    assert stored[ID]["parts"][0]["type"] == "gable"


def test_no_process_writes_over_another(folder):
    """Two processes accept on one folder at once, each other buildings."""
    with ProcessPoolExecutor(2, get_context("forkserver")) as pool:
        accepted = list(pool.map(accept_overrides, [folder] * 2, range(2)))
    stored = {id: record["ridge_height"] for id, record in read_overrides(str(folder / EDITS_FILE))}
    assert stored == {id: height for heights in accepted for id, height in heights.items()}


def accept_overrides(folder, number):
    """Keep overrides of ten buildings of this process's own; their heights."""
    edits, heights = Edits(folder), {}
    for k in range(10):
        id, height = f"{number}-{k}", 1.0 + k
        edits.put(id, {"id": id, "ridge_height": height}, UNTOUCHED)
        heights[id] = height
    return heights


def test_an_accepted_edit_can_be_taken_back(folder, desk):
    start = desk.building(ID)
    accepted = desk.accept(ID, {"parts": start["parts"], "version": start["version"]})
    assert desk.buildings()["accepted"] == 1
    assert desk.withdraw(ID, {"version": accepted["version"]}) == {"version": UNTOUCHED}
    assert desk.building(ID)["accepted"] is None and (folder / EDITS_FILE).read_text() == ""


def test_what_makes_no_solid_is_not_accepted(folder, desk):
    parts = desk.building(ID)["parts"]
    wrong = [{**parts[0], "parameters": {"width": -1.0}}]
    with pytest.raises(InputError, match="positive width"):
        desk.accept(ID, {"parts": wrong, "version": UNTOUCHED})
    assert not (folder / EDITS_FILE).exists()


def test_the_file_starts_with_the_overrides_that_the_run_obeyed(town_files, folder, tmp_path):
    overrides = tmp_path / "known.jsonl"
    overrides.write_text(json.dumps({"id": "house-1", "ridge_height": 9.5}) + "\n")
    hiproof.reconstruct_area(make_request(town_files, folder, overrides))
    desk = Desk(folder, "anna")
    desk.accept(ID, {"parts": desk.building(ID)["parts"], "version": UNTOUCHED})
    stored = dict(read_overrides(str(folder / EDITS_FILE)))
    assert stored["house-1"] == {"id": "house-1", "ridge_height": 9.5}
    assert stored[ID]["who"] == "anna"


def test_points_are_those_of_the_run(desk):
    cloud = desk.cloud(ID)
    assert cloud["missing"] == "" and cloud["count"] == int(desk.run.record(ID)["points"])


def test_without_its_points_all_but_refitting_works(town_files, tmp_path):
    cloud = shutil.copy(town_files[0], tmp_path / "cloud.laz")
    hiproof.reconstruct_area(make_request([str(cloud), town_files[1]], tmp_path / "run"))
    (tmp_path / "cloud.laz").unlink()
    desk = Desk(tmp_path / "run", "anna")
    assert "points are gone" in desk.cloud(ID)["missing"] and desk.cloud(ID)["count"] == 0
    start = desk.building(ID)
    gable = edit(desk, start["parts"], action="change", part=0, change={"type": "gable"})
    assert gable["type"] == "gable" and gable["figures"]["share_within_20cm"] is None
    with pytest.raises(HiproofError, match="3 points or more"):
        edit(desk, gable["parts"], action="refit")
    desk.accept(ID, {"parts": gable["parts"], "version": start["version"]})
    assert (tmp_path / "run" / EDITS_FILE).exists()


@pytest.fixture
def run_by_relative_names(town_files, tmp_path, monkeypatch):
    """A project folder in which a run was made by names that hold only there; the present folder is
    another afterwards.
    """
    project = tmp_path / "project"
    project.mkdir()
    cloud, footprints = (Path(shutil.copy(file, project)).name for file in town_files)
    (project / "known.jsonl").write_text(json.dumps({"id": "house-1", "ridge_height": 9.5}) + "\n")
    monkeypatch.chdir(project)
    hiproof.reconstruct_area(make_request([cloud, footprints], Path("run"), "known.jsonl"))
    monkeypatch.chdir(tmp_path)
    return project


def test_a_run_made_by_relative_names_is_known_from_anywhere(run_by_relative_names):
    desk = Desk(run_by_relative_names / "run", "anna")
    assert desk.cloud(ID)["missing"] == ""
    assert desk.cloud(ID)["count"] == int(desk.run.record(ID)["points"])
    assert desk.edits.of("house-1")[0] == {"id": "house-1", "ridge_height": 9.5}
    run = evaluate_run(run_by_relative_names / "run")
    assert len(run.clouds) == 1 and sum(map(len, run.points)) and None not in run.footprints


def test_the_same_run_from_elsewhere_redoes_nothing(town_files, run_by_relative_names):
    inode = (run_by_relative_names / "run/buildings.gml").stat().st_ino
    paths = [str(run_by_relative_names / Path(file).name) for file in town_files]
    overrides = run_by_relative_names / "known.jsonl"
    hiproof.reconstruct_area(make_request(paths, run_by_relative_names / "run", overrides))
    assert (run_by_relative_names / "run/buildings.gml").stat().st_ino == inode


def test_a_run_goes_on_where_its_files_were_moved(town_files, run_by_relative_names, tmp_path):
    project = run_by_relative_names.rename(tmp_path / "archive")
    inode = (project / "run/buildings.gml").stat().st_ino
    paths = [str(project / Path(file).name) for file in town_files]
    hiproof.reconstruct_area(make_request(paths, project / "run", project / "known.jsonl"))
    assert (project / "run/buildings.gml").stat().st_ino == inode
    assert Desk(project / "run", "anna").cloud(ID)["count"]


def test_files_that_moved_are_found_in_the_folder_that_a_person_names(
    run_by_relative_names, tmp_path
):
    run = (run_by_relative_names / "run").rename(tmp_path / "run")
    files = run_by_relative_names.rename(tmp_path / "archive")
    with pytest.warns(InputWarning, match=r"overrides .* gone \(known\.jsonl\).*--clouds FOLDER"):
        assert "--clouds FOLDER" in Desk(run, "anna").cloud(ID)["missing"]
    with pytest.warns(InputWarning, match="points are gone"):
        assert evaluate_run(run).clouds == ()
    desk = Desk(run, "anna", files)
    assert desk.cloud(ID)["count"] == int(desk.run.record(ID)["points"])
    assert desk.edits.of("house-1")[0]


def test_points_that_can_no_longer_be_read_are_said_once(town_files, tmp_path):
    cloud = shutil.copy(town_files[0], tmp_path / "cloud.laz")
    hiproof.reconstruct_area(make_request([str(cloud), town_files[1]], tmp_path / "run"))
    (tmp_path / "cloud.laz").write_bytes(b"no cloud")
    desk = Desk(tmp_path / "run", "anna")
    assert "cannot be read" in desk.cloud(ID)["missing"]
    assert (
        edit(desk, desk.building(ID)["parts"], action="change", part=0, change={"type": "hip"})[
            "type"
        ]
        == "hip"
    )


def test_what_a_folder_must_hold(tmp_path, folder):
    with pytest.raises(InputError, match=r"without parameters\.jsonl"):
        Desk(tmp_path, "anna")
    (folder / EDITS_FILE).symlink_to(tmp_path / "elsewhere.jsonl")
    with pytest.raises(InputError, match="got a link"):
        Edits(folder)


def test_buildings_that_are_not_there_are_a_sentence(desk):
    for ask in (desk.building, desk.cloud, lambda id: desk.withdraw(id, {"version": UNTOUCHED})):
        with pytest.raises(InputError, match="expected a building of the run"):
            ask("../../etc/passwd")


def test_gaps_are_heights_of_the_points_drawn_over_the_roof(desk):
    start, cloud = desk.building(ID), desk.cloud(ID)
    displayed = edit(desk, start["parts"], action="show")
    places = np.frombuffer(decode_bytes(cloud["places"]), "<f4").reshape(-1, 3)
    gaps = np.frombuffer(decode_bytes(displayed["gaps"]), "<f4")
    level = start["parts"][0]["position"][2]
    inside = gaps != 9.0  # a point on the outline itself may have no roof under it
    assert len(gaps) == len(places) and inside.mean() > 0.98
    assert gaps[inside] == pytest.approx(places[inside, 2] - level, abs=1e-4)


def decode_bytes(text):
    return base64.b64decode(text)


def change_outcomes(folder, **outcomes):
    """Give buildings of a finished run other outcomes, and every other building a good model."""
    path = folder / "parameters.jsonl"
    head, *rows = map(json.loads, path.read_text().splitlines())
    for row in rows:
        row |= {"quality": "good", "detail": "modelled", "residuals": {"share_within_20cm": 0.99}}
        row |= outcomes.get(row["id"].replace("-", "_"), {})
    path.write_text("".join(json.dumps(row) + "\n" for row in [head, *rows]))


def test_the_list_holds_only_the_kinds_and_ids_that_are_named(folder, caplog):
    empty = {"status": "no_points", "quality": None, "parts": []}
    change_outcomes(folder, house_1={"quality": "poor"}, house_2=empty)

    def list_ids(*only):
        return sorted(row["id"] for row in Desk(folder, "anna", only=only).buildings()["rows"])

    assert list_ids("doubtful") == ["house-1"] and list_ids("no_points") == ["house-2"]
    assert list_ids("doubtful", "house-0") == ["house-0", "house-1"]
    assert len(list_ids()) == 4
    assert list_ids("changed") == [] and "no building of the run" in caplog.text
    with pytest.raises(InputError, match="doubtful, no_points, changed or ids"):
        list_ids("house-99")


def test_an_uncertain_change_comes_before_the_worst_model():
    worst = {"status": "flat_fallback", "quality": "poor", "residuals": {"share_within_20cm": 0.0}}
    uncertain = {"status": "modelled", "change": {"class": "uncertain"}}
    assert measure_doubt(uncertain).amount > measure_doubt(worst).amount
