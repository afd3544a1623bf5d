"""What a run says of inputs that fit one another badly: heights of two kinds, a terrain elsewhere,
a CRS whose metres are none.
"""

import warnings
from pathlib import Path

import numpy as np
import pyproj
import pytest
import shapely

from hiproof.city.plan.prepare import make_plan
from hiproof.city.run import Request
from hiproof.cli.running import print_summary
from hiproof.errors import InputError, InputWarning
from hiproof.read.crs.positions import stretch
from hiproof.status import Doubt
from layers import write_raster
from run_records import run_points
from tiny_town import ORIGIN, make_town, write_cloud, write_footprints, write_town

TOWN = make_town(houses=1)


def write_terrain(path, height, east=0.0):
    """A terrain model of that height, or those heights (80, 80), around the town, or so far east of
    it.
    """
    heights = np.broadcast_to(np.asarray(height, "float32"), (80, 80))
    return write_raster(path, heights, ORIGIN[0] - 20 + east, ORIGIN[1] + 60)


def run_over_terrain(folder, height):
    """What the run writes of the only building over a terrain model of that height."""
    terrain = write_terrain(folder / "dtm.tif", height)
    rows, _ = run_points(folder, TOWN.xyz, TOWN.classification, TOWN.footprints, terrain=terrain)
    return rows["house-0"]


@pytest.mark.parametrize(
    ("height", "is_doubtful"),
    [
        (ORIGIN[2], ()),
        (
            ORIGIN[2] - 43.0,
            (
                "terrain model dtm.tif lies 43.",
                "m below the ground points around it, which are used instead",
            ),
        ),
        (ORIGIN[2] + 9.0, ("m above the ground points around it, which are used instead",)),
        (ORIGIN[2] + 3.0, ("lies 2.", "m above the ground points around it")),
    ],
)
def test_a_terrain_whose_heights_are_others_is_told_of(tmp_path, height, is_doubtful):
    row = run_over_terrain(tmp_path, height)
    assert all(words in row["detail"] for words in is_doubtful)
    assert bool(is_doubtful) == ("lies" in row["detail"])
    is_used = abs(height - ORIGIN[2]) < 5.0
    assert row["z_ground"] == pytest.approx(height if is_used else ORIGIN[2] + 0.08, abs=0.05)


def row_over_half(folder, code, with_ground=True):
    """What the run writes of a building of whose terrain model the western half holds `code`, the
    rest the true ground.
    """
    height = 40.0
    xyz = TOWN.xyz + [0, 0, height - ORIGIN[2]]
    selection = slice(None) if with_ground else TOWN.classification == 6
    points = xyz[selection], TOWN.classification[selection]
    heights = np.full((80, 80), height, "float32")
    heights[:, :34] = code
    terrain = write_terrain(folder / "dtm.tif", heights)
    return run_points(folder, *points, TOWN.footprints, terrain=terrain)[0]["house-0"]


@pytest.mark.parametrize("with_ground", [True, False])
@pytest.mark.parametrize(
    ("rise", "slope", "is_named"),
    [(3.0, 0.0, True), (3.0, 0.1, True), (-2.6, 0.0, True), (0.8, 0.0, False), (0.0, 0.3, False)],
)
def test_a_step_of_the_terrain_at_the_outline_is_named(
    rise, slope, is_named, with_ground, tmp_path
):
    """A raster is interpolated, so that half of such a step lies at the corners."""
    (area,) = TOWN.footprints.values()
    x, y = np.meshgrid(ORIGIN[0] - 19.5 + np.arange(80), ORIGIN[1] + 59.5 - np.arange(80))
    heights = ORIGIN[2] + 9.0 + slope * (x - area.centroid.x)
    terrain = write_terrain(
        tmp_path / "dtm.tif", heights + np.where(shapely.contains_xy(area, x, y), rise, 0.0)
    )
    xyz, is_roof = TOWN.xyz + [0, 0, 9.0], TOWN.classification == 6
    xyz[:, 2] += slope * (np.where(is_roof, area.centroid.x, xyz[:, 0]) - area.centroid.x)
    chosen = is_roof | with_ground
    points = xyz[chosen], TOWN.classification[chosen]
    row = run_points(tmp_path, *points, TOWN.footprints, terrain=terrain)[0]["house-0"]
    assert (f"m {'above' if rise > 0 else 'below'} " in row["detail"]) == is_named
    assert is_named == ("around it" in row["detail"]), row["detail"]


@pytest.mark.parametrize(
    ("rise", "slope", "words"),
    [
        (3.0, 0.0, "lies 3.0 m above its own heights around it"),
        (3.0, 0.1, "m above its own heights around it"),
        (-2.6, 0.0, "lies 2.6 m below its own heights around it"),
        (0.0, 0.3, ""),
    ],
)
def test_a_terrain_that_rises_under_a_roof_alone_is_named(rise, slope, words, tmp_path):
    """As where a filter left the building in: the cloud has no ground points to compare."""
    is_roof = TOWN.classification == 6
    (area,) = TOWN.footprints.values()
    x, y = np.meshgrid(ORIGIN[0] - 19.5 + np.arange(80), ORIGIN[1] + 59.5 - np.arange(80))
    inside = shapely.contains_xy(area.buffer(1.5), x, y)
    heights = ORIGIN[2] + slope * (x - area.centroid.x) + np.where(inside, rise, 0.0)
    terrain = write_terrain(tmp_path / "dtm.tif", heights)
    points = TOWN.xyz[is_roof], TOWN.classification[is_roof]
    row = run_points(tmp_path, *points, TOWN.footprints, terrain=terrain)[0]["house-0"]
    assert words in row["detail"] and bool(words) == ("its own heights" in row["detail"])


