"""Footprints out of, and models into, a real PostGIS."""

import json
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyogrio
import pytest
import shapely
from shapely import affinity

import hiproof
from handmade import make_lost_building
from hiproof.cli.load import load
from hiproof.errors import InputError, OutputError
from hiproof.model.roof_figures import roof_figures
from hiproof.parametric.finished import load_postgis
from hiproof.parametric.run import build_file
from hiproof.read.outlines.footprints import footprint_crs, read_footprints
from hiproof.write import write_parameters
from postgis_server import explain_absence, running
from sample_models import write_sample_run
from sample_parameters import RING, YARD
from written_run import write_all

DOCS = Path(__file__).parents[1] / "docs"
psycopg = pytest.importorskip("psycopg", reason="the extra `postgis` is not installed")


def query(database, sql, *values):
    """The rows of one statement, in a connection of its own."""
    with psycopg.connect(database) as connection:
        cursor = connection.execute(sql, values or None)
        return cursor.fetchall() if cursor.description else []


@pytest.fixture(scope="module")
def database():
    if explain_absence():
        pytest.skip(explain_absence())
    with running() as dsn:
        query(dsn, "create extension postgis")
        yield dsn


@pytest.fixture(scope="module")
def sample(tmp_path_factory):
    """The folder of the sample run, which a program other than hiproof wrote."""
    folder = tmp_path_factory.mktemp("sample")
    write_sample_run(folder)
    return folder


@pytest.fixture(scope="module")
def table(database):
    """Three rows: a square, two squares with one name, and one without geometry."""
    square = shapely.box(0, 0, 10, 10)
    pair = shapely.MultiPolygon([shapely.box(20, 0, 30, 10), shapely.box(40, 0, 50, 10)])
    columns = "id text, storeys int, geom geometry(Geometry, 28992), extra geometry"
    query(database, f"create table houses ({columns})")
    for id, storeys, shape in (("a", 2, square), ("b", 3, pair), ("c", None, None)):
        wkb = None if shape is None else shapely.to_wkb(shape)
        sql = "insert into houses values (%s, %s, ST_SetSRID(%s::geometry, 28992))"
        query(database, sql, id, storeys, wkb)
    return f"{database}&table=houses&geometry=geom"


def test_a_table_gives_the_footprints_a_file_would(table):
    footprints = read_footprints(table)
    assert [f.id for f in footprints] == ["a", "b-1", "b-2", "c"]
    assert footprints[0].attributes["storeys"] == 2
    assert footprints[0].polygon.equals(shapely.box(0, 0, 10, 10))
    assert footprints[-1].polygon.is_empty
    assert [f.id for f in read_footprints(table + "&where=storeys=2")] == ["a"]


def test_the_reference_system_is_asked_for_without_reading_rows(table, monkeypatch):
    monkeypatch.setattr("hiproof.read.outlines.database.DatabaseTable.rows", None)
    assert footprint_crs(table).to_epsg() == 28992
    assert footprint_crs(table + "&where=storeys=2").to_epsg() == 28992
    assert footprint_crs(table + "&where=storeys=99") is None


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda t: t.replace("houses", "castles"), "castles"),
        (
            lambda t: t.replace("&geometry=geom", ""),
            "one geometry column in houses, got extra, geom|geom, extra",
        ),
        (lambda t: t.replace("&table=houses", ""), "table=schema.name"),
        (lambda t: t + "&where=storeys=99", "without rows"),
        (lambda t: t + "&where=nonsense=1", "nonsense"),
    ],
)
def test_a_wrong_address_gets_a_sentence(table, change, expected):
    with pytest.raises(InputError, match=expected):
        read_footprints(change(table))


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        ("1=1; drop table houses; --", "syntax error"),
        ("1=1; drop table houses; select 1, 2", "multiple commands"),
        ("1=1; commit; drop table houses; select 1, 2", "multiple commands"),
        ("nextval('counter') > 0", "read-only"),
    ],
)
def test_a_condition_is_one_statement_that_changes_nothing(table, database, condition, expected):
    query(database, "create sequence if not exists counter")
    with pytest.raises(InputError, match=expected):
        read_footprints(f"{table}&where={condition}")
    assert len(read_footprints(table)) == 4


