"""CRSs are compared in plan, named for CityGML and combined with heights."""

import json
import warnings

import pytest
from pyproj import CRS
from pyproj.transformer import TransformerGroup

from hiproof.errors import InputError, InputWarning
from hiproof.read import read_footprints
from hiproof.read.crs import combine, find_units, parse_crs, same_horizontal, vertical_crs
from hiproof.read.crs.operations import Operation, find_operation, is_current
from hiproof.write.naming import srs_name
from tiny_town import write_footprints


@pytest.mark.parametrize(
    "first, second, is_same",
    [
        (7415, 28992, True),
        (28992, 28992, True),
        (28992, 25832, False),
        (4326, 4979, True),
        (7415, None, False),
    ],
)
def test_plan_decides_whether_two_are_the_same(first, second, is_same):
    assert same_horizontal(parse_crs(first), parse_crs(second)) is is_same
    assert same_horizontal(parse_crs(second), parse_crs(first)) is is_same


def test_wkt_without_a_code_is_recognised():
    bare = CRS.from_wkt(
        CRS.from_epsg(28992).to_wkt("WKT1_GDAL").replace(',AUTHORITY["EPSG","28992"]', "")
    )
    assert same_horizontal(bare, parse_crs(7415))


def test_combining_keeps_heights_that_are_there():
    assert vertical_crs(combine(parse_crs(28992), parse_crs(5709))).to_epsg() == 5709
    assert combine(parse_crs(7415), parse_crs(5773)).to_epsg() == 7415
    assert combine(parse_crs(28992), None).to_epsg() == 28992
    assert combine(None, parse_crs(5709)) is None


def test_nothing_is_called_nothing():
    assert srs_name(None) is None and parse_crs(None) is None and parse_crs("  ") is None
    assert srs_name(CRS.from_proj4("+proj=tmerc +lon_0=9.3 +x_0=1234 +datum=WGS84")) is None


@pytest.mark.parametrize("code", [4326, 4979, 4978, 6360])
def test_what_counts_in_no_length_in_plan_is_refused(code):
    with pytest.raises(InputError, match="expected the cloud in a"):
        find_units(CRS.from_epsg(code), "the cloud")


@pytest.mark.parametrize(
    ("crs", "plan", "height"),
    [
        ("EPSG:7415", 1.0, 1.0),
        ("EPSG:2263", 1200 / 3937, 1200 / 3937),
        ("EPSG:2263+5703", 1200 / 3937, 1.0),
        ("EPSG:2222+5703", 0.3048, 1.0),
        (CRS("EPSG:2222").to_3d(), 0.3048, 1.0),
        ("EPSG:26918+6360", 1.0, 1200 / 3937),
    ],
)
def test_units_are_those_of_the_axes(crs, plan, height):
    units = find_units(CRS(crs))
    assert (units.plan, units.height) == pytest.approx((plan, height), rel=1e-12)


def test_a_unit_that_contradicts_the_crs_is_refused():
    assert (
        find_units(None, unit_name="foot").plan
        == find_units(CRS("EPSG:2222"), unit_name="foot").plan
        == 0.3048
    )
    with pytest.raises(InputError, match="--unit"):
        find_units(CRS("EPSG:7415"), unit_name="foot")


def test_a_name_nobody_knows_is_refused():
    with pytest.raises(InputError, match='such as "EPSG:7415"'):
        parse_crs("the Dutch one")


LONDON = (530000.0, 180000.0)
OSTN15 = "uk_os_OSTN15_NTv2_OSGBtoETRS.tif"


def find(source, target, place):
    return find_operation("footprints.gpkg", CRS(source), CRS(target), place)


@pytest.fixture(autouse=True)
def without_grids():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if TransformerGroup("EPSG:27700", "EPSG:32630").best_available:
            pytest.skip("PROJ has the grids of Great Britain here, so nothing is missing")


def test_a_missing_grid_is_named_with_what_to_do():
    operation = find("EPSG:27700", "EPSG:32630", LONDON)
    assert operation.accuracy_m == 2.0 and "OSGB36 to WGS 84 (6)" in operation.name
    assert operation.missing_grids == (OSTN15,) and operation.missing_accuracy_m == 1.0
    assert operation.remark.startswith(
        "footprints.gpkg: transformed from EPSG:27700 (OSGB36 / British National Grid)"
    )
    assert f"projsync --file {OSTN15}" in operation.remark and "PROJ_NETWORK=ON" in operation.remark


def test_an_operation_of_unknown_accuracy_is_coarse():
    unknown = Operation("a", "EPSG:27700", "EPSG:32630", LONDON, "Ballpark geographic offset", None)
    assert unknown.is_coarse and "to an unknown accuracy" in unknown.remark


def test_an_accurate_operation_needs_no_remark():
    operation = find("EPSG:28992", "EPSG:25831", (85000.0, 447000.0))
    assert operation.accuracy_m == 0.25 and operation.remark == ""
    assert operation.missing_grids == ("nl_nsgi_rdtrans2018.tif",)
    assert find("EPSG:4258", "EPSG:25832", (9.0, 50.0)).accuracy_m == 0.0


def test_an_operation_survives_json_and_is_known_again():
    operation = find("EPSG:27700", "EPSG:32630", LONDON)
    loaded = Operation.from_dict(json.loads(json.dumps(operation.to_dict())))
    assert loaded == operation and is_current(loaded)
    assert not is_current(Operation(**{**operation.to_dict(), "name": "OSTN15", "accuracy_m": 1.0}))


def test_footprints_that_come_by_a_coarse_operation_are_remarked(tmp_path):
    import shapely

    x, y = LONDON
    path = write_footprints(
        tmp_path / "f.gpkg", {"a": shapely.box(x, y, x + 9, y + 8)}, crs="EPSG:27700"
    )
    with pytest.warns(InputWarning, match=OSTN15):
        read_footprints(path, target_crs="EPSG:32630")
