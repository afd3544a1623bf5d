"""Points as hiproof reads them are those that laspy reads, in every point format."""

import laspy
import numpy as np
import pytest

from hiproof.read.points.las import read_points
from hiproof.read.points.las_header import read_facts

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
