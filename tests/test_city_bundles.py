"""What a run keeps of buildings that hiproof failed on: enough to repeat the failure, no
attributes, and never too much.
"""

import errno
import json
import re
import shutil
from functools import partial

import laspy
import numpy as np
import pyogrio
import pytest
import shapely
from click.testing import CliRunner

from hiproof import method
from hiproof.city.run import Request, reconstruct_area
from hiproof.city.work import bundles, solve
from hiproof.city.work.solve import reconstruct
from hiproof.cli.app import app
from hiproof.errors import InputError
from hiproof.settings import Settings
from layers import write_layer, write_raster
from run_records import by_id, records
from tiny_town import CRS, make_town, write_cloud, write_footprints, write_town

NO_CLASS = 1
SECRET = "J. Smith, 5 Mill Lane"


def set_failing(patch, *ids):
    """Let the fit of some buildings fail, with the sum of their points in the message."""

    def failing(points, footprint, terrain, settings, id, ground, unused, neighbours):
        if id in ids:
            corner = np.array([footprint.polygon.bounds[:2]]) if footprint else points[:1, :2]
            raise KeyError(
                f"{len(points)} points, {points.sum():.9f}, {terrain.height_at(corner)[0]:.9f}"
            )
        return reconstruct(points, footprint, terrain, settings, id, ground, unused)

    patch.setattr(solve, "reconstruct", failing)


@pytest.fixture
def set_failing_ids(monkeypatch):
    return partial(set_failing, monkeypatch)


@pytest.fixture(scope="module")
def failed_run(town_files, tmp_path_factory):
    """The folder of a run whose first building failed; do not write into it."""
    out = tmp_path_factory.mktemp("failed")
    with pytest.MonkeyPatch.context() as patch:
        set_failing(patch, "house-0")
        reconstruct_area(Request((town_files[0],), out, town_files[1]))
    return out


def read_solved_rows(out):
    """The rows of a run by building, without the attributes of the input."""
    return {id: row | {"attributes": {}} for id, row in by_id(out).items()}


def repeat(bundle, out):
    return CliRunner().invoke(app, ["repro", str(bundle), "--out", str(out)])


@pytest.mark.parametrize(
    ("with_footprints", "has_classes"), [(True, True), (True, False), (False, False)]
)
def test_a_bundle_repeats_the_failure_to_the_last_digit(
    with_footprints, has_classes, tmp_path, set_failing_ids
):
    """All that the building saw is in it: roof, ground and low points.

    Without the fault it comes out as in a run.
    """
    town = make_town(3, density=5.0)
    classes = town.classification if has_classes else np.full(len(town.xyz), NO_CLASS, np.uint8)
    cloud = str(write_cloud(tmp_path / "cloud.laz", town.xyz, classes))
    footprints = (
        str(write_footprints(tmp_path / "fp.geojson", town.footprints)) if with_footprints else None
    )
    request = Request((cloud,), tmp_path / "out", footprints, restart=True)
    reconstruct_area(request)
    expected = read_solved_rows(request.out)
    (victim,) = list(expected)[1:2]
    set_failing_ids(victim)
    summary = reconstruct_area(request)
    assert summary.bundles == tmp_path / "out" / "failures"
    (bundle,) = bundles.bundles_in(request.out)
    failure = by_id(request.out)[victim]["detail"]
    repeated = repeat(bundle, tmp_path / "again")
    assert repeated.exit_code == 1
    assert failure in repeated.output
    assert read_solved_rows(tmp_path / "again") == {victim: read_solved_rows(request.out)[victim]}
    assert failure.removesuffix(")").split(" (")[0] in (bundle / "traceback.txt").read_text()
    set_failing_ids()
    mended = repeat(bundle, tmp_path / "mended")
    assert mended.exit_code == 0
    assert read_solved_rows(tmp_path / "mended") == {victim: expected[victim]}