def test_a_comment_in_a_condition_does_not_swallow_the_order(table):
    assert [f.id for f in read_footprints(f"{table}&where=storeys > 0 --")] == ["a", "b-1", "b-2"]


def test_no_server_gets_a_sentence_and_hides_the_password(tmp_path):
    for address in (
        f"me:secret@/postgres?host={tmp_path}",
        f"me@/postgres?host={tmp_path}&password=secret",
    ):
        with pytest.raises(InputError, match="check address and table") as caught:
            read_footprints(f"postgresql://{address}&table=houses")
        assert "secret" not in str(caught.value)


def test_a_password_with_a_slash_is_not_taken_for_a_host():
    with pytest.raises(InputError, match="%2F") as caught:
        read_footprints("postgresql://me:se/cret@host/db?table=houses")
    assert "cret" not in str(caught.value)


def test_models_load_once_however_often_they_are_loaded(database, sample):
    lines = (sample / "buildings.city.jsonl").read_text().splitlines()[1:]
    for _ in range(2):
        assert load_postgis(sample, database) == len(lines)
    ids = query(database, "select id from hiproof_buildings order by id")
    assert ids == sorted((json.loads(line)["id"],) for line in lines)
    sql = "select count(*), count(distinct building_id) from hiproof_roofs"
    ((roofs, with_roofs),) = query(database, sql)
    assert roofs > with_roofs == 2
    sql = "select distinct GeometryType(geom) from hiproof_buildings where geom is not null"
    assert query(database, sql) == [("POLYHEDRALSURFACE",)]
    sql = "select slope_deg, azimuth_deg from hiproof_roofs where building_id like 'house%'"
    slopes = query(database, sql)
    assert sorted(round(azimuth) for _, azimuth in slopes) == [90, 270]
    assert all(abs(slope - 36.87) < 0.01 for slope, _ in slopes)


def build_rectangle(id, x, type, size, position, rotation=0.0, rings=None):
    """A building of one part at `x`, built of its parameters."""
    part = {"type": type, "parameters": size, "position": position, "rotation": rotation}
    place = {"origin": [x, 446000, 0], "outline": rings or [RING], "z_ground": 0}
    return hiproof.build({"id": id, **place, "parts": [part]})


def reconstruct_gable(rotation=0.0, id="south"):
    """A gable of 12 by 8 m whose ridge runs east, or so many degrees to the north of it."""
    size = {"width": 8, "length": 12, "height": 3}
    return build_rectangle(id, 85000, "gable", size, [0, 0, 5], rotation)


def nearly_level():
    """A shallow roof, which drains but does not slope to the eye."""
    ring = [[0, 0], [9, 0], [9, 6], [0, 6], [0, 0]]
    size = {"width": 6, "length": 9, "height": 0.2}
    return build_rectangle("level", 85050, "monopitch", size, [4.5, 3, 5], rings=[ring])


@pytest.fixture
def run_of_two(tmp_path):
    """Folder and buildings of a run as our writer leaves it: a gable, a courtyard, one without
    model.
    """
    size = {"width": 8, "length": 12}
    yard = build_rectangle("yard", 85040, "flat", size, [0, 0, 5], rings=[RING, YARD])
    buildings = [reconstruct_gable(id="house"), yard, make_lost_building()]
    (tmp_path / "run").mkdir()
    write_all(tmp_path / "run", buildings, "EPSG:7415")
    return tmp_path / "run", buildings


def test_columns_hold_what_the_models_say(database, run_of_two):
    folder, buildings = run_of_two
    load_postgis(folder, database, "told")
    sql = "select id, hiproof_status, hiproof_roof_type from told_buildings order by id"
    assert query(database, sql) == sorted((b.id, b.status.code, b.type) for b in buildings)
    types = query(database, "select distinct building_id, type from told_roofs order by 1")
    assert types == [("house", "gable"), ("yard", "flat")]
    sql = "select building_id, part, type, width, ridge_length from told_parts order by 1"
    parts = [("house", 0, "gable", 8.0, None), ("yard", 0, "flat", 8.0, None)]
    assert query(database, sql) == parts
    sql = "select GeometryType(geom), ST_Area(geom), area_m2 from told_parts order by building_id"
    assert query(database, sql)[0] == ("MULTIPOLYGON", 96.0, 96.0)


