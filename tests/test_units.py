"""Laws of units: what is measured in feet gives the same buildings as in metres, and is written in
feet again.
"""

import json
import warnings

import numpy as np
import pyogrio
import pyproj
import pytest
import rasterio
import shapely
from lxml import etree

from hiproof import read_parameters
from hiproof.city.folder.ledger import Ledger
from hiproof.city.plan.prepare import make_plan
from hiproof.city.run import Request, reconstruct_area
from hiproof.errors import InputError, InputWarning
from hiproof.evaluate.models import read_models
from hiproof.evaluate.run import evaluate_run
from hiproof.frames import METRES, Units
from hiproof.parametric.finished import open_run
from hiproof.read import read_footprints, read_points, read_terrain
from hiproof.read.crs import find_units
from hiproof.read.models.solids import read_solids
from hiproof.settings import Settings
from hiproof.write.tables.postgis import database_rows
from layers import write_raster
from read.test_lax import write_lax
from read.test_pointcloud import write_copc
from tiny_town import ORIGIN, make_town, write_cloud, write_footprints

US_FOOT = 1200 / 3937
TOWN = make_town(houses=2)
FEET = find_units(pyproj.CRS("EPSG:2263"))
MIXED = find_units(pyproj.CRS("EPSG:2263+5703"))


def write_town_in(folder, units, cloud_crs, plan_crs):
    """The tiny town counted in other units, as a LAZ and a GeoPackage."""
    folder.mkdir()
    xyz, origin = units.from_metres(TOWN.xyz), units.from_metres(ORIGIN)
    cloud = write_cloud(folder / "cloud.laz", xyz, TOWN.classification, cloud_crs, origin)
    outlines = {
        id: shapely.transform(outline, units.from_metres) for id, outline in TOWN.footprints.items()
    }
    return str(cloud), str(write_footprints(folder / "footprints.gpkg", outlines, plan_crs))


def run(folder, units, cloud_crs, plan_crs, **options):
    cloud, footprints = write_town_in(folder, units, cloud_crs, plan_crs)
    summary = reconstruct_area(Request((cloud,), folder / "out", footprints, **options))
    assert summary.exit_code == 0
    return folder / "out"


def parameters(out):
    return read_parameters(out / "parameters.jsonl")


def attributes(out):
    return {model.id: model.attributes for model in read_models(out / "buildings.city.jsonl")}


def lengths(building):
    """Every length of the parts and heights of a building, in metres."""
    parts, first = building["parts"], building["parts"][0]
    sizes = [value for part in parts for value in part["parameters"].values()]
    heights = [*first["position"], building["z_ground"], *building["residuals"].values()]
    return np.array([*sizes, *heights], float)


def read_unit(**read):
    return {"settings": Settings.from_dict({"read": read})}


@pytest.fixture(scope="module")
def in_metres(tmp_path_factory):
    return run(tmp_path_factory.mktemp("units") / "metres", METRES, "EPSG:7415", "EPSG:28992")


@pytest.mark.parametrize("units", [METRES, FEET, MIXED])
def test_there_and_back_is_the_identity(units):
    xyz = np.random.default_rng(0).uniform(-1e6, 1e6, (50, 3))
    assert np.allclose(units.to_metres(units.from_metres(xyz)), xyz, rtol=1e-15)
    assert np.array_equal(units.to_metres(xyz)[:, :2], units.to_metres(xyz[:, :2]))
    assert np.array_equal(METRES.to_metres(xyz), xyz)


