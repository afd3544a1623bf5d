"""Generated roofs of every type through composing, writing and reading: what a user opens is what
was modelled.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from benchmarks.campaign_scenes import SceneSettings, place_building
from lxml import etree

import hiproof
from hiproof import method, read_parameters
from hiproof.compose import check_solid, compose
from hiproof.evaluate.models import read_models
from hiproof.geometry.point_grid import PointGrid
from hiproof.model import Building, Model, Quality, Solid
from hiproof.primitives import CATALOGUE
from hiproof.read import read_footprints, read_points
from hiproof.settings import Settings
from hiproof.simulate import COMPOUND_KINDS, ROOF_TYPES, SOURCES, random_building, random_compound
from hiproof.status import Status
from hiproof.write import roof_figures
from hiproof.write.citygml.version2 import NAMESPACES
from hiproof.write.parameters import building_record, parameters_line
from written_run import write_all


def generate_buildings(seed):
    """A building of each type and of each kind of compound, in world coordinates, as reconstruction
    would give them.
    """
    rng = np.random.default_rng(seed)
    building = {type: random_building(rng, type) for type in ROOF_TYPES}
    building |= {kind: random_compound(rng, kind) for kind in COMPOUND_KINDS}
    for number, (name, sim) in enumerate(building.items()):
        origin = sim.roof.frame.origin
        solid = compose(sim.roof, 0.0).move(origin)
        quality = Quality(points=100 + number, density=4.0, rmse=0.05)
        yield Building(
            name,
            Status.MODELLED,
            "",
            Model(sim.roof, solid),
            quality,
            float(origin[2]),
            "simulated",
        )


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    buildings = list(generate_buildings(7))
    assert write_all(folder, iter(buildings), "EPSG:7415") == []
    return folder, buildings


def test_solids_read_back_are_valid_and_the_same(run):
    folder, buildings = run
    for model, building in zip(
        read_models(folder / "buildings.city.jsonl"), buildings, strict=True
    ):
        assert model.id == building.id
        local = Solid(model.solid.vertices - building.roof.frame.origin, model.solid.faces)
        assert check_solid(local) == ()
        assert [face.kind for face in model.solid.faces] == [
            face.kind for face in building.solid.faces
        ]
        assert local.volume == pytest.approx(
            model.attributes["rf_volume_lod22"], rel=1e-3, abs=0.01
        )


def test_figures_agree_with_the_roof(run):
    _, buildings = run
    for building in buildings:
        figures = roof_figures(building.solid)
        rng = np.random.default_rng(0)
        low_x, low_y, high_x, high_y = building.roof.outline.bounds
        z = building.roof.height_at(rng.uniform((low_x, low_y), (high_x, high_y), (20000, 2)))
        z = z[np.isfinite(z)] + building.roof.frame.origin[2]
        got, want = [figures.h_50p, figures.h_70p], np.percentile(z, [50, 70])
        # A step in the roof may lie just at the percentile, where a sample cannot tell on which
        # side.
        percentiles = np.percentile(z, [[48, 68], [52, 72]])
        assert ((percentiles[0] - 0.05 <= got) & (got <= percentiles[1] + 0.05)).all(), (
            building.id,
            got,
            want,
        )
        assert figures.h_max == pytest.approx(z.max(), abs=0.15)
        assert figures.plan_area_m2 == pytest.approx(building.roof.outline.area, rel=1e-3)


def test_roof_type_and_parameters(run):
    folder, buildings = run
    root = etree.parse(folder / "buildings.gml")
    for record, building in zip(
        read_parameters(folder / "parameters.jsonl"), buildings, strict=True
    ):
        assert record["type"] == building.type
        assert [part["type"] for part in record["parts"]] == [part.type for part in building.parts]
        for part, stored in zip(building.parts, record["parts"], strict=True):
            assert stored["parameters"] == pytest.approx(part.parameters, abs=1e-6)
        (code,) = root.xpath(
            f"//bldg:Building[gml:name='{building.id}']/bldg:roofType/text()", namespaces=NAMESPACES
        )
        codes = {CATALOGUE[part.type].citygml_code for part in building.parts}
        assert code == (codes.pop() if len(codes) == 1 else "1130")


def test_both_formats_hold_the_same_corners(run):
    folder, _ = run
    root = etree.parse(folder / "buildings.gml")
    lines = [
        json.loads(line) for line in (folder / "buildings.city.jsonl").read_text().splitlines()
    ]
    transform = lines[0]["transform"]
    for building, feature in zip(root.iterfind(".//{*}Building"), lines[1:], strict=True):
        rings = [
            np.array(p.text.split(), float).reshape(-1, 3)
            for p in building.iterfind(".//{*}LinearRing/{*}posList")
        ]
        corners_here = {
            tuple(np.rint(corner * 1e4).astype(int)) for ring in rings for corner in ring
        }
        xyz = np.array(feature["vertices"]) * transform["scale"] + transform["translate"]
        assert corners_here == {tuple(corner) for corner in np.rint(xyz * 1e4).astype(int)}


def test_order_does_not_matter(run, tmp_path):
    folder, buildings = run
    write_all(tmp_path, buildings[::-1], "EPSG:7415")
    lines = [(f / "buildings.city.jsonl").read_text().splitlines()[1:] for f in (folder, tmp_path)]
    assert lines[0] == lines[1][::-1]


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


@pytest.mark.parametrize(("density", "with_footprint"), [(0.5, True), (2.0, False)])
def test_simulated_buildings_of_all_kinds_follow_from_what_is_written(density, with_footprint):
    """A run reads its own file: of 48 buildings, damaged and sparse ones among them."""
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
