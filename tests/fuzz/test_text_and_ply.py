"""Whatever stands in a text or PLY file: its points are read, all of them possible, or one sentence
says why not.
"""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hiproof.errors import InputError
from hiproof.read.plausible import is_plausible
from hiproof.read.points.pointcloud import iter_points, read_header
from read.test_pointcloud import some_points, write_ply

QUICK = settings(
    max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), database=None
)
FIELDS = st.one_of(
    st.floats(-1e4, 1e4).map(str),
    st.floats().map(str),
    st.sampled_from(
        [
            "x",
            "y",
            "z",
            "class",
            "#",
            "//",
            '"',
            "1,5",
            "0x1f",
            "1_000",
            "²",
            "9" * 400,
            "\ufeff",
            "-",
        ]
    ),
)
LINES = st.lists(st.lists(FIELDS, max_size=6), max_size=8)


def check(path):
    """Read the file through; nothing but an InputError may come of it, and no point that
    cannot be.
    """
    try:
        read_header(path)
        clouds = list(iter_points(path))
    except InputError as error:
        assert str(error).startswith("expected") and "got" in str(error) and str(path) in str(error)
        return
    for cloud in clouds:
        assert is_plausible(cloud.xyz).all()
        assert cloud.classification is None or len(cloud.classification) == len(cloud.xyz)


@pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")
@QUICK
@given(
    lines=LINES,
    delimiter=st.sampled_from([" ", ",", ";", "\t"]),
    ending=st.sampled_from(["\n", "\r\n", "\r"]),
)
def test_any_table_is_read_or_answered(lines, delimiter, ending, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / "any.xyz"
    path.write_text(ending.join(delimiter.join(line) for line in lines), newline="")
    check(path)


@QUICK
@given(content=st.binary(max_size=200))
def test_any_bytes_are_read_or_answered(content, tmp_path_factory):
    for ending in (".xyz", ".ply", ".laz"):
        path = tmp_path_factory.getbasetemp() / f"any{ending}"
        path.write_bytes(content)
        check(path)


@pytest.fixture(scope="module", params=["ascii", "binary_little_endian"])
def ply(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("ply")
    return folder / "changed.ply", write_ply(
        folder / "sound.ply", *some_points(40), request.param
    ).read_bytes()


@pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")
@QUICK
@given(data=st.data())
def test_any_change_of_a_ply_file_is_read_or_answered(data, ply):
    path, raw = ply
    start = data.draw(st.integers(0, len(raw) - 1))
    inserted = data.draw(
        st.one_of(
            st.binary(max_size=8), st.sampled_from([b"99999999999", b"property float x\n", b"-1"])
        )
    )
    path.write_bytes(raw[:start] + inserted + raw[start + data.draw(st.integers(0, 12)) :])
    check(path)


def test_what_is_plausible_has_finite_coordinates_of_this_earth():
    xyz = np.array([[1e9, -1e9, 1e6], [1.1e9, 0, 0], [0, 0, -1.1e6], [np.inf, 0, 0]])
    assert is_plausible(xyz).tolist() == [True, False, False, False]
