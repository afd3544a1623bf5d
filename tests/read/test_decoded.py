"""A run decodes each point file once, and gets from it what it would decode again."""

import json
from collections import Counter

import laspy
import numpy as np
import pytest

from hiproof import Request, Settings, reconstruct_area
from hiproof.read import decoded, las
from hiproof.read.decoded import HOLDER, forget_points, hold_points
from hiproof.read.pointcloud import iter_points
from tiny_town import make_town, write_cloud, write_town

FLAT = Settings.from_dict(
    {"fit": {"parts": "one", "types": ["flat"]}, "segment": {"network": "never"}}
)


@pytest.fixture
def files(tmp_path):
    cloud, footprints = write_town(tmp_path, make_town(3))
    yield {"cloud": cloud, "footprints": footprints}
    forget_points()


@pytest.fixture
def decoded_points(monkeypatch):
    """How many points are decoded, by file."""
    counts = Counter()
    read_points = las.read_points

    def read_counted(file, *options):
        for chunk in read_points(file, *options):
            counts[file.name] += len(chunk.classes)
            yield chunk

    monkeypatch.setattr(las, "read_points", read_counted)
    return counts


def join(chunks):
    chunks = list(chunks)
    return [
        np.concatenate([getattr(chunk, name) for chunk in chunks]) for name in ("xyz", "classes")
    ]


def test_what_is_held_is_what_would_be_decoded(files, decoded_points):
    expected = join(iter_points(files["cloud"]))
    with hold_points():
        first = join(iter_points(files["cloud"]))
    decoded_points.clear()
    again = join(iter_points(files["cloud"]))
    assert not decoded_points
    for one, other, third in zip(expected, first, again, strict=True):
        np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(one, third)
    # it was given away, so that its memory is free
    assert not HOLDER.held
    assert list(iter_points(files["cloud"])) and decoded_points


def test_a_file_that_was_written_again_is_decoded_again(files):
    with hold_points():
        join(iter_points(files["cloud"]))
    cloud = laspy.read(files["cloud"])
    cloud.points = cloud.points[:100]
    cloud.write(files["cloud"])
    assert len(join(iter_points(files["cloud"]))[0]) == 100


def test_a_file_that_is_too_large_or_not_read_to_its_end_is_not_held(files, monkeypatch):
    with hold_points():
        next(iter_points(files["cloud"], 100))
    assert not HOLDER.held
    monkeypatch.setattr(decoded, "MOST_HELD_POINTS", 1000)
    with hold_points():
        join(iter_points(files["cloud"], 100))
    assert not HOLDER.held


def test_larger_chunks_than_wanted_are_not_handed_out(files):
    with hold_points():
        join(iter_points(files["cloud"]))
    assert max(len(chunk) for chunk in iter_points(files["cloud"], 100)) == 100


@pytest.mark.parametrize("has_footprints", [True, False])
def test_a_run_decodes_each_point_once(files, decoded_points, tmp_path, has_footprints):
    footprints = str(files["footprints"]) if has_footprints else None
    request = Request((str(files["cloud"]),), tmp_path / "out", footprints, settings=FLAT)
    assert reconstruct_area(request).buildings == 3
    assert list(decoded_points.values()) == [len(make_town(3).xyz)]
    assert not HOLDER.held


def test_a_file_that_is_named_from_its_folder_is_decoded_once(
    files, decoded_points, tmp_path, monkeypatch
):
    monkeypatch.chdir(files["cloud"].parent)
    request = Request((files["cloud"].name,), tmp_path / "out", settings=FLAT)
    assert reconstruct_area(request).buildings == 3
    assert decoded_points.total() == len(make_town(3).xyz)


def test_of_a_large_file_a_box_is_decoded_again(decoded_points, tmp_path, monkeypatch):
    """Points stand in the order of a flight, from house to house."""
    monkeypatch.setattr("hiproof.read.runs.RUN_POINTS", 50)
    monkeypatch.setattr(decoded, "MOST_HELD_POINTS", 1000)
    town = make_town(6)
    flown = np.argsort(town.xyz[:, 0].round(-1), kind="stable")
    cloud = write_cloud(tmp_path / "cloud.laz", town.xyz[flown], town.classification[flown])
    # so that no point is read to learn which classes there are
    by_class = FLAT.replace({"read": {"roofs": "class"}})
    box = tuple(town.footprints["house-0"].bounds)
    near, whole = (
        Request((str(cloud),), tmp_path / name, bbox=bbox, settings=by_class)
        for name, bbox in (("near", box), ("whole", None))
    )
    assert reconstruct_area(near).buildings == 1
    assert len(town.xyz) < decoded_points.total() < 1.4 * len(town.xyz)
    assert not HOLDER.places
    reconstruct_area(whole)
    (building,), buildings = (
        [
            json.loads(line)
            for line in (request.out / "parameters.jsonl").read_text().splitlines()[1:]
        ]
        for request in (near, whole)
    )
    assert building in buildings
