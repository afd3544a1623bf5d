"""A failure inside one building is that building's alone, whatever stage it happens in."""

import numpy as np
import pytest
import shapely
from click.testing import CliRunner

from hiproof import method
from hiproof.city.run import Request, reconstruct_area
from hiproof.city.work import solve
from hiproof.city.work.bundle_folders import folder_name
from hiproof.classify import buildings, split
from hiproof.cli.app import app
from hiproof.model import Footprint
from hiproof.status import Status
from hiproof.write import parameters, run_files
from hiproof.write.citygml import version2
from hiproof.write.cityjson import features
from run_records import by_id
from tiny_town import make_town, write_cloud, write_town

HOUSES = 20
STAGES = (
    (solve.Surroundings, "select_roof_points"),
    (solve.Surroundings, "choose_terrain"),
    (solve.Surroundings, "remark_terrain"),
    (solve.Surroundings, "inspect"),
    (solve, "without_repeats"),
    (solve, "thin_to_count"),
    (solve, "reconstruct"),
    (method, "align_footprint"),
    (method, "usable"),
    (method, "recognise"),
    (method, "fit"),
    (method, "find_ground"),
    (method, "solid_or_simpler"),
    (method, "judge"),
)
WRITERS = (
    (run_files, "measure_or_drop_solid"),
    (run_files, "describe"),
    *((module.writer, "fragment") for module in (parameters, features, version2)),
)


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    """Paths of the cloud and the footprints of twenty houses."""
    return [
        str(path)
        for path in write_town(tmp_path_factory.mktemp("town"), make_town(HOUSES, density=3.0))
    ]


@pytest.fixture(scope="module")
def small_town(tmp_path_factory):
    """The path of the cloud of four houses."""
    return [
        str(path)
        for path in write_town(tmp_path_factory.mktemp("small"), make_town(4, density=2.0))
    ]


def run(town, out, with_footprints):
    return reconstruct_area(
        Request((town[0],), out, town[1] if with_footprints else None, restart=True)
    )


def fail_in(stage, victim, patch):
    """Let `stage` raise for the building `victim`; a writer raises unless its record is bare."""
    owner, name = stage
    original = getattr(owner, name)

    def raising(*args, **keywords):
        written = getattr(args[0], "building", args[0]) if stage in WRITERS else None
        if current == [victim] and (
            written is None or written.footprint is not None or written.built is not None
        ):
            raise KeyError((False, 0, 0))
        return original(*args, **keywords)

    current = []
    solve_one = solve.solve_one

    def following(plan, job, *rest):
        current[:] = [job.id]
        return solve_one(plan, job, *rest)

    patch.setattr(solve, "solve_one", following)
    patch.setattr(owner, name, raising)


@pytest.mark.parametrize("with_footprints", [True, False])
def test_a_failure_in_any_stage_is_one_buildings_and_changes_no_other(
    town, with_footprints, tmp_path
):
    run(town, tmp_path / "undisturbed", with_footprints)
    expected = by_id(tmp_path / "undisturbed")
    assert len(expected) == HOUSES
    failing = [*STAGES, *WRITERS]
    victims = np.random.default_rng(7).permutation(list(expected))[: len(failing)].tolist()
    with pytest.MonkeyPatch.context() as patch:
        for stage, victim in zip(failing, victims, strict=True):
            fail_in(stage, victim, patch)
        summary = run(town, tmp_path / "disturbed", with_footprints)
    rows = by_id(tmp_path / "disturbed")
    assert summary.exit_code == 1
    assert summary.by_status["internal_error"] == len(victims)
    assert list(rows) == list(expected)
    assert {id: row for id, row in rows.items() if id not in victims} == {
        id: row for id, row in expected.items() if id not in victims
    }
    for victim in victims:
        assert rows[victim]["status"] == "internal_error"
        assert rows[victim]["detail"].startswith("KeyError: (False, 0, 0)")


def test_a_failed_building_keeps_the_largest_polygon_of_its_area():
    """Without footprints the area of a building may have several polygons, and files hold one."""
    small, large = shapely.box(0, 0, 1, 1), shapely.box(5, 0, 9, 4)
    job = solve.Job(0, "a", shapely.MultiPolygon([small, large]), None)
    plan = solve.WorkPlan((job,), {"0_0_0": (0,)}, None, solve.Settings(), {}, np.zeros(3))
    building, texts = solve.record_failure(plan, job, "KeyError: (False, 0, 0)")
    assert building.status is Status.INTERNAL_ERROR
    assert building.footprint.equals(large)
    assert b"[9.0,4.0]" in texts["parameters"].text.replace(b" ", b"")


