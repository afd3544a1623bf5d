"""`--lods 2.3`: roofs that reach beyond their walls, in every file, built again."""

import json

import numpy as np
import pytest
import shapely

import hiproof
from gable_at_corner import CORNER, FOOTPRINT, LevelSite, gable_height
from hiproof.cli.convert import convert_models
from hiproof.compose import check_solid
from hiproof.errors import InputError
from hiproof.geometry.outline_edges import list_outline_edges
from hiproof.model import CEILING, GROUND
from hiproof.settings import Settings
from hiproof.write.building_attributes import building_attributes, measure_figures
from hiproof.write.meshes.stl import STL_TRIANGLE
from hiproof.write.parameters import building_record
from written_run import list_faults, write_run

EAVES_M, GABLES_M, THICKNESS_M = 0.6, 0.4, 0.2


def make_settings(**reconstruct):
    values = {"segment": {"network": "never"}, "reconstruct": reconstruct}
    return Settings.from_dict(values | {"write": {"lods": ["2.2", "2.3"]}})


def scan(eaves=EAVES_M, gables=GABLES_M, density=8.0):
    """Points of a gable of 12 by 8 m whose roof reaches beyond its walls, and of ground around."""
    rng = np.random.default_rng(100)
    xy = rng.uniform((-3, -3), (15, 11), (round(18 * 14 * density), 2))
    z = gable_height(xy)
    is_roof = (np.abs(xy - [6, 4]) <= [6 + gables, 4 + eaves]).all(axis=1)
    z = np.where(is_roof, z, -1.0) + rng.normal(0, 0.03, len(xy))
    return np.column_stack([xy + CORNER, z])


def reconstruct(id="house", footprint=FOOTPRINT, neighbours=(), settings=None, **scanned):
    settings = make_settings() if settings is None else settings
    points = scan(**scanned)
    return hiproof.reconstruct(points, footprint, LevelSite(), settings, id, neighbours=neighbours)


def measure_sides(house):
    """Overhangs at the eaves and at the gable ends, shortest and longest."""
    edges = list_outline_edges(house.roof.outline)
    lengths = np.zeros(len(edges.starts))
    for overhang in house.model.eaves.overhangs:
        lengths[overhang.edge] = overhang.length
    is_eave = np.abs(edges.normals[:, 1]) > 0.5
    return [sorted(lengths[side].tolist()) for side in (is_eave, ~is_eave)]


@pytest.mark.parametrize("density", [8.0, 2.0])
def test_a_gable_reaches_beyond_its_walls_as_its_points_do(density):
    house = reconstruct(density=density)
    eaves, gables = measure_sides(house)
    assert eaves[0] == eaves[1] == pytest.approx(EAVES_M, abs=0.1)
    assert gables[0] == gables[1] == pytest.approx(GABLES_M, abs=0.1)
    assert all(0.0 < overhang.sigma < 0.15 for overhang in house.model.eaves.overhangs)


def test_its_solid_has_a_slab_of_roof_beyond_the_walls():
    house = reconstruct()
    solid, (eaves, gables) = house.model.finest_solid, measure_sides(house)
    assert check_solid(solid) == ()
    beyond = (12 + 2 * gables[0]) * (8 + 2 * eaves[0]) - 12 * 8
    assert solid.volume == pytest.approx(house.volume + THICKNESS_M * beyond, abs=0.05)
    assert len(solid.select_faces(CEILING)) == 2
    (ground,) = solid.select_faces(GROUND)
    assert solid.project_face(ground).area == pytest.approx(12 * 8, abs=0.01)
    attributes = building_attributes(house, measure_figures(house))
    assert attributes["hiproof_volume_lod23"] == pytest.approx(solid.volume)
    assert attributes["rf_volume_lod22"] == pytest.approx(house.volume)


def test_the_roof_is_the_same_without_overhangs():
    plain = reconstruct(settings=Settings.from_dict({"segment": {"network": "never"}}))
    house = reconstruct()
    record = building_record(house)
    assert len(record.pop("overhangs")) == 4 and record.pop("roof_thickness") == THICKNESS_M
    assert record.pop("footprint_kind") == "walls"
    assert record == building_record(plain)
    assert np.array_equal(house.solid.vertices, plain.solid.vertices)
    assert "hiproof_volume_lod23" not in building_attributes(plain)


def test_a_house_whose_points_end_at_its_walls_has_none():
    house = reconstruct(eaves=0.0, gables=0.0)
    assert house.model.eaves.overhangs == () and house.model.finest_solid is house.solid


def test_overhangs_do_not_cross_a_party_line():
    neighbour = shapely.box(*(CORNER + [12, 0]), *(CORNER + [20, 8]))
    eaves, gables = measure_sides(reconstruct(neighbours=[neighbour]))
    assert eaves[0] == eaves[1] > 0.5
    assert gables == [0.0, pytest.approx(GABLES_M, abs=0.1)]


def test_an_overhang_that_a_neighbour_blocks_is_named():
    roof = shapely.box(*(CORNER - [GABLES_M, EAVES_M]), *(CORNER + [12 + GABLES_M, 8 + EAVES_M]))
    neighbour = shapely.box(*(CORNER + [12 + GABLES_M, 0]), *(CORNER + [20, 8]))
    settings = make_settings(footprint_kind="roof", assumed_overhang_m=0.5)
    house = reconstruct(footprint=roof, settings=settings, neighbours=[neighbour])
    assert measure_sides(house) == [[0.5, 0.5], [0.0, 0.5]]
    remark = "its overhangs were left out along 9.2 m to the east (a neighbour stands there)"
    assert remark in house.detail


