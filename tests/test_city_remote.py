"""A run whose inputs are addresses: served on the loopback address, read in ranges, the same models
as from files.
"""

import numpy as np
import pytest

from hiproof.city.run import Request, reconstruct_area
from hiproof.errors import InputError
from hiproof.read.points.pointcloud import read_points
from layers import write_raster
from range_server import serve
from read.test_pointcloud import write_copc, write_ply, write_text
from run_records import RECORDS
from tiny_town import make_town, write_town

pytest.importorskip("aiohttp", reason="needs fsspec[http], part of the extra `city`")


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """A folder, its address, and the file that lists the ranges asked for."""
    folder = tmp_path_factory.mktemp("served")
    log = folder.with_name("ranges")
    log.touch()
    with serve(folder, log) as address:
        yield folder, address, log


def write_terrain(path, town):
    lower, upper = town.xyz.min(axis=0) - 20, town.xyz.max(axis=0) + 20
    columns, rows = np.ceil(upper[:2] - lower[:2]).astype(int)
    heights = np.full((rows, columns), 1.5, np.float32)
    return write_raster(path, heights, lower[0], upper[1])


def test_clouds_footprints_and_terrain_by_address_give_the_same_bytes(
    server, tmp_path, quick_tiles
):
    folder, address, log = server
    town = make_town()
    cloud, footprints = write_town(folder, town)
    terrain = write_terrain(folder / "terrain.tif", town)
    reconstruct_area(Request((str(cloud),), tmp_path / "files", str(footprints), str(terrain)))
    remote = Request(
        (f"{address}/cloud.laz",),
        tmp_path / "remote",
        f"{address}/footprints.geojson",
        f"{address}/terrain.tif",
    )
    reconstruct_area(remote)
    for name in RECORDS:
        assert (tmp_path / "remote" / name).read_bytes() == (tmp_path / "files" / name).read_bytes()
    assert {line.split()[0] for line in log.read_text().splitlines()} >= {
        "/cloud.laz",
        "/terrain.tif",
    }
    assert b"terrain model terrain.tif" in (tmp_path / "remote" / "parameters.jsonl").read_bytes()


def test_copc_by_address_is_read_in_ranges(server, tmp_path):
    folder, address, log = server
    town = make_town()
    write_copc(folder / "a.copc.laz", town.xyz, town.classification)
    cloud = read_points(
        f"{address}/a.copc.laz", box=(*town.xyz[:, :2].min(axis=0), *town.xyz[:, :2].max(axis=0))
    )
    assert len(cloud) == len(town.xyz)
    assert "/a.copc.laz" in log.read_text()


@pytest.mark.parametrize("name", ["a.ply", "b.ply", "c.xyz", "d.CSV"])
def test_text_and_ply_by_address_are_what_the_files_hold(server, name):
    folder, address, _ = server
    xyz = np.random.default_rng(1).uniform(0, 1000, (40000, 3)).round(3)
    classes = np.arange(40000, dtype=np.uint8) % 7
    if name.endswith("ply"):
        write_ply(
            folder / name, xyz, classes, "ascii" if name == "a.ply" else "binary_little_endian"
        )
    else:
        write_text(folder / name, xyz, classes)
    local, remote = read_points(folder / name), read_points(f"{address}/{name}?token=1")
    assert np.array_equal(local.xyz, remote.xyz) and np.array_equal(
        local.classification, remote.classification
    )


@pytest.mark.parametrize("name", ["page.ply", "page.xyz"])
def test_a_page_instead_of_points_gets_one_sentence(server, name):
    folder, address, _ = server
    (folder / name).write_text("<html>not a cloud</html>\n" * 50)
    with pytest.raises(InputError, match=name):
        read_points(f"{address}/{name}")


@pytest.mark.parametrize("name", ["missing.laz", "missing.ply", "missing.xyz"])
def test_an_address_that_answers_with_nothing_gets_one_sentence(server, name):
    _, address, _ = server
    with pytest.raises(InputError, match=rf"{name}, got: 404, message='File not found'"):
        read_points(f"{address}/{name}")


def test_an_address_of_something_else_gets_one_sentence(server):
    folder, address, _ = server
    (folder / "page.laz").write_text("<html>not a cloud</html>" * 50)
    with pytest.raises(InputError, match=r"page\.laz"):
        read_points(f"{address}/page.laz")
