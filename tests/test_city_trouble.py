"""What a city run does when workers die, memory or disk ends, or a building is too much: the others
come out the same.
"""

import errno
import json
import shutil
import sqlite3
from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest
import shapely

import planted
from hiproof.city import run as city_run
from hiproof.city.folder.ledger import Ledger
from hiproof.city.run import Request, reconstruct_area
from hiproof.city.work import queue
from hiproof.city.work.bundle_folders import bundles_in
from hiproof.city.work.sort import Gatherer
from hiproof.errors import InputError, InputWarning, OutputError
from hiproof.geometry.thin import thin_to_count, without_repeats
from hiproof.settings import Settings
from hiproof.write import files as output_files
from read.test_lax import write_lax
from read.test_pointcloud import write_copc
from run_records import by_id, records
from tiny_town import make_town, write_cloud, write_footprints, write_town


@pytest.fixture(autouse=True)
def small_tiles(monkeypatch):
    monkeypatch.setattr("hiproof.city.plan.prepare.MOST_BUILDINGS_A_TILE", 2)


def test_a_worker_killed_from_outside_changes_no_byte(
    town_files, reference_run, tmp_path, monkeypatch
):
    monkeypatch.setattr(city_run, "solve_tile", planted.solve_killed_once)
    reconstruct_area(Request((town_files[0],), tmp_path, town_files[1], processes=2))
    assert (tmp_path / ".hiproof" / "killed").exists()
    assert records(tmp_path) == records(reference_run)


@pytest.mark.parametrize(
    "solve", [planted.solve_deadly, planted.solve_hungry], ids=["kills", "eats memory"]
)
def test_a_building_that_ends_its_process_is_left_out_alone(
    solve, town_files, reference_run, tmp_path, monkeypatch
):
    monkeypatch.setattr(city_run, "solve_tile", solve)
    monkeypatch.setattr("hiproof.city.work.queue.MOST_LOSSES", 1)
    monkeypatch.setattr("hiproof.city.work.queue.TRIES", 1)
    summary = reconstruct_area(Request((town_files[0],), tmp_path, town_files[1], processes=2))
    assert summary.exit_code == 1
    assert [id for id, _ in summary.failures] == [planted.DEADLY]
    rows = by_id(tmp_path)
    assert "process died" in rows.pop(planted.DEADLY)["detail"]
    assert [bundle.name for bundle in bundles_in(tmp_path)] == [planted.DEADLY]
    assert rows == {id: row for id, row in by_id(reference_run).items() if id != planted.DEADLY}


def stop_in_second_tile(request):
    """End a run of two tiles of two buildings at the third building."""

    def stop(step, finished, total):
        if step == "solve" and finished == 3:
            raise SystemExit

    with pytest.raises(SystemExit):
        reconstruct_area(request, stop)


def test_losses_with_the_main_process_lead_to_quarantine(
    town_files, reference_run, tmp_path, monkeypatch, quick_tiles
):
    request = Request((town_files[0],), tmp_path, town_files[1])

    stop_in_second_tile(request)
    database = sqlite3.connect(tmp_path / ".hiproof" / "ledger.sqlite")
    database.execute("update task set losses = 3 where kind = 'solve' and state = 'open'")
    database.commit()
    quarantined = []
    original = queue.solve_in_quarantine
    monkeypatch.setattr(
        queue, "solve_in_quarantine", lambda *a: quarantined.append(a[-1]) or original(*a)
    )
    reconstruct_area(request)
    assert len(quarantined) == 1
    assert records(tmp_path) == records(reference_run)


def test_points_that_somebody_removed_are_sorted_again(
    town_files, reference_run, tmp_path, quick_tiles
):
    request = Request((town_files[0],), tmp_path, town_files[1])

    stop_in_second_tile(request)
    shutil.rmtree(tmp_path / ".hiproof" / "points")
    reconstruct_area(request)
    assert records(tmp_path) == records(reference_run)


