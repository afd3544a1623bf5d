"""`hiproof segment`: labelled points and the table, and files that cannot be labelled."""

import csv

import laspy
import numpy as np
import pytest
from benchmarks.samples import training_sample
from click.testing import CliRunner

from hiproof.cli.app import import_command
from hiproof.errors import InputError, OutputError
from hiproof.segment import segment
from hiproof.segment.files import segment_files
from hiproof.settings import Settings


def write_cloud(path, seed, shift=(85_000.0, 446_000.0, 10.0)):
    points = np.round(training_sample(np.random.default_rng(seed))[0] + shift, 3)
    np.savetxt(path, points, fmt="%.3f")
    return points


def test_points_and_table_say_what_segment_says(tmp_path):
    clouds = [tmp_path / "a.xyz", tmp_path / "b.xyz"]
    points = [write_cloud(path, seed) for seed, path in enumerate(clouds)]
    out = tmp_path / "labelled.laz"
    assert segment_files(clouds, out, Settings()) == {}
    las = laspy.read(out)
    np.testing.assert_allclose(las.xyz, np.concatenate(points), atol=1e-3)
    results = [segment(cloud) for cloud in points]
    assert (las.roof_type == np.concatenate([f.labels + 1 for f in results])).mean() > 0.99
    assert np.bincount(las.building).tolist() == [0, *map(len, points)]
    rows = list(csv.DictReader(out.with_suffix(".csv").read_text().splitlines()))
    assert [row["type"] for row in rows] == [f.type for f in results]
    assert sum(float(rows[0][name]) for name in results[0].types) == pytest.approx(1.0, abs=1e-3)


def test_one_bad_file_does_not_stop_the_others_and_the_exit_code_tells(tmp_path):
    write_cloud(tmp_path / "good.xyz", 1)
    np.savetxt(tmp_path / "few.xyz", np.random.default_rng(0).random((5, 3)))
    arguments = [
        str(tmp_path / "few.xyz"),
        str(tmp_path / "good.xyz"),
        "--out",
        str(tmp_path / "out.laz"),
    ]
    result = CliRunner().invoke(import_command("segment"), arguments)
    assert result.exit_code == 1
    assert "at least 10 points" in result.output
    assert len((tmp_path / "out.csv").read_text().splitlines()) == 2


def test_nothing_to_label_and_wrong_names_are_refused(tmp_path):
    np.savetxt(tmp_path / "few.xyz", np.random.default_rng(0).random((5, 3)))
    with pytest.raises(InputError, match="at least one building"):
        segment_files([tmp_path / "few.xyz"], tmp_path / "out.laz", Settings())
    with pytest.raises(OutputError, match="laz"):
        segment_files([tmp_path / "few.xyz"], tmp_path / "out.txt", Settings())
