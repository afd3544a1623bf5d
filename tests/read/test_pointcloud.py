"""Point clouds come back as they were written, in every format; what cannot be read gets one
sentence.
"""

import struct
from dataclasses import replace

import laspy
import numpy as np
import pytest
from pyproj import CRS

from hiproof.errors import InputError, InputWarning
from hiproof.frames import METRES
from hiproof.read.points.las import is_copc
from hiproof.read.points.pointcloud import (
    expand_paths,
    iter_points,
    read_header,
    read_points,
    warn_coarse,
)
from hiproof.settings import Settings


def some_points(count=500, seed=0):
    rng = np.random.default_rng(seed)
    xyz = np.round(rng.uniform([85000, 446000, -3], [85060, 446040, 20], (count, 3)), 3)
    return xyz, rng.choice([1, 2, 6], count).astype(np.uint8)


def write_las(path, xyz, classes=None, epsg=None, version="1.4", point_format=6):
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.offsets = np.floor(xyz.min(axis=0)) if len(xyz) else np.zeros(3)
    header.scales = np.full(3, 0.001)
    if epsg is not None:
        header.add_crs(CRS.from_epsg(epsg))
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    if classes is not None:
        las.classification = classes
    las.write(path)
    return path


PLY_HEAD = """ply
format {form} 1.0
comment a test
element vertex {count}
property uchar red
property double x
property double y
property double z
property uchar scalar_Classification
element face 0
property list uchar int vertex_indices
end_header
"""


def write_copc(path, xyz, classes):
    """A COPC file of one octree node: a LAZ file whose first VLR is COPC's and whose last EVLR is
    the hierarchy.
    """
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.offsets, header.scales = np.floor(xyz.min(axis=0)), np.full(3, 0.001)
    centre, half = (xyz.min(axis=0) + xyz.max(axis=0)) / 2, float(np.ptp(xyz, axis=0).max())
    info = struct.pack("<5d2Q2d11Q", *centre, half, half, 0, 32, 0.0, 0.0, *[0] * 11)
    header.vlrs.append(laspy.VLR("copc", 1, "copc info", info))
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.classification = classes
    las.write(path)
    raw = bytearray(path.read_bytes())
    data_start = struct.unpack_from("<I", raw, 96)[0]
    table = struct.unpack_from("<q", raw, data_start)[0]
    entry = struct.pack("<4iQ2i", 0, 0, 0, 0, data_start + 8, table - data_start - 8, len(xyz))
    struct.pack_into("<QI", raw, 235, len(raw), 1)
    # where the root hierarchy page starts
    struct.pack_into("<Q", raw, 375 + 54 + 40, len(raw) + 60)
    raw += struct.pack("<H16sHQ32s", 0, b"copc", 1000, len(entry), b"") + entry
    path.write_bytes(raw)
    return path


def write_ply(path, xyz, classes, form):
    head = PLY_HEAD.format(form=form, count=len(xyz)).encode()
    if form == "ascii":
        points = zip(*xyz.T, classes, strict=True)
        rows = "".join(f"7 {x:.3f} {y:.3f} {z:.3f} {c}\n" for x, y, z, c in points)
        path.write_bytes(head + rows.encode())
        return path
    number = ("<" if "little" in form else ">") + "f8"
    kinds = [("red", "u1"), *((name, number) for name in "xyz"), ("c", "u1")]
    records = np.zeros(len(xyz), np.dtype(kinds))
    records["x"], records["y"], records["z"], records["c"] = *xyz.T, classes
    path.write_bytes(head + records.tobytes())
    return path


def write_text(path, xyz, classes, delimiter=",", header="x,y,z,classification"):
    rows = [
        delimiter.join([*(f"{v:.3f}" for v in p), str(c)])
        for p, c in zip(xyz, classes, strict=True)
    ]
    path.write_text("\n".join(([header] if header else []) + rows) + "\n")
    return path