def test_a_damaged_list_of_what_to_redo_harms_no_run(town_files, tmp_path, quick_tiles):
    request = Request((town_files[0],), tmp_path, town_files[1], processes=None)
    reconstruct_area(request)
    (tmp_path / ".hiproof" / "redo.json").write_text("{")
    assert reconstruct_area(request).buildings == 4


def test_a_full_disk_ends_in_one_sentence_and_the_run_goes_on_later(
    town_files, reference_run, tmp_path, monkeypatch, quick_tiles
):
    request = Request((town_files[0],), tmp_path, town_files[1])
    original, written = output_files.OutputFile.write, []

    def full(self, data):
        written.append(len(data))
        if len(written) > 8:
            raise output_files.output_error(
                self.path, OSError(errno.ENOSPC, "No space left on device")
            )
        return original(self, data)

    monkeypatch.setattr(output_files.OutputFile, "write", full)
    with pytest.raises(OutputError, match="disk is full"):
        reconstruct_area(request)
    monkeypatch.setattr(output_files.OutputFile, "write", original)
    reconstruct_area(request)
    assert records(tmp_path) == records(reference_run)


def test_unfinished_files_of_a_killed_worker_are_not_read(
    town_files, reference_run, tmp_path, quick_tiles
):

    def litter(step, finished, total):
        if step == "solve" and finished == 0:
            for folder in (tmp_path / ".hiproof" / "points").iterdir():
                (folder / ".0-0.npz-1-abcd.npz").write_bytes(b"cut off")
            (tmp_path / ".buildings.gml-1-abcd.gml").write_bytes(b"cut off")

    reconstruct_area(Request((town_files[0],), tmp_path, town_files[1]), litter)
    assert records(tmp_path) == records(reference_run)
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".buildings")]


def spoil_ledger(path):
    path.write_bytes(b"not a database, but long enough to look like one" * 9)


def make_older_ledger(path):
    with closing(sqlite3.connect(path)) as database:
        database.execute("create table building (position integer primary key, psd real)")


@pytest.mark.parametrize("make", [spoil_ledger, make_older_ledger])
def test_a_ledger_that_is_none_of_this_version_is_refused_and_replaced_on_restart(
    town_files, tmp_path, quick_tiles, make
):
    (tmp_path / ".hiproof").mkdir()
    make(tmp_path / ".hiproof" / "ledger.sqlite")
    with pytest.raises(OutputError, match="--restart"):
        reconstruct_area(Request((town_files[0],), tmp_path, town_files[1]))
    assert (
        reconstruct_area(Request((town_files[0],), tmp_path, town_files[1], restart=True)).buildings
        == 4
    )


def test_a_full_disk_is_no_fault_of_the_ledger(town_files, tmp_path, monkeypatch):
    (tmp_path / ".hiproof").mkdir()
    (tmp_path / ".hiproof" / "ledger.sqlite").write_bytes(b"cut off where the disk was full" * 9)
    monkeypatch.setattr(
        "hiproof.city.folder.resume.shutil.disk_usage", lambda _: SimpleNamespace(free=4096)
    )
    for restart in (False, True):
        with pytest.raises(OutputError, match="free some space, the same command then goes on"):
            reconstruct_area(Request((town_files[0],), tmp_path, town_files[1], restart=restart))


def test_files_without_points_are_said_and_harm_none(
    town_files, reference_run, tmp_path, quick_tiles
):
    empty = str(write_cloud(tmp_path / "empty.laz", np.zeros((0, 3)), np.zeros(0, np.uint8)))
    with pytest.raises(InputError, match=r"expected points in .*empty\.laz, got none"):
        reconstruct_area(Request((empty,), tmp_path / "none", town_files[1]))
    with pytest.warns(InputWarning, match=r"empty\.laz: holds no points"):
        reconstruct_area(Request((empty, town_files[0]), tmp_path / "out", town_files[1]))
    assert by_id(tmp_path / "out") == by_id(reference_run)