def test_roofs_are_measured_as_in_the_geopackage(database, tmp_path):
    """Also where models are written in a map that stretches them, and of faces too level to have an
    azimuth.
    """
    path, out = tmp_path / "parameters.jsonl", tmp_path / "run"
    write_parameters(path, [reconstruct_gable(30.0), nearly_level()], "EPSG:7415")
    build_file(path, out, changes={"write": {"out_crs": "EPSG:3857"}})
    load(out, database, prefix="map")
    names = ["slope_deg", "azimuth_deg", "area_m2"]
    meta, _, _, columns = pyogrio.raw.read(
        out / "buildings.gpkg", layer="roof_surfaces", columns=names
    )
    sql = f"select {', '.join(meta['fields'])} from map_roofs order by building_id desc, number"
    rows = np.array(query(database, sql), float)
    np.testing.assert_allclose(rows, np.array(columns).T, rtol=1e-4)


def read_documented_query(number, prefix):
    """A question of docs/tables.md, for the tables of a prefix."""
    questions = re.findall(r"```sql\n(.*?)```", (DOCS / "tables.md").read_text(), re.DOTALL)
    return questions[number].replace("hiproof_", f"{prefix}_")


def test_the_documented_question_of_a_solar_map(database, tmp_path):
    """Roof surfaces of 20 m2 or more that look between south-east and south-west, as docs/tables.md
    asks for them.
    """
    write_all(tmp_path, [reconstruct_gable()], "EPSG:7415")
    load_postgis(tmp_path, database, "solar")
    ((id, kind, azimuth, *_),) = query(database, read_documented_query(1, "solar"))
    assert (id, kind, round(azimuth)) == ("south", "gable", 180)


def test_the_documented_question_of_rectangles(database, tmp_path):
    """A part is drawn where it shows, and its whole rectangle is made of its columns."""
    write_all(tmp_path, [reconstruct_gable(rotation=30.0)], "EPSG:7415")
    load_postgis(tmp_path, database, "whole")
    ((_, _, rectangle),) = query(database, read_documented_query(0, "whole"))
    ((geometry,),) = query(database, "select ST_AsBinary(geom) from whole_parts")
    expected = affinity.translate(affinity.rotate(shapely.box(-6, -4, 6, 4), 30.0), 85000, 446000)
    assert shapely.from_wkb(rectangle).symmetric_difference(expected).area < 0.01
    outline = shapely.box(84994, 445996, 85006, 446004)
    assert shapely.from_wkb(geometry).symmetric_difference(outline).area < 0.01


def test_postgis_computes_the_volumes_that_the_attributes_name(database, run_of_two):
    folder, buildings = run_of_two
    load_postgis(folder, database, "volumes")
    if not query(database, "select 1 from pg_available_extensions where name = 'postgis_sfcgal'"):
        pytest.skip("PostGIS was built without SFCGAL, which computes volumes")
    extension, question = read_documented_query(2, "volumes").split(";\n", 1)
    query(database, extension)
    expected = {b.id: roof_figures(b.solid).volume_m3 for b in buildings if b.built}
    assert dict(query(database, question)) == pytest.approx(expected, abs=0.0005)


def test_loading_again_replaces_the_run_whatever_its_reference_system(database, run_of_two):
    folder, buildings = run_of_two
    load_postgis(folder, database, "again")
    write_all(folder, buildings[1:], "EPSG:25832")
    load_postgis(folder, database, "again")
    sql = "select distinct id, ST_SRID(geom) from again_buildings order by 1"
    assert query(database, sql) == [("lost", None), ("yard", 25832)]
    assert query(database, "select distinct building_id from again_roofs") == [("yard",)]


def test_loading_needs_a_run_and_a_database(database, sample, tmp_path):
    with pytest.raises(InputError, match=r"buildings\.city\.jsonl"):
        load_postgis(tmp_path, database)
    with pytest.raises(OutputError, match="PostGIS database"):
        load_postgis(sample, f"postgresql://me@/postgres?host={tmp_path}")
    with pytest.raises(InputError, match="prefix"):
        load_postgis(sample, database, prefix="a; drop table")


@pytest.fixture
def empty_database(database):
    """A database of its own without PostGIS, gone afterwards."""
    with psycopg.connect(database, autocommit=True) as connection:
        connection.execute("create database fresh")
    yield database.replace("/postgres?", "/fresh?")
    with psycopg.connect(database, autocommit=True) as connection:
        connection.execute("drop database fresh with (force)")