def test_a_bundle_holds_the_terrain_where_it_was_asked(tmp_path, set_failing_ids):
    pytest.importorskip("rasterio", reason="terrain models need rasterio (extra `terrain`)")
    town = make_town(2, density=3.0)
    cloud, footprints = map(str, write_town(tmp_path, town))
    x, y = np.floor(town.xyz[:, :2].min(axis=0)) - 50.0
    heights = np.add.outer(np.linspace(3, 1, 150), np.linspace(0, 0.9, 190)).astype(np.float32)
    terrain = write_raster(tmp_path / "dtm.tif", heights, x, y + 150, crs=CRS)
    request = Request((cloud,), tmp_path / "out", footprints, terrain, restart=True)
    reconstruct_area(request)
    expected = read_solved_rows(request.out)["house-1"]
    assert expected["ground_source"] == "terrain model dtm.tif"
    fail = method.judge

    def failing(building, *rest):
        if building.id == "house-1" and broken:
            raise ValueError("after the terrain was asked")
        return fail(building, *rest)

    broken = [True]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(method, "judge", failing)
        reconstruct_area(request)
        (bundle,) = bundles.bundles_in(request.out)
        assert repeat(bundle, tmp_path / "again").exit_code == 1
        broken.clear()
        assert repeat(bundle, tmp_path / "mended").exit_code == 0
    assert read_solved_rows(tmp_path / "mended")["house-1"] == expected


def test_a_bundle_has_no_attributes_and_its_files_open_anywhere(tmp_path, set_failing_ids):
    town = make_town(1)
    cloud = write_cloud(tmp_path / "cloud.laz", town.xyz, town.classification)
    (outline,) = town.footprints.values()
    columns = {"id": ["a"], "owner": [SECRET]}
    footprints = write_layer(tmp_path / "footprints.gpkg", [outline], columns)
    set_failing_ids("a")
    reconstruct_area(Request((str(cloud),), tmp_path / "out", str(footprints)))
    (bundle,) = bundles.bundles_in(tmp_path / "out")
    files = {path.name: path.read_bytes() for path in bundle.iterdir()}
    assert set(files) == {
        "points.laz",
        "footprint.geojson",
        "settings.toml",
        "failure.json",
        "traceback.txt",
    }
    assert not [name for name, content in files.items() if SECRET.encode() in content]
    las = laspy.read(bundle / "points.laz")
    is_near = shapely.intersects_xy(outline, np.asarray(las.x), np.asarray(las.y)) & (
        np.asarray(las.classification) == 6
    )
    assert is_near.sum() == (town.classification == 6).sum()
    _, _, geometry, _ = pyogrio.raw.read(bundle / "footprint.geojson")
    assert shapely.from_wkb(geometry[0]).equals(outline)
    assert Settings.from_toml(bundle / "settings.toml") == Settings()


def test_ids_may_be_anything(tmp_path, set_failing_ids):
    ids = ["../../etc", "CON", "a/b\\c:d*?", "Straße 5 'x'", "x" * 300, "nul", "…", "A", "a"]
    town = make_town(len(ids), density=2.0)
    renamed = dict(zip(ids, town.footprints.values(), strict=True))
    cloud = write_cloud(tmp_path / "cloud.laz", town.xyz, town.classification)
    footprints = write_footprints(tmp_path / "footprints.geojson", renamed)
    set_failing_ids(*ids)
    summary = reconstruct_area(Request((str(cloud),), tmp_path / "out", str(footprints)))
    assert summary.by_status == {"internal_error": len(ids)}
    selection = {
        json.loads((b / "failure.json").read_text())["id"]: b.name
        for b in bundles.bundles_in(tmp_path / "out")
    }
    assert set(selection) == set(ids)
    assert all(
        re.fullmatch(r"[a-z0-9][a-z0-9_-]*", name) and len(name) <= 60
        for name in selection.values()
    )
    assert len(set(selection.values()) - {"con", "nul"}) == len(ids)
    assert {path.name for path in tmp_path.iterdir()} == {"cloud.laz", "footprints.geojson", "out"}