def test_overlapping_tiles_and_small_buffers_change_no_byte(
    reference_run, tmp_path, monkeypatch, quick_tiles
):
    chunks, flush = [], Gatherer.flush
    monkeypatch.setattr(Gatherer, "flush", lambda self: (chunks.append(self.number), flush(self)))
    monkeypatch.setattr("hiproof.city.work.sort.HELD_POINTS", 1000)
    monkeypatch.setattr("hiproof.read.points.pointcloud.CHUNK_POINTS", 3000)
    town, rng = make_town(), np.random.default_rng(5)
    middle = np.median(town.xyz[:, 0])
    clouds = []
    for name, is_in_tile in (
        ("b", town.xyz[:, 0] < middle + 15),
        ("a", town.xyz[:, 0] > middle - 15),
    ):
        members = rng.permutation(np.flatnonzero(is_in_tile))
        xyz, classes = town.xyz[members], town.classification[members]
        clouds.append(str(write_cloud(tmp_path / f"{name}.laz", xyz, classes)))
    footprints = write_footprints(tmp_path / "footprints.geojson", town.footprints)
    reconstruct_area(Request(tuple(clouds), tmp_path / "out", str(footprints)))
    assert min(chunks.count(number) for number in (0, 1)) > 1
    assert records(tmp_path / "out") == records(reference_run)


def test_points_in_several_files_count_once_where_a_footprint_is_moved(tmp_path):
    town = make_town(houses=1)
    neighbours = {
        id: shapely.transform(area, lambda xy: xy + [0.6, -0.5])
        for id, area in town.footprints.items()
    }
    footprints = write_footprints(tmp_path / "footprints.geojson", neighbours)
    east = town.xyz[:, 0] > np.median(town.xyz[:, 0])
    whole = str(write_cloud(tmp_path / "whole.laz", town.xyz, town.classification))
    part = str(write_cloud(tmp_path / "part.laz", town.xyz[east], town.classification[east]))
    for name, clouds in (
        ("one", (whole,)),
        ("three", (whole, part, shutil.copy(part, tmp_path / "again.laz"))),
    ):
        reconstruct_area(Request(tuple(map(str, clouds)), tmp_path / name, str(footprints)))
    assert any(by_id(tmp_path / "one")["house-0"]["shift"])
    assert records(tmp_path / "three") == records(tmp_path / "one")


def test_a_building_with_too_many_points_is_thinned_and_says_so(town_files, tmp_path):
    settings = Settings.from_dict(
        {"city": {"max_points_a_building": 1000}, "fit": {"parts": "one", "types": ["flat"]}}
    )
    town = make_town(houses=1, density=20.0)
    cloud, footprints = write_town(tmp_path, town)
    reconstruct_area(Request((str(cloud),), tmp_path / "out", str(footprints), settings=settings))
    row = by_id(tmp_path / "out")["house-0"]
    assert row["points"] == 1000
    assert row["density"] == pytest.approx(20.0, rel=0.2)  # the cloud's, not that of what is left
    if row["status"] == "modelled":
        assert "fitted to 1000 of its" in row["detail"]


def test_thinning_depends_on_the_set_of_points_alone():
    rng = np.random.default_rng(6)
    points = rng.uniform(0, 50, (5000, 3))
    thinned = thin_to_count(points, 700)
    shuffled = thin_to_count(
        without_repeats(np.concatenate([points, points[:900]])[rng.permutation(5900)]), 700
    )
    assert {tuple(p) for p in thinned} == {tuple(p) for p in shuffled}
    assert len(thinned) == 700
    # evenly: each quarter of the area keeps about a quarter
    quarters = np.bincount((thinned[:, 0] > 25) * 2 + (thinned[:, 1] > 25))
    assert (abs(quarters - 175) < 60).all()


