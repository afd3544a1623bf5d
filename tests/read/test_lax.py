"""The index beside a LAS file, written here by its documented layout: no point near a building is
missed, little else read.
"""

import struct
from itertools import pairwise

import numpy as np
import pytest

from hiproof.errors import InputWarning
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
    root = (*np.floor(xyz[:, :2].min(axis=0)), *np.ceil(xyz[:, :2].max(axis=0)))
    middle = (root[0] + root[2]) / 2
    cells = {}
    for i, (x, y, _) in enumerate(xyz):
        cells.setdefault(
            find_cell(x, y, root, level - 2 if coarse_west and x < middle else level), []
        ).append(i)
    words = [
        struct.pack(
            "<4sI4sI4sIIII4f4sII",
            b"LASX",
            0,
            b"LASS",
            0,
            b"LASQ",
            0,
            level,
            0,
            0,
            root[0],
            root[2],
            root[1],
            root[3],
            b"LASV",
            0,
            len(cells),
        )
    ]
    for cell, members in cells.items():
        starts = [0, *(np.flatnonzero(np.diff(members) > gap) + 1), len(members)]
        runs = [(members[a], members[b - 1]) for a, b in pairwise(starts)]
        words.append(
            struct.pack(f"<iII{2 * len(runs)}I", cell, len(runs), len(members), *np.ravel(runs))
        )
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
    is_expected = np.array(
        [p for p in xyz if any((p[:2] >= b[:2]).all() and (p[:2] <= b[2:]).all() for b in boxes)]
    )
    assert {tuple(p) for p in is_expected.round(2)} <= {tuple(p) for p in read.round(2)}
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
    index_path.write_bytes(
        {
            "cut off": data[: len(data) // 2 // 4 * 4],
            "something else": b"not an index" * 20,
            "empty": b"",
        }.get(harm, data)
    )
    with pytest.warns(InputWarning, match=r"a\.lax: is left aside"):
        assert read_lax(path) is None
