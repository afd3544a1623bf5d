"""Laws of `--out-crs`: coordinates come back, walls stay upright, solids valid, and all files agree
on where a building stands.
"""

import json
import warnings

import numpy as np
import pyogrio
import pytest
import shapely
from lxml import etree

from hiproof.city.plan.prepare import warn_files_elsewhere
from hiproof.city.plan.work_plan import make_jobs
from hiproof.city.run import Request, reconstruct_area
from hiproof.cli.convert import convert
from hiproof.compose import compose
from hiproof.errors import InputError
from hiproof.evaluate.models import read_models
from hiproof.evaluate.run import evaluate_run
from hiproof.frames import METRES
from hiproof.model import WALL, Building, Footprint, Model
from hiproof.parametric.run import build_file
from hiproof.read.crs import find_units, parse_crs
from hiproof.settings import Settings, WriteSettings
from hiproof.simulate import COMPOUND_KINDS, random_compound
from hiproof.status import Status
from hiproof.write import write_cityjson
from hiproof.write.building_attributes import building_attributes
from hiproof.write.naming import FileUnits
from hiproof.write.reprojected import choose_file_crs
from tiny_town import make_town, write_cloud, write_footprints

DELFT = (85000.0, 446000.0, 2.0)
NEW_YORK = (300000.0, 60000.0, 12.0)
PARIS = (652000.0, 6862000.0, 35.0)
WAYS = {
    "national grid to UTM": ("EPSG:7415", "EPSG:25831", DELFT),
    "to the next UTM zone": ("EPSG:7415", "EPSG:25832", DELFT),
    "to the map of the web": ("EPSG:7415", "EPSG:3857", DELFT),
    "cone to cylinder": ("EPSG:2154+5720", "EPSG:25831", PARIS),
    "metres to feet, heights too": ("EPSG:32118+5703", "EPSG:2263+6360", NEW_YORK),
    "metres to feet, heights stay": ("EPSG:32118+5703", "EPSG:2263", NEW_YORK),
}


def buildings_at(origin):
    for seed, kind in enumerate(COMPOUND_KINDS):
        sim = random_compound(np.random.default_rng(seed), kind, origin=origin)
        solid = compose(sim.roof, 0.0).move(sim.roof.frame.origin)
        yield Building(kind, Status.MODELLED, built=Model(sim.roof, solid), z_ground=origin[2])


@pytest.mark.parametrize("way", WAYS)
def test_coordinates_come_back_within_a_millimetre(way):
    crs, out, origin = WAYS[way]
    spread = np.random.default_rng(0).uniform((-5e3, -5e3, -3), (5e3, 5e3, 90), (500, 3))
    places, files = np.array(origin) + spread, FileUnits.of(crs, out_crs=out)
    for units in (files.gml, files.cityjson):
        places_back = units.from_metres(places)
        assert np.abs(units.to_metres(places_back) - places).max() < 1e-3
        assert np.abs(places_back[:, :2] - places[:, :2]).max() > 100.0
        # a plan goes as a place does
        assert np.array_equal(units.from_metres(places[:, :2]), places_back[:, :2])
        assert units.from_metres(places[0]) == pytest.approx(places_back[0])
        assert units.height * places_back[:, 2] == pytest.approx(places[:, 2], abs=1e-3)


@pytest.mark.parametrize("way", WAYS)
def test_solids_stay_valid_and_their_walls_upright(way):
    crs, out, origin = WAYS[way]
    units = FileUnits.of(crs, out_crs=out).gml
    for building in buildings_at(origin):
        assert building_attributes(building, units=units)["hiproof_iso19107_lod22"] == "[]"
        old, new = building.solid.vertices, units.from_metres(building.solid.vertices)
        for face in building.solid.select_faces(WALL):
            ring = list(face.rings[0])
            assert len(np.unique(new[ring, :2], axis=0)) == len(np.unique(old[ring, :2], axis=0))


def test_a_solid_that_breaks_on_the_way_says_so():
    (building, *_) = buildings_at(DELFT)
    squeezed = FileUnits.of("EPSG:7415", out_crs="EPSG:25831").gml

    class Squeezed(type(squeezed)):
        def from_metres(self, world):
            return np.round(super().from_metres(world) / 4.0) * 4.0

    units = Squeezed(**vars(squeezed))
    assert json.loads(building_attributes(building, units=units)["hiproof_iso19107_lod22"])


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    """A run of two houses as its clouds are, and one in another CRS."""
    folder, town = tmp_path_factory.mktemp("town"), make_town(houses=2)
    cloud = str(write_cloud(folder / "cloud.laz", town.xyz, town.classification, "EPSG:7415"))
    footprints = str(write_footprints(folder / "footprints.gpkg", town.footprints, "EPSG:28992"))
    for name, out_crs in (("here", ""), ("there", "EPSG:25831")):
        write = {"out_crs": out_crs, "lods": ["0", "2.2"], "citygml": "both"}
        settings = Settings.from_dict({"write": write})
        request = Request((cloud,), folder / name, footprints, settings=settings)
        assert reconstruct_area(request).exit_code == 0
    return folder


def gml_places(path):
    """All places (n, 3) of a GML file, and the CRS it names."""
    root = etree.parse(path)
    text = " ".join(node.text for node in root.iter("{*}posList"))
    places = np.array(text.split(), float).reshape(-1, 3)
    return places, next(root.iter("{*}Envelope")).get("srsName")