@pytest.mark.parametrize(
    ("units", "cloud_crs", "plan_crs", "options"),
    [
        (FEET, "EPSG:2263+6360", "EPSG:2263", {}),
        (FEET, "EPSG:2263", None, {}),
        (MIXED, "EPSG:2263+5703", "EPSG:2263", {}),
        (FEET, None, None, read_unit(unit="us-survey-foot")),
        (FEET, None, None, read_unit(crs="EPSG:2263+6360")),
        (FEET, None, "EPSG:2263", {}),
    ],
    ids=["compound", "plan only", "heights in metres", "--unit", "--crs", "CRS of the footprints"],
)
@pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning", "ignore:'crs' was not provided")
def test_feet_give_the_same_buildings_as_metres(
    in_metres, tmp_path, units, cloud_crs, plan_crs, options
):
    out = run(tmp_path / "feet", units, cloud_crs, plan_crs, **options)
    for first, in_m in zip(parameters(out), parameters(in_metres), strict=True):
        assert [first[key] for key in ("id", "type")] == [in_m[key] for key in ("id", "type")]
        assert len(first["parts"]) == len(in_m["parts"])
        assert np.abs(lengths(first) - lengths(in_m)).max() < 0.005
    in_feet, theirs = attributes(out), attributes(in_metres)
    for id, values in in_feet.items():
        for name in ("rf_volume_lod22", "rf_h_ground", "rf_h_roof_max", "rf_pt_density"):
            assert values[name] == pytest.approx(theirs[id][name], rel=2e-3)
        assert "US survey foot" in values["hiproof_units"] and "hiproof_units" not in theirs[id]
    record = json.loads((out / "run.json").read_text())["units"]
    known = (record["metres_in_plan_unit"], record["metres_in_height_unit"])
    assert known == pytest.approx((units.plan, units.height))


def extents(out):
    """Low and high corner (2, 3) of the coordinates as they stand in the CityJSON, in the CityGML
    and in the table of roof surfaces.
    """
    header = json.loads((out / "buildings.city.jsonl").read_text().splitlines()[0])
    root = etree.parse(out / "buildings.gml")
    corners = [node.text.split() for node in root.iter("{*}lowerCorner", "{*}upperCorner")]
    _, _, roofs, _ = pyogrio.raw.read(out / "buildings.gpkg", layer="roof_surfaces")
    places = shapely.get_coordinates(shapely.from_wkb(roofs), include_z=True)
    box = np.reshape(header["metadata"]["geographicalExtent"], (2, 3))
    return box, np.array(corners, float), np.array([places.min(axis=0), places.max(axis=0)])


def test_coordinates_are_written_in_the_unit_of_the_crs_that_the_file_names(in_metres, tmp_path):
    """A compound without a code of its own is named by its plan alone in CityJSON, any in tables:
    heights are then in the plan's unit.
    """
    in_feet = extents(run(tmp_path / "feet", MIXED, "EPSG:2263+5703", "EPSG:2263"))
    for units, ours, theirs in zip((FEET, MIXED, FEET), in_feet, extents(in_metres), strict=True):
        assert np.allclose(units.to_metres(ours), theirs, atol=0.02)


def areas_to_load(out):
    """Areas in m2 of the roof surfaces as they would go into PostGIS."""
    run = open_run(out)
    rows = [database_rows(sheet) for sheet in run.describe()]
    return [values["area_m2"] for row in rows for _, values in row.roof_surfaces]


def test_solids_in_feet_are_read_back_in_metres(in_metres, tmp_path):
    out = run(tmp_path / "feet", FEET, "EPSG:2263+6360", "EPSG:2263")
    for name in ("buildings.gml", "buildings.city.jsonl"):
        solids = read_solids(out / name), read_solids(in_metres / name)
        for (_, solid), (_, theirs) in zip(*solids, strict=True):
            sizes = (np.ptp(one.vertices, axis=0) for one in (solid, theirs))
            assert np.allclose(*sizes, atol=0.02)
    assert areas_to_load(out) == pytest.approx(areas_to_load(in_metres), rel=2e-3)
    cloud, footprints = tmp_path / "feet/cloud.laz", tmp_path / "feet/footprints.gpkg"
    for figures in evaluate_run(out, [str(cloud)], str(footprints)).figures:
        assert figures.quality.share_within_20cm > 0.95 and figures.quality.outline_iou > 0.99


def test_heights_taken_in_feet_for_want_of_a_name_are_remarked(tmp_path):
    cloud, footprints = write_town_in(tmp_path / "feet", FEET, "EPSG:2263", "EPSG:2263")
    request = Request((cloud,), tmp_path / "out", footprints)
    with pytest.warns(InputWarning, match=r"heights are taken in US survey foot, .* names none"):
        make_plan(request)


