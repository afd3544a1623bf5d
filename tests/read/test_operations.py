"""Which operation PROJ uses, how accurate it is, and which grid is missing: said where it may cost
a metre.
"""

import json
import warnings

import pytest
from pyproj import CRS
from pyproj.transformer import TransformerGroup

from hiproof.errors import InputWarning
from hiproof.read import read_footprints
from hiproof.read.crs.operations import Operation, find_operation, is_current
from tiny_town import write_footprints

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
