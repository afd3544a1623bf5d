"""`hiproof classify`: classes of a copy, everything else as it was, and files that cannot be
classified.
"""

import laspy
import numpy as np
import pytest
from click.testing import CliRunner

from hiproof.classify.files import classify_file, merge_classes
from hiproof.cli.app import app
from hiproof.errors import InputError, OutputError
from hiproof.settings import Settings
from tiny_town import make_town, write_cloud


def rich_file(path, town, classes):
    """A file of many dimensions, a user's own among them."""
    write_cloud(path, town.xyz, classes)
    las, rng = laspy.read(path), np.random.default_rng(0)
    las.add_extra_dim(laspy.ExtraBytesParams("moisture", np.float32))
    las.moisture = rng.random(len(town.xyz)).astype(np.float32)
    las.intensity = rng.integers(0, 60_000, len(town.xyz))
    las.gps_time = rng.random(len(town.xyz))
    las.synthetic = rng.integers(0, 2, len(town.xyz))
    las.header.vlrs.append(laspy.VLR("someone", 7, "a note", b"kept as it is"))
    las.write(path)
    return path


def test_a_copy_differs_in_its_classes_alone(tmp_path):
    town = make_town()
    classes = np.where(np.arange(len(town.xyz)) % 50 == 0, 9, 1)
    path, out = rich_file(tmp_path / "in.laz", town, classes), tmp_path / "out.laz"
    result = CliRunner().invoke(app, ["classify", str(path), "--out", str(out)])
    assert result.exit_code == 0 and "building points of" in result.output
    old, new = laspy.read(path), laspy.read(out)
    for name in old.point_format.dimension_names:
        assert name == "classification" or np.array_equal(old[name], new[name]), name
    notes = [[v.record_data_bytes() for v in las.vlrs if v.record_id != 4] for las in (old, new)]
    # 4 tells of the further dimensions
    assert notes[0] == notes[1] and b"kept as it is" in notes[1]
    classes_after, is_changeable = np.asarray(new.classification), classes != 9
    assert (classes_after[~is_changeable] == 9).all()
    assert (classes_after[is_changeable] == town.classification[is_changeable]).mean() > 0.97


def test_points_that_are_neither_keep_their_class_unless_it_was_one_of_the_two():
    old = np.array([1, 5, 2, 6, 5, 0, 6], np.uint8)
    result = np.array([1, 1, 1, 1, 6, 2, 6], np.uint8)
    assert merge_classes(old, result).tolist() == [1, 5, 1, 1, 6, 2, 6]


@pytest.mark.parametrize("kind", [9, 7])
def test_a_cloud_of_water_or_of_noise_is_refused(tmp_path, kind):
    town = make_town(1)
    path = write_cloud(tmp_path / "in.laz", town.xyz, np.full(len(town.xyz), kind))
    with pytest.raises(InputError, match="noise, water or bridges alone"):
        classify_file(path, tmp_path / "out.laz", Settings())
    assert not (tmp_path / "out.laz").exists()


def test_degrees_are_refused_although_no_crs_names_them(tmp_path):
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.offsets, header.scales = [4.0, 52.0, 0.0], [1e-7, 1e-7, 1e-3]
    las = laspy.LasData(header)
    las.x, las.y, las.z = (
        np.random.default_rng(0).uniform([4.8, 52.3, 0], [4.81, 52.31, 9], (100, 3)).T
    )
    las.write(tmp_path / "in.laz")
    with pytest.raises(InputError, match="which look like degrees; reproject it"):
        classify_file(tmp_path / "in.laz", tmp_path / "out.laz", Settings())


def test_other_files_and_places_are_refused_with_a_sentence(tmp_path):
    town = make_town(1)
    path = write_cloud(tmp_path / "in.laz", town.xyz, np.ones(len(town.xyz)))
    text = tmp_path / "in.xyz"
    text.write_text("1 2 3\n4 5 6\n")
    damaged = tmp_path / "damaged.laz"
    damaged.write_bytes(path.read_bytes()[:4000])
    for wrong in (text, damaged, tmp_path / "none.laz"):
        with pytest.raises(InputError, match="expected a"):
            classify_file(wrong, tmp_path / "out.laz", Settings())
    for place in (path, tmp_path / "out.txt"):
        with pytest.raises(OutputError, match="expected a"):
            classify_file(path, place, Settings())
    assert laspy.read(path).header.point_count == len(town.xyz)
