"""RoofN3D's two files, made small here in their exact layout, come back whole and once."""

import numpy as np
import pytest
import shapely

from hiproof.errors import InputError, InputWarning
from hiproof.read.roofn3d import read_roofn3d, read_roofn3d_labels

HEADER = (
    "id,class,points,outline,unassignedsurfacegrowingpoints,"
    "unassignedsubsurfacegrowingpoints,brep\n"
)
SURFACES = "id,points,outline,plane_a,plane_b,plane_c,plane_d,fk_buildings\n"
OUTLINE = "MULTIPOLYGON(((0 0,9 0,9 6,0 6,0 0)))"
BREP = "MULTIPOLYGON Z (((0 0 3,9 0 3,9 3 5,0 3 5,0 0 3)))"


def multipoint(points):
    return "MULTIPOINT Z (" + ",".join(" ".join(f"{v:.3f}" for v in p) for p in points) + ")"


def roof(seed, count=40):
    return np.round(
        np.random.default_rng(seed).uniform(
            [586000, 4500000, 10], [586009, 4500006, 15], (count, 3)
        ),
        3,
    )


def row(id, class_name, points):
    small = multipoint(points[:2])
    return f'{id},{class_name},"{multipoint(points)}","{OUTLINE}",,"{small}","{BREP}"\n'


@pytest.fixture
def buildings(tmp_path):
    path = tmp_path / "roofn3d_buildings.csv"
    classes = [
        "Saddleback roof",
        "Two-sided hip roof",
        "Pyramid roof",
        "Saddleback roof",
        "Onion dome",
    ]
    ids = [7, 8, 9, 7, 10]
    path.write_text(
        HEADER
        + "".join(row(i, c, roof(k)) for k, (i, c) in enumerate(zip(ids, classes, strict=True)))
    )
    return path


def test_buildings_come_back_once_with_our_names_of_their_types(buildings):
    with pytest.warns(InputWarning, match="1 row with the id"):
        records = list(read_roofn3d(buildings))
    assert [(r.id, r.type) for r in records] == [
        ("7", "gable"),
        ("8", "hip"),
        ("9", "pyramid"),
        ("10", None),
    ]
    assert records[3].class_name == "Onion dome"
    assert np.array_equal(records[0].points, roof(0))
    assert records[0].outline.equals(shapely.box(0, 0, 9, 6))


def test_labels_are_found_by_coordinates(buildings, tmp_path):
    path = tmp_path / "roofn3d_surfacegrowing.csv"
    pieces = [(8, roof(1)[:10]), (7, roof(0)[5:20]), (7, roof(0)[20:32]), (8, roof(1)[30:])]
    rows = [f'{k},"{multipoint(p)}","{BREP}",0,0.5,1,-3,{b}\n' for k, (b, p) in enumerate(pieces)]
    path.write_text(SURFACES + "".join(rows))
    with pytest.warns(InputWarning):
        labels = {
            record.id: label.tolist()
            for record, label in read_roofn3d_labels(path, read_roofn3d(buildings))
        }
    assert labels["7"] == [-1] * 5 + [0] * 15 + [1] * 12 + [-1] * 8
    assert labels["8"] == [0] * 10 + [-1] * 20 + [1] * 10
    assert set(labels["9"]) == {-1}


def test_a_field_of_megabytes_and_empty_fields_are_read(tmp_path):
    path = tmp_path / "big.csv"
    path.write_text(
        HEADER + row(1, "Pyramid roof", roof(0, 50_000)) + "2,Pyramid roof,,,,,\n3,Pyramid roof\n"
    )
    records = list(read_roofn3d(path))
    assert [len(r.points) for r in records] == [50_000, 0, 0] and records[1].outline.is_empty


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "an empty file"),
        ("x,y,z\n1,2,3\n", "got x, y, z"),
        (HEADER + '1,Pyramid roof,"MULTIPOINT Z (1 2 3,4 5)",,,,\n', "row 2 .*Expected number"),
        (HEADER + '1,Pyramid roof,"MULTIPOINT Z (1 2 three)",,,,\n', "row 2 .*three"),
        (HEADER + '1,Pyramid roof,"MULTIPOINT Z (1 2 3,4', "row 2 .*cut off"),
        (HEADER + '1,Pyramid roof,"MULTIPOINT Z (1 2 3)","POLYGON((0 0",,,\n', "row 2 "),
    ],
)
def test_what_is_not_roofn3d_gets_one_full_sentence(tmp_path, text, words):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        list(read_roofn3d(path))


def test_a_missing_file_and_the_wrong_file_are_refused(tmp_path, buildings):
    with pytest.raises(InputError, match="no such file"):
        list(read_roofn3d(tmp_path / "none.csv"))
    with pytest.raises(InputError, match="fk_buildings"):
        list(read_roofn3d_labels(buildings, iter(())))
