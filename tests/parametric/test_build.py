"""`hiproof build`: a run's own parameters give the run's own files; what a hand got wrong is one
sentence about one building.
"""

import copy
import json
from pathlib import Path

import numpy as np
import pyogrio
import pytest
from click.testing import CliRunner
from jsonschema import Draft202012Validator

import hiproof
from hiproof.city.plan.overrides import override_records
from hiproof.cli.app import app
from hiproof.compose import check_solid
from hiproof.errors import CompositionError, HiproofError, InputError
from hiproof.evaluate.run import evaluate_run
from hiproof.parametric.file import opened_parameters
from hiproof.parametric.run import build_file
from hiproof.parametric.schema import schema, schema_text
from hiproof.primitives import CATALOGUE
from hiproof.primitives.parameters import list_parameters
from hiproof.simulate import demo_files
from programs import run_hiproof

FILES = (
    "buildings.gml",
    "buildings.citygml3.gml",
    "buildings.city.jsonl",
    "parameters.jsonl",
    "buildings.gpkg",
)
PARQUET = ("buildings.parquet", "parts.parquet", "roof_surfaces.parquet")
PUBLISHED = Path(__file__).parents[2] / "docs/parameters.schema.json"
RING = [[-6.0, -4.0], [6.0, -4.0], [6.0, 4.0], [-6.0, 4.0], [-6.0, -4.0]]
HEAD = {"hiproof_parameters": 1, "crs": "EPSG:28992"}


def house(**changes):
    """A gable of 12 by 8 m."""
    part = {
        "type": "gable",
        "parameters": {"width": 8.0, "length": 12.0, "height": 3.0},
        "position": [0.0, 0.0, 5.0],
        "rotation": 0.0,
    }
    part |= changes
    return {
        "id": "a",
        "origin": [85000.0, 446000.0, 2.0],
        "outline": [RING],
        "z_ground": 2.0,
        "parts": [part],
    }


def write_lines(path, *records, head=HEAD):
    path.write_text("".join(json.dumps(record) + "\n" for record in (head, *records)))
    return path


@pytest.fixture(scope="module")
def demo_run(tmp_path_factory):
    """The bundled neighbourhood, without the network: its types are all in it, and a footprint
    without points.
    """
    files, out = demo_files(), tmp_path_factory.mktemp("demo")
    pytest.importorskip("pyarrow", reason="GeoParquet needs pyarrow (extra `city`)")
    everything = {"parquet": True, "citygml": "both", "osm_tags": True}
    settings = hiproof.Settings.from_dict({"segment": {"network": "never"}, "write": everything})
    request = hiproof.Request(
        (str(files["cloud"]),),
        out,
        str(files["footprints"]),
        str(files["terrain"]),
        settings=settings,
    )
    hiproof.reconstruct_area(request)
    return out


def test_a_runs_own_parameters_give_its_own_files(demo_run, tmp_path):
    built = build_file(demo_run / "parameters.jsonl", tmp_path)
    assert built.exit_code == 0
    assert built.buildings == len(hiproof.read_parameters(demo_run / "parameters.jsonl"))
    for name in (*FILES, *PARQUET):
        assert (tmp_path / name).read_bytes() == (demo_run / name).read_bytes(), name


def test_a_ground_above_the_eaves_is_remarked():
    assert "lies 5.0 m above its eaves" in hiproof.build(house() | {"z_ground": 12.0}).detail
    assert "above its eaves" not in hiproof.build(house()).detail


def test_a_file_that_an_editor_began_with_a_mark_of_its_encoding_is_read(demo_run, tmp_path):
    text = (demo_run / "parameters.jsonl").read_text(encoding="utf-8")
    (tmp_path / "saved.jsonl").write_text(text, encoding="utf-8-sig")
    assert hiproof.read_parameters(tmp_path / "saved.jsonl") == hiproof.read_parameters(
        demo_run / "parameters.jsonl"
    )
    (tmp_path / "overrides.jsonl").write_text('{"id": "a", "type": "hip"}\n', encoding="utf-8-sig")
    assert [record["id"] for _, record in override_records(str(tmp_path / "overrides.jsonl"))] == [
        "a"
    ]


def test_all_lines_are_as_the_published_schema_says(demo_run):
    assert PUBLISHED.read_text() == schema_text()
    validator = Draft202012Validator(schema())
    lines = (demo_run / "parameters.jsonl").read_text().splitlines()
    assert len(lines) > 20
    for line in lines:
        validator.validate(json.loads(line))


def test_every_type_can_be_built_by_its_own_parameters():
    for name in CATALOGUE:
        parameters = CATALOGUE[name].typical(8.0, 12.0, 3.0)
        building = hiproof.build(house(type=name, parameters=parameters))
        assert building.type == name and not check_solid(building.solid), name
        assert list(parameters) == [key for key in list_parameters(name) if key in parameters]