def test_first_loads_at_once_wait_for_each_other(empty_database, sample):
    """Into a database without PostGIS, half of them into the same tables."""
    prefixes = ["same", "same", "same", "Same", "one", "two"]
    with ThreadPoolExecutor(len(prefixes)) as pool:
        counts = pool.map(lambda prefix: load_postgis(sample, empty_database, prefix), prefixes)
        assert list(counts) == [3] * len(prefixes)
    for prefix in {prefix.lower() for prefix in prefixes}:
        assert query(empty_database, f"select count(*) from {prefix}_buildings") == [(3,)]


def test_the_longest_prefix_keeps_every_index_apart(database, sample):
    longest = "p" * 48
    load_postgis(sample, database, longest)
    sql = "select count(*) from pg_indexes where starts_with(indexname, %s) and indexname not like "
    assert query(database, sql + "'%%pkey'", longest) == [(5,)]


@pytest.mark.parametrize("prefix", ["p" * 49, "größe", "a-b", "1st", "", "a b", "a\n"])
def test_other_prefixes_are_refused(database, sample, prefix):
    with pytest.raises(InputError, match="at most 48 letters"):
        load_postgis(sample, database, prefix)


def test_a_damaged_building_is_left_out_of_the_tables(database, run_of_two):
    folder, _ = run_of_two
    path = folder / "parameters.jsonl"
    path.write_text(path.read_text().replace('"type":"flat"', '"type":"igloo"'))
    remarks = []
    assert load_postgis(folder, database, "damaged", remarks.append) == 2
    assert len(remarks) == 1 and "building yard" in str(remarks[0]) and "igloo" in str(remarks[0])
    ids = query(database, "select id from damaged_buildings order by id")
    assert ids == [("house",), ("lost",)]
    assert query(database, "select distinct building_id from damaged_parts") == [("house",)]


def list_columns(database, table):
    sql = (
        "select column_name, data_type from information_schema.columns where table_name = %s "
        "order by ordinal_position"
    )
    return dict(query(database, sql, table))


def test_columns_are_typed_and_named_as_in_the_geopackage(database, run_of_two):
    folder, buildings = run_of_two
    load_postgis(folder, database, "typed")
    sql_types = {"float64": "double precision", "int64": "bigint", "object": "text"}
    tables = {"buildings": "buildings", "parts": "parts", "roof_surfaces": "roofs"}
    for layer, table in tables.items():
        info = pyogrio.read_info(folder / "buildings.gpkg", layer=layer)
        columns = list_columns(database, f"typed_{table}")
        assert list(columns) == ["run", *info["fields"], "geom"]
        types = [columns[name] for name in info["fields"]]
        assert types == [sql_types[kind] for kind in info["dtypes"]]
    sql = "select run, id, rf_volume_lod22, hiproof_points from typed_buildings where id = 'house'"
    volume = next(b.volume for b in buildings if b.id == "house")
    assert query(database, sql) == [("run", "house", pytest.approx(volume, abs=1e-3), 0)]


def write_run(folder, id, **attributes):
    """A run of one gable with these attributes."""
    folder.mkdir(parents=True)
    write_all(folder, [replace(reconstruct_gable(), id=id, attributes=attributes)], "EPSG:7415")
    return folder


def list_runs(database, prefix):
    return query(database, f"select run, id from {prefix}_buildings order by run, id")


def test_another_run_is_replaced_only_when_asked(database, tmp_path):
    first, second = (write_run(tmp_path / name, name) for name in ("first", "second"))
    load_postgis(first, database, "kept")
    with pytest.raises(OutputError, match=r"the run first of .*--replace .*--append"):
        load_postgis(second, database, "kept")
    assert list_runs(database, "kept") == [("first", "first")]
    load_postgis(second, database, "kept", replace=True)
    assert list_runs(database, "kept") == [("second", "second")]


def test_tables_that_no_load_has_noted_are_not_replaced(database, tmp_path):
    query(database, "create table precious_buildings (id text)")
    with pytest.raises(OutputError, match="another program"):
        load_postgis(write_run(tmp_path / "a", "a"), database, "precious")