def test_clouds_of_another_crs_than_the_run_are_not_measured_against(in_metres, tmp_path):
    cloud = write_cloud(tmp_path / "feet.laz", TOWN.xyz, TOWN.classification, "EPSG:2263")
    sentence = r"EPSG:7415 .* in the run and EPSG:2263 .* in .*feet\.laz"
    with pytest.raises(InputError, match=sentence):
        evaluate_run(in_metres, [str(cloud)])


def test_a_unit_without_a_crs_is_known_again_by_evaluate(tmp_path):
    cloud, footprints = (str(tmp_path / "feet" / n) for n in ("cloud.laz", "footprints.gpkg"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        out = run(tmp_path / "feet", FEET, None, None, **read_unit(unit="us-survey-foot"))
        run_again = evaluate_run(out, [cloud], footprints)
    assert all(figures.quality.share_within_20cm > 0.95 for figures in run_again.figures)


def count_sorted(out):
    """How many points a run sorted."""
    tasks = Ledger(out / ".hiproof/ledger.sqlite").tasks()
    (sort,) = [task for task in tasks if task.kind == "sort"]
    return json.loads(sort.message)["points"]


def test_points_and_footprints_are_read_in_metres_and_say_what_they_were(tmp_path):
    cloud, footprints = write_town_in(tmp_path / "feet", MIXED, "EPSG:2263+5703", "EPSG:2263")
    points = read_points(cloud)
    assert np.abs(points.xyz - TOWN.xyz).max() < 1e-3 and points.units == MIXED
    inside = read_points(cloud, box=(85000, 446000, 85020.0005, 446020.0005))
    assert len(inside) == (TOWN.xyz[:, :2] <= (85020.0005, 446020.0005)).all(axis=1).sum()
    for got, true in zip(read_footprints(footprints), TOWN.footprints.values(), strict=True):
        assert shapely.normalize(got.polygon).equals_exact(shapely.normalize(true), 1e-6)


@pytest.mark.parametrize(
    ("crs", "unit", "expected"),
    [
        ("EPSG:2263", None, 10 * US_FOOT),
        ("EPSG:2263", "metre", 10.0),
        ("EPSG:2263", "ft", 3.048),
        (None, None, 10 * US_FOOT),
    ],
)
def test_a_terrain_model_in_feet_answers_in_metres(tmp_path, crs, unit, expected):
    path = write_raster(tmp_path / "dtm.tif", np.full((9, 9), 10.0), -45.0, 45.0, 10.0, crs)
    if unit:
        with rasterio.open(path, "r+") as file:
            file.units = (unit,)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        terrain = read_terrain(path, "EPSG:2263", FEET)
    # the raster ends 45 feet, not metres, from its middle
    inside, outside = [0.0, 0.0], [44 * 0.3048 + 5.0, 0.0]
    heights = terrain.height_at(np.array([inside, outside]))
    assert heights[0] == pytest.approx(expected) and np.isnan(heights[1])


def test_an_index_in_feet_is_asked_in_feet(tmp_path, monkeypatch, quick_tiles):
    """COPC and `.lax` save points, but none that a building needs."""
    monkeypatch.setattr("hiproof.city.work.sort.QUERY_M", 25.0)
    monkeypatch.setattr("hiproof.read.points.runs.RUN_POINTS", 50)
    along = np.argsort(TOWN.xyz[:, 0].round(-1), kind="stable")
    xyz, origin = FEET.from_metres(TOWN.xyz[along]), FEET.from_metres(ORIGIN)
    classes = TOWN.classification[along]
    single = {"house-0": shapely.transform(TOWN.footprints["house-0"], FEET.from_metres)}
    footprints = str(write_footprints(tmp_path / "alone.gpkg", single, "EPSG:2263"))
    plain, indexed = (tmp_path / name for name in ("plain.laz", "indexed.laz"))
    for path in (plain, indexed):
        write_cloud(path, xyz, classes, None, origin)
    write_lax(tmp_path / "indexed.lax", xyz)
    copc, rows, counts = write_copc(tmp_path / "cloud.copc.laz", xyz, classes), [], []
    for number, cloud in enumerate((plain, indexed, copc)):
        out = tmp_path / str(number)
        reconstruct_area(Request((str(cloud),), out, footprints, **read_unit(crs="EPSG:2263")))
        rows.append(parameters(out))
        counts.append(count_sorted(out))
    assert rows[0] == rows[1] and rows[0][0]["points"] == rows[2][0]["points"] > 100
    assert max(counts[1:]) < counts[0]


@pytest.mark.parametrize(
    ("first", "second"), [("EPSG:7415", "EPSG:25832"), ("EPSG:2263+6360", "EPSG:2263+5703")]
)
def test_clouds_of_two_reference_systems_are_refused(tmp_path, first, second):
    clouds = [
        str(write_cloud(tmp_path / name, TOWN.xyz, TOWN.classification, crs))
        for name, crs in (("a.laz", first), ("b.laz", second))
    ]
    with pytest.raises(InputError, match=r"in one CRS, got .* in .*a\.laz and .* in .*b\.laz"):
        reconstruct_area(Request(tuple(clouds), tmp_path / "out"))
    with pytest.raises(InputError, match="in one CRS"):
        read_points(*clouds)


def test_a_cloud_that_names_no_crs_goes_with_one_that_does_and_says_so(tmp_path):
    clouds = [
        write_cloud(tmp_path / name, TOWN.xyz, TOWN.classification, crs)
        for name, crs in (("a.laz", None), ("b.laz", "EPSG:7415"))
    ]
    with pytest.warns(InputWarning, match=r"a\.laz: names no CRS; taken in EPSG:7415"):
        assert read_points(*clouds).crs == pyproj.CRS("EPSG:7415")


def test_a_unit_that_is_not_the_crs_is_refused(tmp_path):
    cloud = write_cloud(tmp_path / "a.laz", TOWN.xyz, TOWN.classification)
    settings = Settings.from_dict({"read": {"unit": "foot"}})
    with pytest.raises(InputError, match="--unit"):
        reconstruct_area(Request((str(cloud),), tmp_path / "out", settings=settings))


def test_units_have_names():
    assert str(METRES) == "metre"
    assert str(Units(0.3048, 1.0, "foot", "metre")) == "foot, heights in metre"


def test_a_run_says_that_a_clouds_heights_come_in_coarse_steps(tmp_path):
    path, z = tmp_path / "cloud.xyzc", np.rint(TOWN.xyz[:, 2] * 10) / 10
    rows = np.column_stack([TOWN.xyz[:, :2], z, TOWN.classification])
    np.savetxt(path, rows, "%.3f", header="x y z classification")
    footprints = write_footprints(tmp_path / "footprints.gpkg", TOWN.footprints)
    remark = r"cloud\.xyzc: coordinates come in steps of 0\.1 m in height, and roofs"
    with pytest.warns(InputWarning, match=remark):
        make_plan(Request((str(path),), tmp_path / "out", str(footprints)))


@pytest.mark.parametrize("up", [0.0, 43.0])
def test_files_side_by_side_whose_heights_never_meet_are_told(up, tmp_path):
    """As where one tile has heights over the ellipsoid: a house on the border is 43 m tall."""
    town = make_town(houses=2, density=6.0)
    is_east = town.xyz[:, 0] > ORIGIN[0] + 44
    town.xyz[is_east, 2] += up
    clouds = tuple(
        str(write_cloud(tmp_path / f"{name}.laz", town.xyz[part], town.classification[part]))
        for name, part in (("west", ~is_east), ("east", is_east))
    )
    outlines = str(write_footprints(tmp_path / "outlines.geojson", town.footprints))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        reconstruct_area(Request(clouds, tmp_path / "out", outlines))
    texts = [text for w in caught if "west.laz" in (text := str(w.message))]
    assert len(texts) == bool(up)
    assert all("east.laz: its ground lies 43.0" in text for text in texts)
