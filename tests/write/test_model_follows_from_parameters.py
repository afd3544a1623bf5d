"""What is written of a building is the building: roof and solid follow from the written object to
the last digit.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from benchmarks.campaign_scenes import SceneSettings, place_building

import hiproof
from hiproof import method
from hiproof.geometry.point_grid import PointGrid
from hiproof.read import read_footprints, read_points
from hiproof.settings import Settings
from hiproof.simulate import SOURCES
from hiproof.status import Status
from hiproof.write.parameters import building_record, parameters_line

PLAIN = Settings.from_dict({"segment": {"network": "never"}})
BUILDING_CLASS, SOME = 6, 12
SIMULATED = 12  # buildings of each kind of scene
DELFT = Path(__file__).parents[3] / "shared" / "data" / "delft"
GROUND, TREE = SOURCES.index("ground"), SOURCES.index("tree")


def buildings(clouds, footprints, limit):
    """The models of `most` of the footprints, drawn by chance."""
    points = [read_points(path) for path in clouds]
    xyz = np.concatenate([cloud.xyz[cloud.classification == BUILDING_CLASS] for cloud in points])
    footprints_read = list(read_footprints(footprints))
    footprints_read = [
        footprints_read[k]
        for k in np.random.default_rng(0).permutation(len(footprints_read))[:limit]
    ]
    grid = PointGrid(xyz)
    return [
        hiproof.reconstruct(xyz[grid.inside(f.polygon)], f, settings=PLAIN) for f in footprints_read
    ]


def assert_follows(building):
    rebuilt = hiproof.build(json.loads(parameters_line(building)))
    assert building_record(rebuilt) == building_record(building)
    assert np.array_equal(rebuilt.solid.vertices, building.solid.vertices)
    assert rebuilt.solid.faces == building.solid.faces
    for piece, rebuilt_piece in zip(building.roof.pieces, rebuilt.roof.pieces, strict=True):
        assert np.array_equal(piece.planes, rebuilt_piece.planes)


@pytest.mark.skipif(not DELFT.is_dir(), reason="needs ../shared/data/delft")
def test_real_buildings_follow_from_what_is_written():
    for building in buildings(sorted(DELFT.glob("*.laz")), DELFT / "footprints.gpkg", SOME):
        assert_follows(building)


@pytest.mark.parametrize("with_footprint", [True, False])
@pytest.mark.parametrize("density", [0.5, 1.0, 2.0, 5.0])
def test_simulated_buildings_of_all_kinds_follow_from_what_is_written(density, with_footprint):
    """A run reads its own file: of 96 buildings, damaged and sparse ones among them."""
    scene, modelled = SceneSettings(density, True, with_footprint, damage=0.3), 0
    for number in range(1, SIMULATED + 1):
        placed = place_building(int(10 * density), number, scene)
        points = placed.points[(placed.source != GROUND) & (placed.source != TREE)]
        footprint = placed.footprint if with_footprint else None
        building = hiproof.reconstruct(points, footprint, settings=PLAIN, id=placed.id)
        assert building.status is not Status.SIMPLIFIED
        if building.built is None:
            assert hiproof.build(json.loads(parameters_line(building))).status is building.status
        else:
            assert_follows(building)
            modelled += 1
    assert modelled >= 0.8 * SIMULATED


@pytest.mark.parametrize("wrong", [{"width": -131.0}, {"pitch_front": -12.0}, {"length": 0.0}])
def test_a_part_that_no_file_can_hold_is_given_up_alone_and_the_building_says_so(
    wrong, monkeypatch
):
    """Whatever a fit comes to, what is written can be read."""
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(0.2, 12, 0.4), np.arange(0.2, 7, 0.4)))
    points = np.column_stack([x, y, np.where(x < 8, 8 - 0.9 * abs(y - 3.5), 3.0)])
    original = method.fit

    def fit_wrongly(*args):
        fitted = original(*args)
        (gable,) = (part for part in fitted.parts if part.type == "gable")
        sizes = {name: gable.parameters[name] for name in ("width", "length")}
        sided = {"pitch_front": 42.0, "eave_front": 0.0, "pitch_back": 42.0, "eave_back": 0.0}
        other_parts = tuple(part for part in fitted.parts if part is not gable)
        return replace(
            fitted, parts=(*other_parts, replace(gable, parameters=sizes | sided | wrong))
        )

    monkeypatch.setattr(method, "fit", fit_wrongly)
    building = hiproof.reconstruct(points, shapely.box(0, 0, 12, 7), settings=PLAIN)
    assert building.status is Status.SIMPLIFIED
    assert "part 2 (gable) was" in building.detail
    assert building.parts[0].type == "flat"
    assert_follows(building)