FORMATS = {
    "las 1.2": lambda p, xyz, c: write_las(p / "a.las", xyz, c, version="1.2", point_format=1),
    "las 1.4, old points": lambda p, xyz, c: write_las(p / "a.las", xyz, c, point_format=1),
    "laz 1.4": lambda p, xyz, c: write_las(p / "a.laz", xyz, c),
    "copc": lambda p, xyz, c: write_copc(p / "a.copc.laz", xyz, c),
    "ply ascii": lambda p, xyz, c: write_ply(p / "a.ply", xyz, c, "ascii"),
    "ply little": lambda p, xyz, c: write_ply(p / "a.ply", xyz, c, "binary_little_endian"),
    "ply big": lambda p, xyz, c: write_ply(p / "a.ply", xyz, c, "binary_big_endian"),
    "csv": lambda p, xyz, c: write_text(p / "a.csv", xyz, c),
    "semicolons": lambda p, xyz, c: write_text(p / "a.txt", xyz, c, ";", "X;Y;Z;Class"),
    "commented header": lambda p, xyz, c: write_text(
        p / "a.xyz", xyz, c, " ", "//X Y Z Classification"
    ),
}


@pytest.mark.parametrize("name", FORMATS)
def test_points_and_classes_come_back_in_every_format(tmp_path, name):
    xyz, classes = some_points()
    path = FORMATS[name](tmp_path, xyz, classes)
    cloud, header = read_points(path), read_header(path)
    assert np.allclose(cloud.xyz, xyz, atol=1e-6)
    assert np.array_equal(cloud.classification, classes)
    assert header.count == len(xyz)
    assert np.allclose(header.bounds, [*xyz.min(axis=0), *xyz.max(axis=0)])


@pytest.mark.parametrize("name", FORMATS)
def test_chunks_and_boxes_agree_with_the_whole(tmp_path, name):
    """Their coordinates lie in one piece, so that nothing is compiled for a format."""
    xyz, classes = some_points()
    path = FORMATS[name](tmp_path, xyz, classes)
    chunks = list(iter_points(path, chunk_points=64))
    assert max(map(len, chunks)) <= 64
    assert all(cloud.xyz.flags.c_contiguous for cloud in chunks)
    assert np.allclose(np.concatenate([c.xyz for c in chunks]), xyz, atol=1e-6)
    lower, upper = (85010.0, 446005.0), (85030.0, 446030.0)
    inside = ((xyz[:, :2] >= lower) & (xyz[:, :2] <= upper)).all(axis=1)
    assert np.allclose(read_points(path, box=(*lower, *upper)).xyz, xyz[inside], atol=1e-6)


def test_copc_is_told_from_laz_by_its_first_record(tmp_path):
    xyz, classes = some_points(50)
    assert is_copc(write_copc(tmp_path / "a.laz", xyz, classes))
    assert not is_copc(write_las(tmp_path / "b.laz", xyz, classes))


def test_coordinates_at_ten_million_keep_their_millimetres(tmp_path):
    xyz = np.round(some_points()[0] + [1e7, 1e7, 0], 3)
    assert np.allclose(read_points(write_las(tmp_path / "far.laz", xyz)).xyz, xyz, atol=1e-6)


def test_crs_comes_from_the_header_and_the_setting_overrules_it(tmp_path):
    xyz, _ = some_points(20)
    path = write_las(tmp_path / "a.laz", xyz, epsg=28992)
    assert read_points(path).crs.to_epsg() == read_header(path).crs.to_epsg() == 28992
    settings = Settings.from_dict({"read": {"crs": "EPSG:7415"}})
    assert read_points(path, settings=settings).crs.to_epsg() == 7415
    assert read_points(write_las(tmp_path / "b.las", xyz)).crs is None


def test_folders_wildcards_and_repeats_name_each_file_once(tmp_path):
    xyz, classes = some_points(20)
    a, b = write_las(tmp_path / "a.laz", xyz), write_text(tmp_path / "b.csv", xyz, classes)
    (tmp_path / "notes.md").write_text("no points")
    assert expand_paths((tmp_path,)) == [a, b]
    assert expand_paths((str(tmp_path / "*.laz"), tmp_path, str(b))) == [a, b]
    cloud = read_points(tmp_path)
    assert len(cloud) == 40 and cloud.sources == (str(a), str(b))


