"""What a run says of inputs that fit one another badly: heights of two kinds, a terrain elsewhere, a CRS whose metres are none."""

import numpy as np
import pyproj
import pytest
import rasterio
from rasterio.transform import from_origin

from hiproof import read_parameters
from hiproof.city.prepare import make_plan
from hiproof.city.run import Request, reconstruct_area
from hiproof.cli.running import print_summary
from hiproof.errors import InputWarning
from hiproof.read.overlap import stretch
from hiproof.status import Doubt
from tiny_town import ORIGIN, make_town, write_cloud, write_footprints, write_town

TOWN = make_town(houses=1)


def write_terrain(path, height, east=0.0):
    """A level terrain model around the town, or so far east of it."""
    options = {"driver": "GTiff", "width": 80, "height": 80, "count": 1, "dtype": "float32", "crs": "EPSG:28992"}
    transform = from_origin(ORIGIN[0] - 20 + east, ORIGIN[1] + 60, 1.0, 1.0)
    with rasterio.open(path, "w", transform=transform, **options) as file:
        file.write(np.full((1, 80, 80), height, "float32"))
    return str(path)


def detail_over(folder, height):
    """What is said of the only building over a terrain model of that height."""
    cloud, footprints = write_town(folder, TOWN)
    terrain = write_terrain(folder / "dtm.tif", height)
    reconstruct_area(Request((str(cloud),), folder / "out", str(footprints), terrain))
    (row,) = read_parameters(folder / "out" / "parameters.jsonl")
    return row["detail"]


@pytest.mark.parametrize(
    ("height", "told"),
    [
        (ORIGIN[2], ()),
        (
            ORIGIN[2] - 43.0,
            (
                "terrain model dtm.tif lies 43.",
                "m below the ground points around it",
            ),
        ),
        (
            ORIGIN[2] + 9.0,
            ("m above the ground points around it", "the ground (terrain model dtm.tif) lies 3.9 m above its eaves"),
        ),
    ],
)
def test_a_terrain_whose_heights_are_others_is_told_of(tmp_path, height, told):
    detail = detail_over(tmp_path, height)
    assert all(words in detail for words in told)
    assert bool(told) == ("lies" in detail)


def test_a_terrain_on_which_no_building_stands_is_told_of(tmp_path, recwarn):
    cloud, footprints = write_town(tmp_path, TOWN)
    make_plan(Request((str(cloud),), tmp_path / "a", str(footprints), write_terrain(tmp_path / "here.tif", 2.0)))
    assert not [warning for warning in recwarn if issubclass(warning.category, InputWarning)]
    elsewhere = write_terrain(tmp_path / "there.tif", 2.0, east=5000.0)
    with pytest.warns(
        InputWarning, match=r"there\.tif: no building stands on it, so the ground is taken from the points"
    ):
        make_plan(Request((str(cloud),), tmp_path / "b", str(footprints), elsewhere))


def test_web_mercators_metres_are_told_of(tmp_path):
    to_web = pyproj.Transformer.from_crs("EPSG:28992", "EPSG:3857", always_xy=True)
    xyz = np.column_stack([*to_web.transform(*TOWN.xyz[:, :2].T), TOWN.xyz[:, 2]])
    cloud = write_cloud(tmp_path / "cloud.laz", xyz, TOWN.classification, "EPSG:3857", origin=xyz.min(axis=0))
    footprints = write_footprints(tmp_path / "footprints.geojson", TOWN.footprints)
    with pytest.warns(InputWarning, match=r"cloud\.laz: in EPSG:3857 .* a metre on the ground is 1\.62 m long there"):
        make_plan(Request((str(cloud),), tmp_path / "out", str(footprints)))


@pytest.mark.parametrize(
    ("epsg", "lon_lat"),
    [(28992, (4.4, 52.0)), (7415, (4.4, 52.0)), (25832, (6.0, 51.0)), (2154, (2.3, 48.8)), (2263, (-74.0, 40.7))],
)
def test_national_grids_and_utm_keep_lengths(epsg, lon_lat):
    crs = pyproj.CRS(epsg)
    xy = np.array([pyproj.Transformer.from_crs(4326, crs, always_xy=True).transform(*lon_lat)[:2]])
    assert stretch(crs, xy) == pytest.approx(1.0, abs=0.001)


def test_a_run_counts_what_its_details_leave_in_doubt(tmp_path, capsys):
    town = make_town(houses=2)
    xyz = town.xyz.copy()
    on_first = (town.classification == 6) & (xyz[:, 0] < ORIGIN[0] + 30)
    xyz[np.flatnonzero(on_first)[::2], 2] += 0.5
    cloud = write_cloud(tmp_path / "cloud.laz", xyz, town.classification)
    footprints = write_footprints(tmp_path / "footprints.geojson", town.footprints)
    summary = reconstruct_area(Request((str(cloud),), tmp_path / "out", str(footprints)))
    assert summary.doubts == {Doubt.TWO_SURFACES: 1}
    print_summary(summary)
    assert "read the detail of 1 building (two surfaces)\n" in capsys.readouterr().out