def test_a_saw_tooth_by_hand_has_all_its_teeth():
    parameters = {"width": 8.0, "length": 12.0, "height": 1.0, "teeth": 4.0}
    for part in ({}, {"outlines": [[RING]]}):
        solid = hiproof.build(house(type="shed", parameters=parameters, **part)).solid
        assert len(solid.select_faces("RoofSurface")) == 4
        assert np.ptp(solid.vertices[:, 2]) == pytest.approx(6.0)
        assert solid.volume == pytest.approx(96 * 5.5, rel=1e-3)


def test_numbers_are_what_they_say():
    solid = hiproof.build(house()).solid
    assert solid.vertices[:, 2].max() == pytest.approx(2.0 + 5.0 + 3.0)
    assert solid.vertices[:, :2].min(axis=0).tolist() == [84994.0, 445996.0]


def spoil(change):
    record = house()
    change(record)
    return record


BAD = {
    "negative width": (
        lambda r: r["parts"][0]["parameters"].update(width=-8.0),
        "positive width of part 0, got -8",
    ),
    "NaN": (
        lambda r: r["parts"][0]["parameters"].update(height=float("nan")),
        "number as height in .* part 0, got nan",
    ),
    "infinite": (lambda r: r.update(z_ground=float("inf")), "number as z_ground, got inf"),
    "text": (lambda r: r["parts"][0].update(position=["a", 0, 0]), "position of part 0, got 'a'"),
    "huge": (lambda r: r["parts"][0]["parameters"].update(height=10**400), "number as height"),
    "no such type": (lambda r: r["parts"][0].update(type="igloo"), "roof type .* got 'igloo'"),
    "missing": (lambda r: r["parts"][0]["parameters"].pop("height"), "got none for height"),
    "misspelt": (lambda r: r["parts"][0]["parameters"].update(ridge=3.0), "got also ridge"),
    "misspelt key": (lambda r: r["parts"][0].update(rotatoin=3.0), "got also rotatoin"),
    "outside": (lambda r: r["parts"][0].update(position=[50.0, 0, 5]), "outside it"),
    "alike": (
        lambda r: r["parts"].append(copy.deepcopy(r["parts"][0])),
        "part 1 the same as part 0",
    ),
    "ridge too long": (
        lambda r: r["parts"][0].update(
            type="hip",
            parameters={"width": 8.0, "length": 12.0, "height": 3.0, "ridge_length": 13.0},
        ),
        "planes that rise",
    ),
    "too steep": (
        lambda r: r["parts"][0].update(
            type="monopitch",
            parameters={"width": 8.0, "length": 12.0, "pitch_front": 95.0, "eave_front": 0.0},
        ),
        "pitch_front between 0 and 89 degrees",
    ),
    "no outline": (lambda r: r.update(outline=None), "an outline and an origin"),
    "no parts": (lambda r: r.update(parts=[], status="modelled"), "give one part at least"),
    "no ground": (lambda r: r.update(z_ground=None), "number as z_ground, got null"),
    "parts no list": (lambda r: r.update(parts={}), "expected a list as parts"),
    "crossing": (
        lambda r: r.update(outline=[[[-6, -4], [6, 4], [6, -4], [-6, 4], [-6, -4]]]),
        r"does not cross itself, got one with Self-intersection\[0 0\]",
    ),
    "ring of two": (lambda r: r.update(outline=[[[0, 0], [1, 1]]]), "rings of three"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_wrong_is_one_sentence(name):
    change, message = BAD[name]
    with pytest.raises(InputError, match=message) as caught:
        hiproof.build(spoil(change))
    assert str(caught.value).startswith(("expected", "part 0")) and "\n" not in str(caught.value)


def test_a_roof_that_does_not_close_is_one_sentence():
    outline = [[[0.0, 0.0], [5e-4, 0.0], [0.0, 5e-4], [0.0, 0.0]]]
    with pytest.raises(CompositionError, match="expected"):
        hiproof.build(house(outlines=[outline]) | {"outline": outline})


def test_one_wrong_building_keeps_its_parameters_and_stops_no_other(tmp_path):
    wrong = spoil(lambda r: r["parts"][0]["parameters"].update(width=-8.0)) | {"id": "wrong"}
    path = write_lines(
        tmp_path / "p.jsonl", house() | {"id": "one"}, wrong, house() | {"id": "two"}
    )
    result = CliRunner().invoke(app, ["build", str(path), "--out", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert "building wrong: expected a positive width" in result.output
    rows = {row["id"]: row for row in hiproof.read_parameters(tmp_path / "out/parameters.jsonl")}
    assert [rows[id]["status"] for id in ("one", "wrong", "two")] == [
        "modelled",
        "not_built",
        "modelled",
    ]
    assert rows["wrong"]["parts"] == wrong["parts"]
    _, _, _, columns = pyogrio.raw.read(
        tmp_path / "out/buildings.gpkg", layer="buildings", columns=["hiproof_status"]
    )
    assert columns[0].tolist() == ["modelled", "not_built", "modelled"]
    mended = {**rows["wrong"], "parts": house()["parts"]}
    assert hiproof.build(mended).status.is_model


def test_a_first_building_whose_outline_crosses_itself_stops_no_other(tmp_path):
    wrong = house() | {"id": "wrong", "outline": [[[-6, -4], [6, 4], [6, -4], [-6, 4], [-6, -4]]]}
    built = build_file(
        write_lines(tmp_path / "p.jsonl", wrong, house() | {"id": "two"}), tmp_path / "out"
    )
    assert built.by_status == {"not_built": 1, "modelled": 1}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            '{"hiproof_parameters": 1}\n\n{"id": "a", "parts": [}\n',
            r"line 3 of .* column 23 .*beside.*mend it there",
        ),
        (
            '{"hiproof_parameters": 1}\n{"id": "a",\n "parts": []}\n',
            r"line 2 of .* column 12 .*an object stands on one line",
        ),
        ('{"hiproof_parameters": 2}\n', "version 1 .* got version 2"),
        ('{"id": "a"}\n', "first line"),
        ("", "first line"),
        ('{"hiproof_parameters": 1, "unit": "ell"}\n', "expected a unit"),
        ('{"hiproof_parameters": 1, "crs": "EPSG:x"}\n', "coordinate reference system"),
        ('{"hiproof_parameters": 1, "compose": {"snap_m": -1}}\n', "compose.snap_m"),
        ('{"hiproof_parameters": 1, "cityjson_offset": [0, 0]}\n', "three numbers"),
        ('{"hiproof_parameters": 1}\n{"parts": []}\n', "an id in line 2"),
        ('{"hiproof_parameters": 1}\n' + "[" * 100_000 + "\n", "line 2"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused_whole(text, message, tmp_path, capsys):
    (tmp_path / "p.jsonl").write_text(text)
    with pytest.raises(HiproofError, match=message):
        build_file(tmp_path / "p.jsonl", tmp_path / "out")
    assert not list((tmp_path / "out").glob("*"))
    assert run_hiproof("build", tmp_path / "p.jsonl", "--out", tmp_path / "out") == 2
    assert "Traceback" not in capsys.readouterr().err


def test_a_file_is_read_as_it_is_needed(tmp_path):
    path = write_lines(tmp_path / "p.jsonl", house(), house())
    with path.open("a") as file:
        file.write("{broken")
    with opened_parameters(path) as (_, records):
        assert [next(records)["id"], next(records)["id"]] == ["a", "a"]
        with pytest.raises(InputError, match="line 4"):
            next(records)


def test_a_runs_own_folder_is_not_built_into(reference_run):
    with pytest.raises(HiproofError, match="choose another --out"):
        build_file(reference_run / "parameters.jsonl", reference_run)


def test_buildings_may_be_fewer_and_in_another_order(demo_run, tmp_path):
    head, *lines = (demo_run / "parameters.jsonl").read_text().splitlines()
    (tmp_path / "p.jsonl").write_text("\n".join([head, *lines[10:4:-1]]) + "\n")
    build_file(tmp_path / "p.jsonl", tmp_path / "out")
    whole = set((demo_run / "buildings.city.jsonl").read_text().splitlines()[1:])
    subset = (tmp_path / "out/buildings.city.jsonl").read_text().splitlines()[1:]
    assert len(subset) == 6 and set(subset) <= whole


def test_shapes_and_schema_are_printed():
    shapes = CliRunner().invoke(app, ["build", "--shapes"]).output
    assert [line.split(":")[0] for line in shapes.splitlines()] == list(CATALOGUE)
    assert json.loads(CliRunner().invoke(app, ["build", "--schema"]).output) == json.loads(
        PUBLISHED.read_text()
    )


def test_the_head_keeps_feet(tmp_path):
    feet = {"hiproof_parameters": 1, "crs": None, "unit": "foot"}
    build_file(write_lines(tmp_path / "p.jsonl", house(), head=feet), tmp_path / "feet")
    build_file(write_lines(tmp_path / "q.jsonl", house()), tmp_path / "metres")
    heights = [
        pyogrio.read_bounds(tmp_path / name / "buildings.gpkg", layer="buildings")[1][:2, 0]
        for name in ("feet", "metres")
    ]
    assert heights[0] == pytest.approx(np.array(heights[1]) / 0.3048)


@pytest.mark.parametrize(
    ("head", "out_crs"),
    [
        ({"crs": "EPSG:7415"}, "EPSG:3857"),
        ({"crs": "EPSG:7415"}, "+proj=tmerc +lat_0=52 +lon_0=5 +x_0=100000 +datum=WGS84"),
        ({"crs": None, "unit": "us-survey-foot"}, ""),
    ],
    ids=["another CRS", "one without a code", "feet without a CRS"],
)
def test_what_is_built_of_a_file_alone_is_read_in_its_place(tmp_path, head, out_crs):
    path = write_lines(
        tmp_path / "parameters.jsonl", house(), head={"hiproof_parameters": 1} | head
    )
    build_file(path, tmp_path / "out", changes={"write": {"out_crs": out_crs}})
    model = evaluate_run(tmp_path / "out").models[0]
    solid = hiproof.build(house()).solid
    np.testing.assert_allclose(
        model.solid.vertices.mean(axis=0), solid.vertices.mean(axis=0), atol=1e-3
    )
