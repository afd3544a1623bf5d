"""What is written of a building is the building: roof and solid follow from the written object to the last digit."""

import json
from pathlib import Path

import numpy as np
import pytest

import hiproof
from hiproof.read import read_footprints, read_points
from hiproof.read.assign import points_of_footprints
from hiproof.settings import Settings
from hiproof.write.parameters import building_record, parameters_line

PLAIN = Settings.from_dict({"segment": {"enabled": False}})
BUILDING_CLASS, SOME = 6, 12
DELFT = Path(__file__).parents[3] / "shared" / "data" / "delft"


def buildings(clouds, footprints, most):
    """The models of `most` of the footprints, drawn by chance."""
    points = [read_points(path) for path in clouds]
    xyz = np.concatenate([cloud.xyz[cloud.classification == BUILDING_CLASS] for cloud in points])
    asked = list(read_footprints(footprints))
    asked = [asked[k] for k in np.random.default_rng(0).permutation(len(asked))[:most]]
    own = points_of_footprints(xyz, asked)
    return [hiproof.reconstruct(xyz[i], f, settings=PLAIN) for i, f in zip(own, asked, strict=True)]


def assert_follows(building):
    again = hiproof.build(json.loads(parameters_line(building)))
    assert building_record(again) == building_record(building)
    assert np.array_equal(again.solid.vertices, building.solid.vertices)
    assert again.solid.faces == building.solid.faces
    for piece, told in zip(building.roof.pieces, again.roof.pieces, strict=True):
        assert np.array_equal(piece.planes, told.planes)


@pytest.mark.skipif(not DELFT.is_dir(), reason="needs ../shared/data/delft")
def test_real_buildings_follow_from_what_is_written():
    for building in buildings(sorted(DELFT.glob("*.laz")), DELFT / "footprints.gpkg", SOME):
        assert_follows(building)