def test_all_files_stand_in_the_same_place(town):
    units = FileUnits.of("EPSG:7415", out_crs="EPSG:25831")

    def assert_near(back, places):
        assert np.abs(back - places).max() < 1e-3

    for name in ("buildings.gml", "buildings.citygml3.gml"):
        (here, _), (there, crs) = (gml_places(town / run / name) for run in ("here", "there"))
        assert_near(units.gml.to_metres(there), here)
        assert crs == "urn:ogc:def:crs,crs:EPSG::25831,crs:EPSG::5709"
    runs = [list(read_models(town / run / "buildings.city.jsonl")) for run in ("here", "there")]
    for item, other in zip(*runs, strict=True):
        assert_near(units.cityjson.to_metres(other.solid.vertices), item.solid.vertices)
        assert item.solid.faces == other.solid.faces
    for layer in ("buildings", "parts", "roof_surfaces"):
        tables = [read_table(town / run / "buildings.gpkg", layer) for run in ("here", "there")]
        assert_near(units.gml.to_metres(tables[1][1]), tables[0][1])
        assert tables[1][0] == "EPSG:25831"


def read_table(path, layer):
    """The CRS of a layer and all its coordinates, with heights where it has them."""
    meta, _, wkb, _ = pyogrio.raw.read(path, layer=layer)
    shapes = shapely.from_wkb(wkb)
    return meta["crs"], shapely.get_coordinates(shapes, include_z=layer == "roof_surfaces")


def test_parameters_stay_in_the_clouds_crs_and_build_the_same_bytes(town, tmp_path):
    first, second = (town / run / "parameters.jsonl" for run in ("here", "there"))
    assert first.read_bytes().split(b"\n")[1:] == second.read_bytes().split(b"\n")[1:]
    build_file(second, tmp_path / "again")
    build_file(first, tmp_path / "moved", changes={"write": {"out_crs": "EPSG:25831"}})
    models = ("buildings.gml", "buildings.city.jsonl")
    all_files = (*models, "buildings.citygml3.gml", "parameters.jsonl")
    for folder, names in (("again", all_files), ("moved", models)):
        for name in names:
            there = (town / "there" / name).read_bytes()
            assert (tmp_path / folder / name).read_bytes() == there, name


def test_models_elsewhere_are_judged_where_their_points_are(town):
    cloud = str(town / "cloud.laz")
    runs = (evaluate_run(town / run, [cloud]).figures for run in ("here", "there"))
    for first, second in zip(*runs, strict=True):
        assert second.quality.rmse == pytest.approx(first.quality.rmse, abs=1e-4)
        assert first.quality.points > 50


def test_what_is_converted_stands_where_the_models_do(town, tmp_path):
    convert(town / "there", tmp_path / "a.obj")
    convert(town / "there" / "buildings.city.jsonl", tmp_path / "b.obj")
    first, second = ((tmp_path / name).read_text().splitlines() for name in ("a.obj", "b.obj"))
    assert "COMPOUNDCRS" in first[1] and "UTM zone 31N" in first[1]
    assert first[0] == second[0]
    vertices = (
        [line.split()[1:] for line in lines if line[:2] == "v "] for lines in (first, second)
    )
    corners, again = (np.array(rows, float) for rows in vertices)
    for extreme in (np.min, np.max):
        np.testing.assert_allclose(extreme(again, axis=0), extreme(corners, axis=0), atol=2e-4)


def test_the_same_crs_is_no_other(tmp_path):
    assert FileUnits.of("EPSG:7415", out_crs="EPSG:28992") == FileUnits.of("EPSG:7415")
    houses = list(buildings_at(DELFT))
    for name, write in (("a", None), ("b", WriteSettings(out_crs="EPSG:7415"))):
        write_cityjson(tmp_path / f"{name}.city.jsonl", houses, "EPSG:7415", write=write)
    assert (tmp_path / "a.city.jsonl").read_bytes() == (tmp_path / "b.city.jsonl").read_bytes()


@pytest.mark.parametrize(
    "crs, out, sentence",
    [
        ("EPSG:7415", "EPSG:4326", "a projected CRS for --out-crs, got EPSG:4326"),
        ("EPSG:7415", "EPSG:5709", "a projected CRS for --out-crs"),
        ("EPSG:7415", "EPSG:25831+7837", "heights that pyproj can take"),
        ("EPSG:28992", "EPSG:7415", "the clouds' names none"),
        (None, "EPSG:25831", "a CRS of the clouds"),
        ("EPSG:7415", "Atlantis", "a coordinate reference system"),
    ],
)
def test_where_nothing_can_be_written_one_sentence_says_so(crs, out, sentence):
    with pytest.raises(InputError, match=sentence):
        FileUnits.of(crs, find_units(parse_crs(crs)) if crs else METRES, out)


def test_a_projection_of_another_place_is_doubted():
    (job,) = make_jobs((Footprint("house", shapely.box(85000, 446000, 85010, 446010)),))
    for out, is_told in (("EPSG:25835", True), ("EPSG:25832", False)):
        units = FileUnits.of("EPSG:7415", out_crs=out)
        with warnings.catch_warnings(record=True) as remarks:
            warnings.simplefilter("always")
            warn_files_elsewhere((job,), choose_file_crs("EPSG:7415", out), units)
        assert [str(w.message).count("4.4 E 52.0 N, far from") for w in remarks] == [1] * is_told