@pytest.mark.parametrize("code", [-9999.0, 9999.0, -32767.0, 3.4e38, 0.0, 255.0])
def test_undeclared_codes_under_part_of_a_building_are_no_ground(tmp_path, code):
    row = row_over_half(tmp_path, code)
    assert row["z_ground"] == pytest.approx(40.0, abs=0.1)
    assert (
        "holds values that are no heights under part of the building; the ground points are used"
        in row["detail"]
    )


@pytest.mark.parametrize("code", [-9999.0, 0.0])
def test_without_ground_points_the_rest_of_the_terrain_model_decides(tmp_path, code):
    row = row_over_half(tmp_path, code, with_ground=False)
    assert (
        row["z_ground"] == pytest.approx(40.0, abs=0.01) and "it is not used there" in row["detail"]
    )


@pytest.mark.parametrize("void", [0.5, 2.0, 7.0, 15.0])
def test_voids_around_buildings_have_the_ground_beside_them(tmp_path, void):
    """The cloud holds roofs alone, as where a model's makers took the ground out."""
    is_roof = TOWN.classification == 6
    xyz = TOWN.xyz[is_roof] + [0, 0, 40.0 - ORIGIN[2]]
    (area,) = TOWN.footprints.values()
    x, y = np.meshgrid(ORIGIN[0] - 19.5 + np.arange(80), ORIGIN[1] + 59.5 - np.arange(80))
    heights = np.where(shapely.contains_xy(area.buffer(void), x, y), -9999.0, 40.0)
    terrain = write_terrain(tmp_path / "dtm.tif", heights)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*has no height")
        points = xyz, TOWN.classification[is_roof]
        row = run_points(tmp_path, *points, TOWN.footprints, terrain=terrain)[0]["house-0"]
    assert row["z_ground"] == pytest.approx(40.0, abs=0.01)
    assert row["ground_source"].endswith("terrain model dtm.tif")


@pytest.mark.parametrize("nothing", [np.nan, -9999.0])
def test_a_terrain_model_without_any_height_is_told_of_once(tmp_path, nothing):
    with pytest.warns(
        InputWarning, match=r"dtm\.tif: has no height under any building, so the ground is taken"
    ) as remarks:
        row = run_over_terrain(tmp_path, nothing)
    assert len([w for w in remarks if issubclass(w.category, InputWarning)]) == 1
    assert (
        row["z_ground"] == pytest.approx(ORIGIN[2] + 0.08, abs=0.05)
        and row["ground_source"] == "ground points"
    )


@pytest.mark.parametrize("has_footprints", [True, False])
def test_a_terrain_model_cut_off_in_its_pixels_ends_the_run_before_points_are_sorted(
    tmp_path, has_footprints
):
    cloud, footprints = write_town(tmp_path, TOWN)
    terrain = write_terrain(tmp_path / "dtm.tif", ORIGIN[2])
    whole = Path(terrain).read_bytes()
    Path(terrain).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match=r"expected a complete raster at .*dtm\.tif"):
        make_plan(
            Request(
                (str(cloud),),
                tmp_path / "out",
                str(footprints) if has_footprints else None,
                terrain,
            )
        )


def test_a_terrain_on_which_no_building_stands_is_told_of(tmp_path, recwarn):
    cloud, footprints = write_town(tmp_path, TOWN)
    make_plan(
        Request(
            (str(cloud),),
            tmp_path / "a",
            str(footprints),
            write_terrain(tmp_path / "here.tif", 2.0),
        )
    )
    assert not [warning for warning in recwarn if issubclass(warning.category, InputWarning)]
    elsewhere = write_terrain(tmp_path / "there.tif", 2.0, east=5000.0)
    with pytest.warns(
        InputWarning,
        match=r"there\.tif: no building stands on it, so the ground is taken from the points",
    ):
        make_plan(Request((str(cloud),), tmp_path / "b", str(footprints), elsewhere))


def test_web_mercators_metres_are_told_of(tmp_path):
    to_web = pyproj.Transformer.from_crs("EPSG:28992", "EPSG:3857", always_xy=True)
    xyz = np.column_stack([*to_web.transform(*TOWN.xyz[:, :2].T), TOWN.xyz[:, 2]])
    cloud = write_cloud(
        tmp_path / "cloud.laz", xyz, TOWN.classification, "EPSG:3857", origin=xyz.min(axis=0)
    )
    footprints = write_footprints(tmp_path / "footprints.geojson", TOWN.footprints)
    with pytest.warns(
        InputWarning,
        match=r"cloud\.laz: in EPSG:3857 .* a metre on the ground is 1\.62 m long there",
    ):
        make_plan(Request((str(cloud),), tmp_path / "out", str(footprints)))


@pytest.mark.parametrize(
    ("epsg", "lon_lat"),
    [
        (28992, (4.4, 52.0)),
        (7415, (4.4, 52.0)),
        (25832, (6.0, 51.0)),
        (2154, (2.3, 48.8)),
        (2263, (-74.0, 40.7)),
    ],
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
    _, summary = run_points(tmp_path, xyz, town.classification, town.footprints)
    assert summary.doubts[Doubt.TWO_SURFACES] == 1 and set(summary.doubts.values()) == {1}
    print_summary(summary, str(tmp_path / "out"))
    assert "by remark in hiproof_detail: two surfaces 1" in capsys.readouterr().out