def test_the_ledger_tells_losses_from_orderly_ends(tmp_path):
    ledger = Ledger(tmp_path / "ledger.sqlite")
    ledger.settle([(0, "a", b"0"), (1, "a", b"1"), (2, "b", b"2")], [])
    ledger.put_tasks(0, {"a": 2, "b": 1})
    ledger.start("solve:a")
    assert ledger.open_tasks("solve") == ["solve:b"]
    ledger.interrupt()
    assert ledger.losses("solve:a") == 0
    ledger.start("solve:a")
    ledger.reopen()
    assert ledger.losses("solve:a") == 1
    assert ledger.open_tasks("solve") == ["solve:a", "solve:b"]


def test_an_indexed_file_is_asked_box_by_box_for_the_same_points(
    reference_run, tmp_path, monkeypatch, quick_tiles
):
    monkeypatch.setattr("hiproof.city.work.sort.QUERY_M", 25.0)
    town = make_town()
    cloud = write_copc(tmp_path / "cloud.copc.laz", town.xyz, town.classification)
    footprints = write_footprints(tmp_path / "footprints.geojson", town.footprints)
    reconstruct_area(Request((str(cloud),), tmp_path / "out", str(footprints)))
    assert by_id(tmp_path / "out") == by_id(reference_run)


def test_an_index_beside_the_file_saves_points_and_changes_no_byte(
    reference_run, tmp_path, monkeypatch, quick_tiles
):
    monkeypatch.setattr("hiproof.read.points.runs.RUN_POINTS", 50)
    town = make_town()
    along = np.argsort(town.xyz[:, 0].round(-1), kind="stable")
    cloud = write_cloud(tmp_path / "cloud.laz", town.xyz[along], town.classification[along])
    write_lax(tmp_path / "cloud.lax", town.xyz[along])
    footprints = write_footprints(tmp_path / "footprints.geojson", town.footprints)
    reconstruct_area(Request((str(cloud),), tmp_path / "out", str(footprints)))
    assert records(tmp_path / "out") == records(reference_run)
    single_footprint = write_footprints(
        tmp_path / "alone.geojson", dict(list(town.footprints.items())[:1])
    )
    reconstruct_area(Request((str(cloud),), tmp_path / "alone", str(single_footprint)))
    assert by_id(tmp_path / "alone")["house-0"] == by_id(reference_run)["house-0"]
    tasks = Ledger(tmp_path / "alone" / ".hiproof" / "ledger.sqlite").tasks()
    (sort,) = [task for task in tasks if task.kind == "sort"]
    assert json.loads(sort.message)["points"] < 0.6 * len(town.xyz)


def test_models_by_work_tile_are_the_merged_ones_cut(
    town_files, reference_run, tmp_path, quick_tiles
):
    by_tile, out = Settings.from_dict({"city": {"models": "tiles"}}), tmp_path / "out"
    reconstruct_area(Request((town_files[0],), out, town_files[1], settings=by_tile))
    files = sorted(path.name for path in (out / "models").iterdir())
    assert len(files) == 4 and not any(name.startswith(".") for name in files)
    assert not (out / "buildings.gml").exists() and not (out / "buildings.city.jsonl").exists()
    assert by_id(out) == by_id(reference_run)
    for ending, merged in ((".gml", "buildings.gml"), (".city.jsonl", "buildings.city.jsonl")):
        cut = [
            line
            for name in files
            if name.endswith(ending)
            for line in (out / "models" / name).read_text().splitlines()
        ]
        buildings = [
            line for line in (reference_run / merged).read_text().splitlines() if "house-" in line
        ]
        assert sorted(line for line in cut if "house-" in line) == sorted(buildings)


def test_a_new_run_removes_the_models_of_old_work_tiles_and_nothing_else(
    town_files, tmp_path, quick_tiles
):
    settings = Settings.from_dict({"city": {"models": "both"}})
    reconstruct_area(Request((town_files[0],), tmp_path, town_files[1], settings=settings))
    assert (tmp_path / "buildings.gml").exists() and len(list((tmp_path / "models").iterdir())) == 4
    (tmp_path / "models" / "mine.gml").touch()
    reconstruct_area(Request((town_files[0],), tmp_path, town_files[1], restart=True))
    assert [path.name for path in (tmp_path / "models").iterdir()] == ["mine.gml"]