def test_runs_are_added_beside_others_with_the_attributes_that_they_bring(database, tmp_path):
    first = write_run(tmp_path / "first", "a", year=1905, level=3)
    second = write_run(tmp_path / "second", "a", year="unknown", level=2.5, colour="red")
    load_postgis(first, database, "both")
    for _ in range(2):
        load_postgis(second, database, "both", append=True)
    sql = "select run, id, year, level, colour from both_buildings order by run"
    first_row = ("first", "a", "1905", 3.0, None)
    assert query(database, sql) == [first_row, ("second", "a", "unknown", 2.5, "red")]
    assert query(database, "select count(*) from both_roofs") == [(4,)]
    runs = query(database, "select run from both_runs order by 1")
    assert runs == [("first",), ("second",)]


def test_runs_of_one_name_are_told_apart_by_their_folders(database, tmp_path):
    load_postgis(write_run(tmp_path / "north" / "models", "a"), database, "names")
    south = write_run(tmp_path / "south" / "models", "b")
    with pytest.raises(OutputError, match=r"the run models of .*north.*--run"):
        load_postgis(south, database, "names", append=True)
    load_postgis(south, database, "names", name="south", append=True)
    assert list_runs(database, "names") == [("models", "a"), ("south", "b")]


def test_more_columns_than_postgresql_has_are_refused_before_anything_changes(database, tmp_path):
    many = {f"attribute_{k}": k for k in range(700)}
    others = {f"other_{k}": k for k in range(950)}
    load_postgis(write_run(tmp_path / "first", "a", **many), database, "wide")
    with pytest.raises(OutputError, match=r"at most 1600 columns in wide_buildings.*got 16\d\d"):
        load_postgis(write_run(tmp_path / "second", "b", **others), database, "wide", append=True)
    assert list_runs(database, "wide") == [("first", "a")]


def test_names_that_sql_does_not_like_are_columns(database, tmp_path):
    names = ['say "a"; --', "é" * 60, "é" * 60 + "x", "Year", "year", "100 %s", "run"]
    values = {name: number for number, name in enumerate(names, 1)}
    load_postgis(write_run(tmp_path / "a", "a", **values), database, "odd")
    (row,) = query(database, "select * from odd_buildings")
    got = dict(zip(list_columns(database, "odd_buildings"), row, strict=True))
    expected = {'say "a"; --': 1, "100 %s": 6, "Year": 4, "year_2": 5, "run_2": 7, "run": "a"}
    assert {name: got[name] for name in expected} == expected and row[0] == "a"


def test_models_that_ended_have_a_table_of_their_own(database, tmp_path):
    ended = {
        "id": "barn",
        "valid_from": None,
        "valid_to": "2024-05-01",
        "type": "gable",
        "z_ground": 0.0,
        "z_top": 8.0,
        "outline": [RING],
        "origin": [85000.0, 446000.0, 0.0],
        "parts": [{"type": "flat", "parameters": {}, "position": [0.0, 0.0, 8.0]}],
    }
    change = {"class": "changed", "places": [], "history": [ended]}
    write_all(tmp_path, [replace(reconstruct_gable(id="house"), change=change)], "EPSG:7415")
    for _ in range(2):
        assert load_postgis(tmp_path, database, prefix="ended") == 1
    columns = "id, successor, valid_to, z_top, GeometryType(geom), ST_Area(geom)"
    rows = query(database, f"select {columns} from ended_history")
    area = shapely.Polygon(RING).area
    assert rows == [("barn", "house", "2024-05-01", 8.0, "MULTIPOLYGON", area)]


@pytest.mark.parametrize("condition", ["", "&where=id <> 'none'"])
def test_solids_that_were_loaded_are_footprints(database, run_of_two, condition):
    folder, buildings = run_of_two
    load_postgis(folder, database, "outlines", replace=True)
    address = f"{database}&table=outlines_buildings&geometry=geom"
    found = read_footprints(address + condition)
    outlines = {f.id: f.polygon for f in found if not f.polygon.is_empty}
    roofs = {b.id: b.roof for b in buildings if b.built}
    assert outlines.keys() == roofs.keys()
    for id, roof in roofs.items():
        expected = shapely.transform(roof.outline, roof.frame.to_world)
        assert shapely.symmetric_difference(outlines[id], expected).area < 0.05
    assert footprint_crs(address).to_epsg() == 7415