def test_an_outline_that_cannot_be_written_leaves_the_id_and_the_message(monkeypatch):
    def refuse(outline):
        if outline is not None:
            raise AttributeError("no attribute 'exterior'")

    for kind in ("polygon", "polygon?"):
        monkeypatch.setitem(parameters.WRITERS, kind, refuse)
    job = solve.Job(
        0, "a", shapely.box(0, 0, 4, 4), Footprint("a", shapely.box(0, 0, 4, 4), {"year": 1950})
    )
    plan = solve.WorkPlan((job,), {"0_0_0": (0,)}, None, solve.Settings(), {}, np.zeros(3))
    building, texts = solve.record_failure(plan, job, "ValueError: first")
    assert (building.id, building.detail, building.footprint) == ("a", "ValueError: first", None)
    assert b"ValueError: first" in texts["parameters"].text


def fail_at(monkeypatch, owner, name, xy):
    """Let a function of points (n, 3) raise where their box holds the place `xy`."""
    original = getattr(owner, name)

    def raising(xyz, *rest):
        lower, upper = xyz[:, :2].min(axis=0), xyz[:, :2].max(axis=0)
        if (lower <= xy).all() and (xy <= upper).all():
            raise ZeroDivisionError("division by zero")
        return original(xyz, *rest)

    monkeypatch.setattr(owner, name, raising)


def repeat_failure(out, id):
    """Run `hiproof repro` for the building `id`; return its exit code and output."""
    result = CliRunner().invoke(
        app, ["repro", str(out / "failures" / folder_name(id)), "--out", str(out / "again")]
    )
    return result.exit_code, result.output


@pytest.mark.parametrize("stage", ["separate_houses", "cell_area"])
def test_a_block_that_cannot_be_split_is_one_failure_and_changes_no_other(
    small_town, stage, tmp_path, monkeypatch
):
    run(small_town, tmp_path / "undisturbed", with_footprints=False)
    expected = by_id(tmp_path / "undisturbed")
    victim = list(expected)[2]
    with monkeypatch.context() as patch:
        fail_at(patch, split, stage, np.array(victim.split("_")[1:], float) + 0.5)
        summary = run(small_town, tmp_path / "disturbed", with_footprints=False)
        code, output = repeat_failure(tmp_path / "disturbed", victim)
    rows = by_id(tmp_path / "disturbed")
    assert summary.exit_code == 1
    assert list(rows) == list(expected)
    assert {id for id in rows if rows[id] != expected[id]} == {victim}
    assert rows[victim]["status"] == "internal_error"
    assert rows[victim]["detail"].startswith(
        "ZeroDivisionError: division by zero (test_city_failures.py:"
    )
    trace = (tmp_path / "disturbed/failures" / folder_name(victim) / "traceback.txt").read_text()
    assert "in find_houses" in trace
    assert code == 1
    assert "ZeroDivisionError" in output
    code, output = repeat_failure(tmp_path / "disturbed", victim)
    assert code == 0
    assert by_id(tmp_path / "disturbed/again")[victim]["status"] == "modelled"


def test_a_square_in_which_no_roofs_can_be_found_is_one_failure(tmp_path, monkeypatch):
    """The roofs of a cloud without classes are found in squares of 250 m."""
    scene = make_town(13, density=3.0)
    cloud = str(write_cloud(tmp_path / "cloud.laz", scene.xyz, np.ones(len(scene.xyz), np.uint8)))
    run([cloud], tmp_path / "undisturbed", with_footprints=False)
    expected = by_id(tmp_path / "undisturbed")
    x = {id: float(id.split("_")[1]) for id in expected}
    border = 250.0 * np.ceil(min(x.values()) / 250.0)
    fail_at(
        monkeypatch, buildings, "classify_points", np.array([border + 60.0, scene.xyz[:, 1].mean()])
    )
    summary = run([cloud], tmp_path / "disturbed", with_footprints=False)
    rows = by_id(tmp_path / "disturbed")
    failed = {id for id, row in rows.items() if row["status"] == "internal_error"}
    assert summary.exit_code == 1
    assert len(failed) == 1
    other_ids = rows.keys() - failed
    assert other_ids >= {id for id in expected if x[id] < border - 10.0}
    assert all(float(id.split("_")[1]) < border for id in other_ids)
    assert repeat_failure(tmp_path / "disturbed", failed.pop())[0] == 1
