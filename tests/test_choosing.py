"""What of the data is asked for, and how: options made of settings, a settings file beside the
data, --where and --bbox.
"""

import dataclasses
import re

import numpy as np
import pytest
import shapely
from click.testing import CliRunner

from hiproof.city.plan.prepare import make_plan
from hiproof.city.request import Request
from hiproof.city.run import reconstruct_area
from hiproof.cli.app import app, import_command
from hiproof.cli.reconstruct import find_settings_file
from hiproof.errors import InputError, SettingsError
from hiproof.read.outlines.footprints import read_footprints
from hiproof.settings import Settings
from layers import write_layer
from run_records import by_id
from tiny_town import write_cloud

PARAMETERS = {p.name: p for p in import_command("reconstruct").params}
OPTIONED = [p for p in PARAMETERS.values() if getattr(p, "setting", None)]
HOUSES = {f"house-{i}": shapely.box(20 * i, 0, 20 * i + 10, 8) for i in range(5)}


@pytest.fixture
def houses(tmp_path):
    """A file of five houses in a row, each with a year and a name."""
    columns = {"id": list(HOUSES), "year": np.arange(1900, 1950, 10)}
    return write_layer(tmp_path / "houses.gpkg", HOUSES.values(), columns)


@pytest.mark.parametrize(
    "with_footprints, error, text",
    [
        (True, InputError, r"of the buildings \(id, year\) as --use-attribute, got 'use'"),
        (False, SettingsError, "expected footprints with --use-attribute, got none"),
    ],
)
def test_a_use_that_no_footprint_has_is_refused_before_the_run(
    houses, with_footprints, error, text, tmp_path
):
    cloud = write_cloud(tmp_path / "a.laz", np.array([[1.0, 1.0, 3.0], [2.0, 2.0, 3.0]]), [6, 6])
    words = [str(cloud), "--enrich", "--use-attribute", "use", "--out", str(tmp_path / "out")]
    words += ["--footprints", str(houses)] if with_footprints else []
    result = CliRunner().invoke(app, ["reconstruct", *words])
    assert isinstance(result.exception, error)
    assert re.search(text, str(result.exception))
    assert not list((tmp_path / "out").glob("buildings*"))


def test_every_option_of_a_setting_is_there_and_tells_what_the_setting_tells():
    declared = [
        field.metadata["option"]
        for section in dataclasses.fields(Settings)
        for field in dataclasses.fields(section.default_factory)
        if field.metadata["option"]
    ]
    assert [option.opts[0] for option in OPTIONED] == declared
    for option in OPTIONED:
        assert option.setting[1].metadata["help"] in option.help


def test_a_settings_file_beside_the_data_is_found_and_named(tmp_path, caplog):
    (tmp_path / "hiproof.toml").write_text('[fit]\nobjective = "paper"\n')
    assert find_settings_file(str(tmp_path / "a.laz"), None) == tmp_path / "hiproof.toml"
    assert str(tmp_path / "hiproof.toml") in caplog.text
    assert (
        find_settings_file(str(tmp_path), "https://example.org/b.gpkg") == tmp_path / "hiproof.toml"
    )
    assert find_settings_file(str(tmp_path / "other" / "a.laz"), None) is None


def test_two_settings_files_beside_the_data_are_one_too_many(tmp_path):
    for name in ("clouds", "footprints"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "hiproof.toml").touch()
    with pytest.raises(SettingsError, match=r"expected one hiproof\.toml .*--config"):
        find_settings_file(str(tmp_path / "clouds"), str(tmp_path / "footprints" / "b.gpkg"))


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"where": "year < 1920"}, [0, 1]),
        ({"where": "id = 'house-3'"}, [3]),
        ({"bbox": (25.0, 1.0, 45.0, 2.0)}, [1, 2]),
        ({"bbox": (11.0, 0.0, 21.0, 8.0)}, [1]),
        ({"bbox": (0.0, 0.0, 41.0, 8.0), "where": "year > 1905"}, [1, 2]),
    ],
)
def test_footprints_are_those_that_condition_and_box_let_through(options, expected, houses):
    assert [f.id for f in read_footprints(houses, **options)] == [f"house-{i}" for i in expected]