def test_notes_and_lists_of_a_delivery_are_left_aside_and_said(tmp_path):
    xyz, classes = some_points(20)
    cloud, points = write_las(tmp_path / "a.laz", xyz), write_text(tmp_path / "b.csv", xyz, classes)
    (tmp_path / "notes.txt").write_text("The delivery\nof 2023")
    (tmp_path / "tiles.csv").write_text("name,area\na,1\n")
    remark = r"text without points is left aside: notes\.txt, tiles\.csv"
    with pytest.warns(InputWarning, match=remark):
        assert expand_paths((tmp_path,)) == [cloud, points]
    cloud.unlink()
    points.unlink()
    with pytest.raises(InputError, match="expected lines of x y z in"):
        read_points(tmp_path)


@pytest.mark.parametrize(
    "text",
    [
        "1 2 3\n4 5 6\n",
        "2\n1 2 3 9 9\n4 5 6 9 9\n",
        "id;z;y;x\n7;3;2;1\n8;6;5;4\n",
        "\n# made by\n1\t2\t3\n4\t5\t6",
    ],
)
def test_text_layouts_are_recognised(tmp_path, text):
    (tmp_path / "a.pts").write_text(text)
    cloud = read_points(tmp_path / "a.pts")
    assert cloud.xyz.tolist() == [[1, 2, 3], [4, 5, 6]] and cloud.classification is None


def test_points_that_are_not_finite_are_dropped_with_a_warning(tmp_path):
    (tmp_path / "a.xyz").write_text("1 2 3\nnan 2 3\n1 inf 3\n4 5 6\n")
    with pytest.warns(InputWarning, match="2 points with NaN or infinite"):
        assert read_points(tmp_path / "a.xyz").xyz.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_withheld_points_are_left_out_with_a_warning(tmp_path):
    xyz, classes = some_points(10)
    las = laspy.read(write_las(tmp_path / "a.las", xyz, classes))
    las.withheld = np.arange(10) < 4
    las.write(tmp_path / "b.las")
    with pytest.warns(InputWarning, match="4 points flagged as withheld"):
        assert np.allclose(read_points(tmp_path / "b.las").xyz, xyz[4:], atol=1e-6)
    with pytest.warns(InputWarning) as remarks:
        assert sum(len(cloud) for cloud in iter_points(tmp_path / "b.las", chunk_points=3)) == 6
    assert len(remarks) == 1, "a file's withheld points are told once, not by the chunk"


def write_coarse_las(path, xyz, plan, height):
    header = laspy.LasHeader(version="1.2", point_format=1)
    header.scales = (plan, plan, height)
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.write(path)
    return path


def write_rounded_text(path, xyz, plan, height):
    steps = np.array([plan, plan, height])
    return write_text(path, np.rint(xyz / steps) * steps, np.zeros(len(xyz), int))


@pytest.mark.parametrize(
    ("write", "name"), [(write_coarse_las, "a.las"), (write_rounded_text, "a.csv")]
)
@pytest.mark.parametrize(
    ("plan", "height", "is_remarked"),
    [(1.0, 0.1, "1 m in plan and 0.1 m in height"), (0.001, 0.1, "0.1 m in height")],
)
def test_coordinates_in_coarse_steps_are_told_of_once(
    tmp_path, write, name, plan, height, is_remarked
):
    header = read_header(write(tmp_path / name, some_points()[0], plan, height))
    copies = [replace(header, path=other) for other in ("b", "c")]
    remark = f"{name} and 2 more: coordinates come in steps of {is_remarked}, and"
    with pytest.warns(InputWarning, match=remark) as caught:
        warn_coarse([header, *copies], METRES)
    assert len(caught) == 1


@pytest.mark.parametrize("name", FORMATS)
def test_of_coordinates_in_fine_steps_nothing_is_said(tmp_path, name, recwarn):
    path = FORMATS[name](tmp_path, *some_points())
    warn_coarse([read_header(path)], METRES)
    read_points(path)
    assert not recwarn.list


