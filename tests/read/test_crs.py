"""CRSs are compared in plan, named for CityGML and combined with heights."""

import pytest
from pyproj import CRS

from hiproof.errors import InputError
from hiproof.read.crs import combine, find_units, parse_crs, same_horizontal, vertical_crs
from hiproof.write.naming import srs_name


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