def test_a_box_is_in_the_coordinates_of_the_clouds(houses):
    """Whatever the footprints are in: the same houses, though their coordinates are others."""
    distant_corner = (155000.0, 463000.0)
    moved = shapely.transform(list(HOUSES.values()), lambda xy: xy + distant_corner)
    path = write_layer(houses.with_name("moved.gpkg"), moved, {"id": list(HOUSES)})
    footprints = read_footprints(path, target_crs="EPSG:32631")
    box = tuple(footprints[2].polygon.buffer(1.0).bounds)
    assert [f.id for f in read_footprints(path, target_crs="EPSG:32631", bbox=box)] == ["house-2"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"where": "height > 3"},
            r"--where in SQL on the attributes of .* \(id, year\), got: no such column: height",
        ),
        ({"where": "year ="}, "--where in SQL"),
        ({"where": "year > 3000"}, r"\(-?\d.*\) that --where let through, got none"),
        ({"bbox": (500.0, 500.0, 501.0, 501.0)}, "that --bbox let through, got none"),
    ],
)
def test_a_choice_that_leaves_nothing_gets_a_sentence(options, message, houses):
    with pytest.raises(InputError, match=message):
        read_footprints(houses, **options)


@pytest.mark.parametrize("ending", ["geojson", "shp", "fgb"])
def test_a_condition_that_no_database_reads_gets_the_same_sentence(ending, tmp_path):
    path = write_layer(tmp_path / f"houses.{ending}", HOUSES.values(), {"year": np.arange(5)})
    sentence = r"--where in SQL on the attributes of .*\(year\), got: 'height > 3'"
    with pytest.raises(InputError, match=sentence):
        read_footprints(path, where="height > 3")


@pytest.mark.parametrize("text", ["1,2,3", "3,2,1,4", "a,b,c,d", "1,2,nan,4", ""])
def test_a_box_that_is_none_gets_a_sentence(text, tmp_path):
    result = CliRunner().invoke(
        app, ["reconstruct", "a.laz", "--out", str(tmp_path), f"--bbox={text}"]
    )
    assert isinstance(result.exception, SettingsError)
    assert "--bbox as xmin,ymin,xmax,ymax" in str(result.exception)


def test_without_footprints_the_box_chooses_among_what_is_found(town_files, tmp_path):
    request = Request((town_files[0],), tmp_path)
    everything = make_plan(request).jobs
    assert len(everything) == 4
    box = everything[2].area.buffer(0.5).bounds
    (job,) = make_plan(dataclasses.replace(request, bbox=box)).jobs
    assert job == dataclasses.replace(everything[2], index=0)
    x, y, *_ = everything[2].area.buffer(5.0).bounds
    with pytest.raises(InputError, match=r"buildings in --bbox .*, got none"):
        make_plan(dataclasses.replace(request, bbox=(x, y, x + 0.01, y + 0.01)))
    sentence = r"meets the clouds, which lie in [\d.,]+, got -9,-9,-8,-8"
    with pytest.raises(InputError, match=sentence):
        make_plan(dataclasses.replace(request, bbox=(-9.0, -9.0, -8.0, -8.0)))


def test_without_footprints_a_building_in_the_box_comes_as_without_a_box(town_files, tmp_path):
    request = Request((town_files[0],), tmp_path / "whole")
    reconstruct_area(request)
    whole = by_id(tmp_path / "whole")
    box = shapely.Polygon(whole[min(whole)]["outline"][0]).bounds
    origin = whole[min(whole)]["origin"]
    box = tuple(np.add(box, [origin[0], origin[1]] * 2).tolist())
    reconstruct_area(dataclasses.replace(request, out=tmp_path / "part", bbox=box))
    assert by_id(tmp_path / "part") == {min(whole): whole[min(whole)]}
