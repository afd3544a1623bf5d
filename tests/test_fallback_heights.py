"""Heights from attributes stand in for points that are missing, and count after everything else."""

import json

import numpy as np
import pytest
import shapely

from hiproof.city.request import Request
from hiproof.city.run import reconstruct_area
from hiproof.compose import check_solid
from hiproof.errors import InputError, SettingsError
from hiproof.parametric.building import build
from hiproof.parametric.fallback import read_fallback
from hiproof.parametric.run import build_file
from hiproof.settings import ReadSettings, Settings
from layers import write_layer
from run_records import by_id, records
from tiny_town import ORIGIN, make_town, write_cloud

HEIGHTS = {
    "block": [9.5, 9.5, np.nan, -9999.0],
    "roof": [99.0, 12.25, 12.25, 12.25],
    "ground": [1.0, 1.0, 1.0, 1.0],
    "kind": [np.nan, np.nan, 7.0, np.nan],
}
"""Columns of four houses, of which the first has points, and the last two only here and there."""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A cloud without the roofs of three houses, one without their ground too, and footprints."""
    folder, town = tmp_path_factory.mktemp("town"), make_town()
    x, y = town.xyz[:, :2].T
    hidden = np.zeros(len(x), bool)
    for id in ("house-1", "house-2", "house-3"):
        hidden |= shapely.intersects_xy(town.footprints[id].buffer(0.5), x, y)
    near = x < ORIGIN[0] + 25.0
    clouds = [
        str(write_cloud(folder / f"{name}.laz", town.xyz[mask], town.classification[mask]))
        for name, mask in (("whole", ~hidden), ("west", near))
    ]
    columns = {"id": list(town.footprints), **HEIGHTS}
    path = write_layer(folder / "footprints.gpkg", town.footprints.values(), columns)
    return clouds, str(path)


def run(cloud, footprints, out, **read):
    settings = Settings.from_dict({"read": read})
    request = Request((cloud,), out, footprints, id_attribute="id", settings=settings)
    reconstruct_area(request)
    return by_id(out)


def find_top(row):
    return build(row).solid.vertices[:, 2].max()


def test_a_height_above_ground_stands_on_the_terrain(files, tmp_path):
    (cloud, _), footprints = files
    rows = run(cloud, footprints, tmp_path / "run", fallback_roof_height="+block")
    statuses = [row["status"] for row in rows.values()]
    assert statuses == ["modelled", "from_attributes", "no_points", "no_points"]
    house = rows["house-1"]
    assert find_top(house) - house["z_ground"] == pytest.approx(9.5, abs=1e-3)
    assert house["ground_source"] == "ground points"
    assert house["z_ground"] == pytest.approx(ORIGIN[2] + 0.38, abs=0.1)
    assert house["terrain_line"] and not check_solid(build(house).solid)
    build_file(tmp_path / "run" / "parameters.jsonl", tmp_path / "built")
    assert records(tmp_path / "built") == records(tmp_path / "run")


def test_absolute_heights_stand_on_the_ground_of_their_column(files, tmp_path):
    (_, cloud), footprints = files
    columns = {"fallback_roof_height": "roof", "fallback_ground_height": "ground"}
    rows = run(cloud, footprints, tmp_path / "run", **columns)
    assert [row["status"] for row in rows.values()] == ["modelled"] + 3 * ["from_attributes"]
    for id in ("house-2", "house-3"):
        assert find_top(rows[id]) == pytest.approx(12.25, abs=1e-3)
        assert (rows[id]["z_ground"], rows[id]["ground_source"]) == (1.0, "attribute")
    feature = json.loads((tmp_path / "run" / "buildings.city.jsonl").read_text().splitlines()[4])
    attributes = feature["CityObjects"]["house-3"]["attributes"]
    assert attributes["hiproof_status"] == "from_attributes"
    assert attributes["rf_extrusion_mode"] == "lod11_fallback"


def test_override_columns_win(files, tmp_path):
    (_, cloud), footprints = files
    rows = run(
        cloud,
        footprints,
        tmp_path / "run",
        fallback_roof_height="roof",
        fallback_ground_height="ground",
        override_columns=["kind=z_ground"],
    )
    assert [rows[f"house-{k}"]["z_ground"] for k in (1, 2, 3)] == [1.0, 7.0, 1.0]
    block = run(
        cloud,
        footprints,
        tmp_path / "block",
        fallback_roof_height="roof",
        override_columns=["kind=block_height", "ground=z_ground"],
    )["house-2"]
    assert block["status"] == "modelled"
    assert find_top(block) == pytest.approx(8.0, abs=1e-3)


def test_a_height_above_an_unknown_ground_makes_no_block(files, tmp_path):
    (_, cloud), footprints = files
    row = run(cloud, footprints, tmp_path / "run", fallback_roof_height="+block")["house-1"]
    assert row["status"] == "no_points"
    assert "its height is known, but not that of its ground" in row["detail"]


def test_bad_columns_are_refused_in_a_sentence(files, tmp_path):
    (cloud, _), footprints = files
    with pytest.raises(InputError, match="got 'hight'; name one of these"):
        run(cloud, footprints, tmp_path / "a", fallback_roof_height="+hight")
    with pytest.raises(SettingsError, match="only --fallback-roof-height takes"):
        run(cloud, footprints, tmp_path / "b", fallback_ground_height="+ground")


@pytest.mark.parametrize("code", [-9999, 9999, 9999.0, "9999", 99999, -32767, 1e30])
@pytest.mark.parametrize("column", ["roof", "+roof"])
def test_codes_for_no_data_are_no_heights(column, code):
    read = ReadSettings(fallback_roof_height=column, fallback_ground_height="ground")
    heights = read_fallback({"roof": code, "ground": code}, read)
    assert (heights.roof_m, heights.block_m, heights.ground_m) == (None, None, None)