def test_a_run_keeps_few_bundles_or_none(tmp_path, set_failing_ids, monkeypatch):
    monkeypatch.setattr(bundles, "MOST_BUNDLES", 2)
    town = make_town(4, density=2.0)
    cloud, footprints = map(str, write_town(tmp_path, town))
    set_failing_ids(*town.footprints)
    request = Request((cloud,), tmp_path / "out", footprints)
    assert reconstruct_area(request).by_status == {"internal_error": 4}
    assert len(bundles.bundles_in(request.out)) == 2
    settings = Settings.from_dict({"city": {"keep_failures": False}})
    summary = reconstruct_area(Request((cloud,), tmp_path / "off", footprints, settings=settings))
    assert summary.by_status == {"internal_error": 4}
    assert summary.bundles is None
    assert not (tmp_path / "off" / "failures").exists()


def test_bundles_go_with_the_failure_and_leave_other_files_alone(tmp_path, set_failing_ids):
    town = make_town(2, density=2.0)
    cloud, footprints = map(str, write_town(tmp_path, town))
    out = tmp_path / "out"
    set_failing_ids("house-0", "house-1")
    reconstruct_area(Request((cloud,), out, footprints))
    own_folder = out / "failures" / "mine"
    own_folder.mkdir()
    (own_folder / "notes.txt").touch()
    set_failing_ids("house-1")
    # it is finished: nothing is solved, and nothing goes
    reconstruct_area(Request((cloud,), out, footprints))
    assert len(bundles.bundles_in(out)) == 2
    (tmp_path / "known.jsonl").write_text(json.dumps({"id": "house-0", "block_height": 5.0}) + "\n")
    reconstruct_area(Request((cloud,), out, footprints, overrides=str(tmp_path / "known.jsonl")))
    assert [bundle.name for bundle in bundles.bundles_in(out)] == ["house-1"]
    set_failing_ids()
    assert reconstruct_area(Request((cloud,), out, footprints, restart=True)).exit_code == 0
    assert bundles.bundles_in(out) == []
    assert (own_folder / "notes.txt").exists()


@pytest.mark.parametrize(
    "error", [OSError(errno.ENOSPC, "No space left on device"), ValueError("odd"), MemoryError()]
)
def test_a_bundle_that_cannot_be_written_ends_no_run(
    error, town_files, failed_run, tmp_path, set_failing_ids, monkeypatch, caplog
):
    def refuse(*_):
        raise error

    set_failing_ids("house-0")
    monkeypatch.setattr(bundles, "write_outline", refuse)
    summary = reconstruct_area(Request((town_files[0],), tmp_path / "full", town_files[1]))
    assert summary.by_status == {"modelled": 3, "internal_error": 1}
    assert records(tmp_path / "full") == records(failed_run)
    assert not (tmp_path / "full" / "failures").exists()
    assert "the input of building house-0 could not be kept" in caplog.text


def test_the_traceback_is_in_the_log(town_files, tmp_path, set_failing_ids, caplog):
    set_failing_ids("house-2")
    with caplog.at_level("INFO", logger="hiproof"):
        reconstruct_area(Request((town_files[0],), tmp_path, town_files[1]))
    (message,) = [
        record for record in caplog.records if "building house-2 failed" in record.getMessage()
    ]
    assert "Traceback (most recent call last)" in message.getMessage()
    assert "raise KeyError" in message.getMessage()


@pytest.mark.parametrize(
    "damage", ["no folder", "no points", "cut off", "no outline", "no settings", "other JSON"]
)
def test_a_damaged_bundle_is_refused_in_one_sentence(damage, failed_run, tmp_path):
    (whole,) = bundles.bundles_in(failed_run)
    bundle = shutil.copytree(whole, tmp_path / "bundle")
    if damage == "no folder":
        shutil.rmtree(bundle)
    elif damage == "cut off":
        (bundle / "points.laz").write_bytes((bundle / "points.laz").read_bytes()[:900])
    elif damage == "other JSON":
        (bundle / "failure.json").write_text("[1]")
    else:
        name = {
            "no points": "points.laz",
            "no outline": "footprint.geojson",
            "no settings": "settings.toml",
        }[damage]
        (bundle / name).unlink()
    with pytest.raises((InputError, Exception), match=r"^expected .*, got.*") as caught:
        bundles.load_bundle(bundle)
    assert "\n" not in str(caught.value)
