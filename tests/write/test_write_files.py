"""Files appear whole or not at all, and every refusal of the file system is one full sentence."""

import errno
import os
import resource
import signal
from dataclasses import replace

import numpy as np
import pytest

import hiproof.write as write
from handmade import gable_house, make_building, make_lost_building
from hiproof import read_parameters
from hiproof.errors import InputError, OutputError
from hiproof.model import ROOF
from hiproof.write.files import atomic, atomic_file, scratch
from written_run import write_all

WRITERS = {
    "buildings.gml": write.write_citygml,
    "buildings.city.jsonl": write.write_cityjson,
    "buildings.city.json": write.write_cityjson,
    "parameters.jsonl": write.write_parameters,
    "buildings.gpkg": write.write_attributes,
}
each_format = pytest.mark.parametrize("name", WRITERS)


def street(count=3):
    return [make_building(gable_house(), f"house {n}") for n in range(count)] + [
        make_lost_building()
    ]


def no_roof(solid):
    return replace(solid, faces=tuple(face for face in solid.faces if face.kind != ROOF))


def no_number(solid):
    return solid.move(np.array([0.0, 0.0, np.nan]))


def no_vertex(solid):
    return replace(solid, vertices=solid.vertices[:5])


def names_in(folder):
    return sorted(os.listdir(folder))


@each_format
def test_only_the_finished_file_is_left(tmp_path, name):
    WRITERS[name](tmp_path / "deep" / "down" / name, street())
    assert names_in(tmp_path / "deep" / "down") == [name]


@each_format
@pytest.mark.parametrize("problem", [ValueError, KeyboardInterrupt])
def test_an_interrupted_run_keeps_the_old_file(tmp_path, name, problem):
    def interrupt():
        yield from street()
        raise problem

    (tmp_path / name).write_text("old")
    with pytest.raises(problem):
        WRITERS[name](tmp_path / name, interrupt())
    assert names_in(tmp_path) == [name]
    assert (tmp_path / name).read_text() == "old"


@each_format
def test_the_same_buildings_give_the_same_bytes(tmp_path, name):
    for folder in ("one", "two"):
        WRITERS[name](tmp_path / folder / name, street())
    assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


@each_format
def test_no_buildings_still_make_a_file(tmp_path, name):
    WRITERS[name](tmp_path / name, [])
    assert names_in(tmp_path) == [name]


@each_format
def test_a_file_where_a_folder_should_be(tmp_path, name):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(OutputError, match="is a file, not a folder"):
        WRITERS[name](tmp_path / "out" / name, street())


@each_format
def test_a_folder_where_the_file_should_be(tmp_path, name):
    (tmp_path / name).mkdir()
    with pytest.raises(OutputError, match="a folder of this name is in the way"):
        WRITERS[name](tmp_path / name, street())


@each_format
def test_a_full_disk_leaves_nothing(tmp_path, name, file_size_limit):
    (tmp_path / name).write_text("old")
    file_size_limit(40_000)
    with pytest.raises(OutputError, match=f"expected to write .*{name}"):
        WRITERS[name](tmp_path / name, street(400))
    file_size_limit(None)
    assert names_in(tmp_path) == [name]
    assert (tmp_path / name).read_text() == "old"


@pytest.fixture
def file_size_limit():
    """A function that limits how long any file of this process may become: the nearest to a full
    disk without one.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    def limit(size):
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft if size is None else size, hard))

    yield limit
    limit(None)
    signal.signal(signal.SIGXFSZ, handler)


def test_no_space_left_says_so(tmp_path):
    with (
        pytest.raises(OutputError, match="the disk is full; free some space"),
        atomic(tmp_path / "a") as neighbour,
    ):
        neighbour.write_text("half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert names_in(tmp_path) == []


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full")
def test_a_full_device_says_so(tmp_path):
    with pytest.raises(OutputError, match="the disk is full"), atomic(tmp_path / "a") as neighbour:
        neighbour.symlink_to("/dev/full")
        neighbour.write_text("x" * 100_000)
    assert names_in(tmp_path) == []


def test_a_run_writes_its_files_together_or_not_at_all(tmp_path):
    write_all(tmp_path / "good", iter(street()), "EPSG:7415")
    expected = ["buildings.city.jsonl", "buildings.gml", "buildings.gpkg", "parameters.jsonl"]
    assert names_in(tmp_path / "good") == expected
    with pytest.raises(AttributeError):
        write_all(tmp_path / "bad", iter([*street(), "no building"]))
    assert names_in(tmp_path / "bad") == []


@pytest.mark.parametrize("break_it", [no_roof, no_number, no_vertex])
def test_a_broken_solid_does_not_stop_the_others(tmp_path, break_it):
    buildings = [*street(), make_building(break_it(gable_house()), "broken"), *street()]
    assert write_all(tmp_path, buildings) == ["broken"]
    records = read_parameters(tmp_path / "parameters.jsonl")
    assert [r["status"] for r in records if r["id"] == "broken"] == ["internal_error"]
    assert len(records) == 9


@each_format
def test_strange_ids_and_attributes_go_through(tmp_path, name):
    strange = {
        "": 1,
        "\0": "\0",
        "\ud800": "a\ud800",
        "x" * 300: 2,
        5: [1],
        '"; drop table': object,
        "geom": 1,
        "a:b": 1,
    }
    buildings = [
        make_building(gable_house(), id, attributes=strange)
        for id in ("\0", "", "\ud800", "<&>", "x" * 300, "é")
    ]
    WRITERS[name](tmp_path / name, buildings)
    assert names_in(tmp_path) == [name]


def test_errors_of_the_caller_pass_unchanged(tmp_path):
    with pytest.raises(FileNotFoundError), atomic_file(tmp_path / "a"):
        open(tmp_path / "missing" / "input.laz", encoding="utf-8").close()
    assert names_in(tmp_path) == []


def test_a_link_is_followed(tmp_path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link.txt").symlink_to(tmp_path / "real" / "target.txt")
    with atomic_file(tmp_path / "link.txt") as file:
        file.write(b"new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real" / "target.txt").read_bytes() == b"new"


def test_a_scratch_file_is_gone_afterwards(tmp_path):
    with scratch(tmp_path / "a") as file:
        file.write(b"abc")
        file.seek(0)
        assert file.read() == b"abc"
    assert names_in(tmp_path) == []


@pytest.mark.parametrize("name", [name for name in WRITERS if name != "parameters.jsonl"])
def test_a_crs_that_is_none(tmp_path, name):
    with pytest.raises(InputError, match="expected a coordinate reference system"):
        WRITERS[name](tmp_path / name, street(), "EPSG:nonsense")
    assert names_in(tmp_path) == []