def test_walls_stand_within_a_footprint_of_the_roof():
    roof = shapely.box(*(CORNER - [GABLES_M, EAVES_M]), *(CORNER + [12 + GABLES_M, 8 + EAVES_M]))
    for kind in ("roof", "auto"):
        settings = make_settings(footprint_kind=kind, assumed_overhang_m=0.5)
        house = reconstruct(footprint=roof, settings=settings)
        assert measure_sides(house) == [[0.5, 0.5], [0.5, 0.5]]
        assert all(np.isnan(overhang.sigma) for overhang in house.model.eaves.overhangs)
        solid = house.model.finest_solid
        assert check_solid(solid) == () and solid.volume < house.volume
        (ground,) = solid.select_faces(GROUND)
        assert solid.project_face(ground).area == pytest.approx(11.8 * 8.2, abs=0.01)
    walls = reconstruct(settings=make_settings(footprint_kind="auto", assumed_overhang_m=0.5))
    assert walls.model.eaves.footprint_kind == "walls" and measure_sides(walls)[0][0] > 0.5


def test_every_file_is_valid_and_built_again(tmp_path):
    houses = [
        reconstruct("a"),
        reconstruct("b", settings=make_settings(walls="terrain")),
        reconstruct("c", eaves=0.0, gables=0.0),
    ]
    write = {"citygml": "both", "lods": ["0", "1.2", "2.2", "2.3"]}
    assert list_faults(tmp_path, houses, write) == []
    lines = (tmp_path / "buildings.city.jsonl").read_text().splitlines()[1:]
    for line, house in zip(lines, houses, strict=True):
        geometries = json.loads(line)["CityObjects"][house.id]["geometry"]
        assert [g["lod"] for g in geometries] == ["0", "0", "1.2", "2.2", "2.3"]
    assert ["OuterCeilingSurface" in line for line in lines] == [True, True, False]


def test_citygml_has_the_finest_solid(tmp_path):
    houses = [reconstruct("a"), reconstruct("c", eaves=0.0, gables=0.0)]
    write_run(tmp_path, houses, {"lods": ["2.2", "2.3"]})
    models = {b.id.removeprefix("bldg-"): b for b in hiproof.open_run(tmp_path / "buildings.gml")}
    for house in houses:
        volume = models[house.id].volume
        assert volume == pytest.approx(house.model.finest_solid.volume, rel=1e-4)


def measure_stl(path):
    """Volume (m3) that the triangles of an STL file enclose."""
    rows = np.frombuffer(path.read_bytes()[84:], STL_TRIANGLE)
    a, b, c = (rows["corners"][:, k].astype(float) for k in range(3))
    return (np.cross(a, b) * c).sum() / 6.0


@pytest.mark.parametrize("lods", [["2.2"], ["2.2", "2.3"]])
def test_meshes_have_overhangs_where_the_run_asked_for_them(tmp_path, lods):
    house = reconstruct("a")
    write_run(tmp_path, [house], {"lods": lods})
    convert_models(tmp_path, tmp_path / "town.stl", "stl", None, lambda *_: None)
    solid = house.model.finest_solid if "2.3" in lods else house.solid
    assert measure_stl(tmp_path / "town.stl") == pytest.approx(solid.volume, rel=1e-4)


@pytest.mark.parametrize("lods", [["2.3"], ["2.2", "2.3"]])
def test_building_parts_have_valid_files_too(tmp_path, lods):
    write = {"lods": lods, "parts_as": "buildingparts"}
    assert list_faults(tmp_path, [reconstruct("a")], write) == []


def test_files_without_the_level_are_as_they_were(tmp_path):
    plain = reconstruct(settings=Settings.from_dict({"segment": {"network": "never"}}))
    (tmp_path / "with").mkdir()
    (tmp_path / "without").mkdir()
    write_run(tmp_path / "without", [plain], {"lods": ["2.2"]})
    write_run(tmp_path / "with", [reconstruct()], {"lods": ["2.2"]})
    name = "buildings.city.jsonl"
    solids = [
        json.loads((tmp_path / folder / name).read_text().splitlines()[1])["CityObjects"]["house"][
            "geometry"
        ]
        for folder in ("with", "without")
    ]
    assert solids[0] == solids[1]


def test_an_edited_house_keeps_its_overhangs():
    house = reconstruct()
    raised = house.with_part(0, eave_height=4.9)
    assert raised.model.eaves.overhangs == house.model.eaves.overhangs
    assert check_solid(raised.model.finest_solid) == ()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"overhangs": [{"edge": 7, "length": 0.5}]}, "expected an edge from 0 to 3"),
        ({"overhangs": [{"edge": 0, "length": -1}]}, "expected a length over 0 m"),
        ({"overhangs": [{"edge": 0, "length": 0.5, "side": 1}]}, "got also side"),
        ({"roof_thickness": 0}, "expected a roof_thickness over 0 m"),
        ({"footprint_kind": "eaves"}, r"\(walls, roof\) as footprint_kind"),
    ],
)
def test_what_makes_no_overhang_is_one_sentence(change, reason):
    record = building_record(reconstruct()) | change
    with pytest.raises(InputError, match=reason):
        hiproof.build(record)
