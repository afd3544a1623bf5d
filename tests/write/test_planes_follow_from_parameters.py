"""What is written of a part is the part: its planes follow from its written parameters to a millimetre."""

from pathlib import Path

import numpy as np
import pytest

import hiproof
from hiproof.primitives.family import planes_of
from hiproof.read import read_footprints, read_points
from hiproof.read.assign import points_of_footprints
from hiproof.settings import Settings
from hiproof.simulate import demo_files
from hiproof.write.parameters import building_record

PLAIN = Settings.from_dict({"segment": {"enabled": False}})
BUILDING_CLASS, SOME = 6, 12
DELFT = Path(__file__).parents[3] / "shared" / "data" / "delft"


def records(clouds, footprints, most=None):
    """The written records of buildings: all of the footprints', or `most` of them drawn by chance."""
    points = [read_points(path) for path in clouds]
    xyz = np.concatenate([cloud.xyz[cloud.classification == BUILDING_CLASS] for cloud in points])
    asked = list(read_footprints(footprints))
    if most is not None:
        asked = [asked[k] for k in np.random.default_rng(0).permutation(len(asked))[:most]]
    own = points_of_footprints(xyz, asked)
    return [building_record(hiproof.reconstruct(xyz[i], f, settings=PLAIN)) for i, f in zip(own, asked, strict=True)]


def assert_planes_follow(record):
    for part in record["parts"]:
        if part["type"] == "free":  # has no parameters
            continue
        translation = np.array(part["T_L"])
        told = planes_of(part["type"], part["theta_p"], part["kappa"], translation)
        for piece in part["pieces"]:
            xy = np.concatenate([np.array(ring) for ring in piece["outline"]])
            planes = np.array(piece["planes"])
            heights = (xy @ planes[:, :2].T + planes[:, 2]).min(axis=1)
            if part["type"] == "shed":  # a plane a tooth
                gaps = np.abs(xy @ told[:, :2].T + told[:, 2] - heights[:, None]).max(axis=0)
                assert gaps.min() < 1e-3
            else:
                assert (xy @ told[:, :2].T + told[:, 2]).min(axis=1) == pytest.approx(heights, abs=1e-3)


def test_planes_follow_from_the_parameters_of_the_demo():
    files = demo_files()
    found = records([files["cloud"]], files["footprints"])
    for record in found:
        assert_planes_follow(record)
    assert sum(part["type"] != "free" for record in found for part in record["parts"]) >= len(found)


@pytest.mark.skipif(not DELFT.is_dir(), reason="needs ../shared/data/delft")
def test_planes_follow_from_the_parameters_of_real_roofs():
    for record in records(sorted(DELFT.glob("*.laz")), DELFT / "footprints.gpkg", SOME):
        assert_planes_follow(record)
