"""The index beside a LAS file, written here by its documented layout: no point near a building is
missed, little else read.
"""

import struct
from itertools import pairwise

import laspy
import numpy as np
import pytest

from hiproof.errors import InputWarning
from hiproof.read.points.las import read_points
from hiproof.read.points.las_header import read_facts
from hiproof.read.points.lax import read_lax
from hiproof.read.points.pointcloud import iter_points
from read.test_pointcloud import write_las

POINTS = 4000


def find_cell(x, y, root, level):
    """Number of the cell of a level that holds (x, y), halving in float32."""
    (x0, y0), (x1, y1) = np.float32(root[:2]), np.float32(root[2:])
    index = 0
    for _ in range(level):
        index, mx, my = index << 2, (x0 + x1) / np.float32(2), (y0 + y1) / np.float32(2)
        x0, x1, index = (x0, mx, index) if x < mx else (mx, x1, index | 1)
        y0, y1, index = (y0, my, index) if y < my else (my, y1, index | 2)
    return sum(4**k for k in range(level)) + index


def write_lax(path, xyz, level=4, coarse_west=True, gap=3):
    """A quadtree of `level` levels; its western half is coarser; runs that are less than `gap`
    apart are one.
    """
    west, south = np.floor(xyz[:, :2].min(axis=0))
    east, north = np.ceil(xyz[:, :2].max(axis=0))
    cells = {}
    for i, (x, y, _) in enumerate(xyz):
        depth = level - 2 if coarse_west and x < (west + east) / 2 else level
        cells.setdefault(find_cell(x, y, (west, south, east, north), depth), []).append(i)
    head = (b"LASX", 0, b"LASS", 0, b"LASQ", 0, level, 0, 0, west, east, south, north)
    words = [struct.pack("<4sI4sI4sIIII4f4sII", *head, b"LASV", 0, len(cells))]
    for cell, members in cells.items():
        starts = [0, *(np.flatnonzero(np.diff(members) > gap) + 1), len(members)]
        runs = np.ravel([(members[a], members[b - 1]) for a, b in pairwise(starts)])
        form = f"<iII{len(runs)}I"
        words.append(struct.pack(form, cell, len(runs) // 2, len(members), *runs))
    path.write_bytes(b"".join(words))


def swath(seed=0):
    """Points in the order of a flight: along x, so that a place is a run."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform((611000, 6270000, 5), (611400, 6270300, 40), (POINTS, 3)).round(2)
    return xyz[np.argsort(xyz[:, 0].round(-1), kind="stable")]


@pytest.fixture
def indexed_cloud(tmp_path):
    xyz = swath()
    path = write_las(tmp_path / "a.laz", xyz)
    write_lax(tmp_path / "a.lax", xyz)
    return path, xyz


@pytest.mark.parametrize("seed", range(5))
def test_the_runs_hold_every_point_of_any_boxes(indexed_cloud, seed, monkeypatch):
    monkeypatch.setattr("hiproof.read.points.runs.RUN_POINTS", 10)
    path, xyz = indexed_cloud
    rng = np.random.default_rng(seed)
    lower = rng.uniform((610990, 6269990), (611380, 6270280), (3, 2))
    boxes = np.hstack([lower, lower + rng.uniform(1, 60, (3, 2))])
    runs = read_lax(path).find_runs(boxes)
    read = np.concatenate([cloud.xyz for cloud in iter_points(path, 100, runs=runs)])
    xy = xyz[:, None, :2]
    inside = ((xy >= boxes[:, :2]) & (xy <= boxes[:, 2:])).all(axis=2).any(axis=1)
    assert set(map(tuple, xyz[inside].round(2))) <= set(map(tuple, read.round(2)))
    assert len(read) == (runs[:, 1] - runs[:, 0]).sum() < POINTS


def test_boxes_away_from_all_points_read_nothing(indexed_cloud):
    path, _ = indexed_cloud
    runs = read_lax(path).find_runs(np.array([[0.0, 0.0, 9.0, 9.0]]))
    assert len(runs) == 0 and list(iter_points(path, runs=runs)) == []


def test_a_file_without_index_has_none(tmp_path):
    assert read_lax(write_las(tmp_path / "b.laz", swath())) is None
    assert read_lax("https://example.org/a.laz") is None


@pytest.mark.parametrize(
    "harm", ["cut off", "of another file", "something else", "empty", "64 bits"]
)
def test_an_index_that_cannot_be_used_is_left_aside(indexed_cloud, harm):
    path, xyz = indexed_cloud
    if harm == "of another file":
        write_las(path, xyz[:-1])
    index_path = path.with_suffix(".lax")
    data = bytearray(index_path.read_bytes())
    if harm == "64 bits":
        data[56] = 1
    others = {"cut off": data[: len(data) // 2 // 4 * 4], "empty": b""}
    others |= {"something else": b"not an index" * 20}
    index_path.write_bytes(others.get(harm, data))
    with pytest.warns(InputWarning, match=r"a\.lax: is left aside"):
        assert read_lax(path) is None


COUNT = 120_000  # more than two of LASzip's chunks


def write_random(path, point_format):
    rng = np.random.default_rng(point_format)
    header = laspy.LasHeader(version="1.4", point_format=point_format)
    header.scales, header.offsets = [0.01, 0.02, 0.001], [85_000.0, 446_000.0, -2.0]
    header.add_extra_dims([laspy.ExtraBytesParams("height", "f8")])
    las = laspy.LasData(header, laspy.ScaleAwarePointRecord.zeros(COUNT, header=header))
    las.X, las.Y, las.Z = rng.integers(-90_000, 90_000, (3, COUNT))
    las.classification = rng.integers(0, 256 if point_format >= 6 else 32, COUNT)
    for flag in ("withheld", "synthetic", "key_point"):
        las[flag] = rng.random(COUNT) < 0.3
    las.write(path)
    return las


@pytest.mark.parametrize("ending", ["las", "laz"])
@pytest.mark.parametrize("point_format", [0, 1, 2, 3, 6, 7, 8])
def test_coordinates_classes_and_withheld_points_are_those_of_laspy(tmp_path, point_format, ending):
    expected = write_random(tmp_path / f"cloud.{ending}", point_format)
    runs = [(0, 3), (61_000, COUNT)]
    kept = np.concatenate([np.arange(*run) for run in runs])
    with open(tmp_path / f"cloud.{ending}", "rb") as file:
        chunks = list(read_points(file, read_facts(file), runs, 20_000))
    assert max(len(classes) for _, classes, _ in chunks) == 20_000
    withheld = np.array(expected.withheld, bool)
    truths = expected.xyz, np.array(expected.classification), withheld
    for column, truth in zip(zip(*chunks, strict=True), truths, strict=True):
        np.testing.assert_array_equal(np.concatenate(column), truth[kept])