def test_steps_in_feet_are_told_in_metres(tmp_path):
    path = write_coarse_las(tmp_path / "a.las", some_points()[0], 0.1, 1.0)
    with pytest.warns(InputWarning, match="steps of 0.305 m in height, and"):
        read_points(path, settings=Settings.from_dict({"read": {"unit": "foot"}}))


AS_TOLD = {
    "text as laz": ("bad.laz", b"1 2 3\n4 5 6\n"),
    "empty": ("bad.laz", b""),
    "ply of faces": (
        "bad.ply",
        b"ply\nformat ascii 1.0\nelement face 2\nproperty int a\nend_header\n1\n2\n",
    ),
    "ply without end": ("bad.ply", b"ply\nformat ascii 1.0\nelement vertex 2\n"),
    "prose": ("bad.txt", b"Dear reader, this is\nno point cloud at all\n"),
    "word among numbers": ("bad.xyz", b"1 2 3\n4 five 6\n"),
    "two columns": ("bad.csv", b"1,2\n3,4\n"),
    "binary text": ("bad.xyz", bytes(range(256))),
    "other ending": ("cloud.jpg", b"\xff\xd8\xff\xe0"),
    "grid": ("dsm.asc", b"NCOLS 3\nNROWS 2\nXLLCORNER 85000\n5 5 5\n5 5 5\n"),
    "E57": ("cloud.e57", b"ASTM-E57" + bytes(40)),
}
"""Name and content of files that nobody has to damage."""


def write_damaged(tmp_path, kind):
    """Where a file lies that is wrong in this way; "missing" is none."""
    if kind in AS_TOLD:
        name, content = AS_TOLD[kind]
        (tmp_path / name).write_bytes(content)
        return tmp_path / name
    if kind == "empty folder":
        (tmp_path / "folder").mkdir()
        return tmp_path / "folder"
    return damaged_points(tmp_path, kind)


def damaged_points(tmp_path, kind):
    """A sound file of 5000 points, cut or changed; others are in tests/fuzz/damaged_clouds.py."""
    xyz, classes = some_points(5000)
    path = tmp_path / "bad.laz"
    if kind == "zero points":
        path = write_las(tmp_path / "zero.las", np.empty((0, 3)))
    elif kind == "truncated ply":
        path = write_ply(tmp_path / "bad.ply", xyz, classes, "binary_little_endian")
        path.write_bytes(path.read_bytes()[:5000])
    elif kind == "degrees":
        path = write_las(path, xyz - [85000, 446000, 0], epsg=4326)
    return path


BAD = {
    "text as laz": "rename it to .xyz",
    "empty": "an empty file",
    "missing": "no such file",
    "empty folder": "point files in the folder",
    "zero points": "got none",
    "truncated ply": "the file is truncated",
    "ply of faces": "'face' before the vertices",
    "ply without end": "does not end",
    "prose": "Dear reader",
    "word among numbers": "after 0 points",
    "two columns": "nothing like a point",
    "binary text": "binary data",
    "degrees": "in degrees",
    "other ending": r"ending in \.jpg",
    "grid": "ESRI ASCII grid",
    "E57": r"got E57; convert it first .*cloud\.laz",
}


@pytest.mark.parametrize("kind", BAD)
def test_what_cannot_be_read_gets_one_full_sentence(tmp_path, kind):
    with pytest.raises(InputError, match=BAD[kind]) as caught:
        read_points(write_damaged(tmp_path, kind))
    message = str(caught.value)
    assert message.startswith("expected") and "got" in message and "Traceback" not in message


def test_no_path_and_a_box_beside_the_points_are_refused(tmp_path):
    with pytest.raises(InputError, match="at least one"):
        read_points()
    with pytest.raises(InputError, match="inside the box"):
        read_points(write_las(tmp_path / "a.laz", some_points(9)[0]), box=(0, 0, 1, 1))
