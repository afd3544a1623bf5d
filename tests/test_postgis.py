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


@pytest.fixture(scope="module")
def database():
    if explain_absence():
        pytest.skip(explain_absence())
    with running() as dsn:
        with psycopg.connect(dsn) as connection:
            connection.execute("create extension postgis")
        yield dsn


@pytest.fixture(scope="module")
def table(database):
    """Three rows: a square, two squares with one name, and one without geometry."""
    square = shapely.box(0, 0, 10, 10)
    pair = shapely.MultiPolygon([shapely.box(20, 0, 30, 10), shapely.box(40, 0, 50, 10)])
    with psycopg.connect(database) as connection:
        connection.execute(
            "create table houses (id text, storeys int, geom geometry(Geometry, 28992), extra "
            "geometry)"
        )
        for id, storeys, shape in (("a", 2, square), ("b", 3, pair), ("c", None, None)):
            wkb = shapely.to_wkb(shape) if shape is not None else None
            connection.execute(
                "insert into houses values (%s, %s, ST_SetSRID(%s::geometry, 28992))",
                (id, storeys, wkb),
            )
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
    with psycopg.connect(database) as connection:
        connection.execute("create sequence if not exists counter")
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


def test_models_load_once_however_often_they_are_loaded(database, tmp_path):
    write_sample_run(tmp_path / "run")
    lines = (tmp_path / "run" / "buildings.city.jsonl").read_text().splitlines()[1:]
    for _ in range(2):
        assert load_postgis(tmp_path / "run", database) == len(lines)
    with psycopg.connect(database) as connection:
        ids = [row[0] for row in connection.execute("select id from hiproof_buildings order by id")]
        assert ids == sorted(json.loads(line)["id"] for line in lines)
        sql = "select count(*), count(distinct building_id) from hiproof_roofs"
        roofs, with_roofs = connection.execute(sql).fetchone()
        assert roofs > with_roofs == 2
        kinds = connection.execute(
            "select distinct GeometryType(geom) from hiproof_buildings where geom is not null"
        ).fetchall()
        assert kinds == [("POLYHEDRALSURFACE",)]
        slopes = connection.execute(
            "select slope_deg, azimuth_deg from hiproof_roofs where building_id like 'house%'"
        ).fetchall()
        assert sorted(round(azimuth) for _, azimuth in slopes) == [90, 270]
        assert all(abs(slope - 36.87) < 0.01 for slope, _ in slopes)


def reconstruct_gable(rotation=0.0):
    """A gable of 12 by 8 m whose ridge runs east, or so many degrees to the north of it, built of
    its parameters.
    """
    ring = [[-6, -4], [6, -4], [6, 4], [-6, 4], [-6, -4]]
    part = {
        "type": "gable",
        "parameters": {"width": 8, "length": 12, "height": 3},
        "position": [0, 0, 5],
    }
    part["rotation"] = rotation
    place = {"origin": [85000, 446000, 0], "outline": [ring], "z_ground": 0}
    return hiproof.build({"id": "south", **place, "parts": [part]})


def nearly_level():
    """A shallow roof, which drains but does not slope to the eye."""
    ring = [[0, 0], [9, 0], [9, 6], [0, 6], [0, 0]]
    part = {
        "type": "monopitch",
        "parameters": {"width": 6, "length": 9, "height": 0.2},
        "position": [4.5, 3, 5],
    }
    return hiproof.build(
        {
            "id": "level",
            "origin": [85050, 446000, 0],
            "outline": [ring],
            "z_ground": 0,
            "parts": [part],
        }
    )


@pytest.fixture
def run_of_two(tmp_path):
    """Folder and buildings of a run as our writer leaves it: a gable, a courtyard, one without
    model.
    """
    part = {"type": "flat", "parameters": {"width": 8, "length": 12}, "position": [0, 0, 5]}
    yard = {"origin": [85040, 446000, 0], "outline": [RING, YARD], "z_ground": 0}
    buildings = [
        replace(reconstruct_gable(), id="house"),
        hiproof.build({"id": "yard", **yard, "parts": [part]}),
        make_lost_building(),
    ]
    (tmp_path / "run").mkdir()
    write_all(tmp_path / "run", buildings, "EPSG:7415")
    return tmp_path / "run", buildings


def test_columns_hold_what_the_models_say(database, run_of_two):
    folder, buildings = run_of_two
    load_postgis(folder, database, "told")
    with psycopg.connect(database) as connection:
        rows = connection.execute(
            "select id, hiproof_status, hiproof_roof_type from told_buildings order by id"
        ).fetchall()
        assert rows == sorted((b.id, b.status.code, b.type) for b in buildings)
        types = connection.execute(
            "select distinct building_id, type from told_roofs order by 1"
        ).fetchall()
        assert types == [("house", "gable"), ("yard", "flat")]
        rows = connection.execute(
            "select building_id, part, type, width, ridge_length from told_parts order by 1"
        )
        assert rows.fetchall() == [("house", 0, "gable", 8.0, None), ("yard", 0, "flat", 8.0, None)]
        sql = (
            "select GeometryType(geom), ST_Area(geom), area_m2 from told_parts where building_id = "
            "'house'"
        )
        assert connection.execute(sql).fetchone() == ("MULTIPOLYGON", 96.0, 96.0)


def test_roofs_are_measured_as_in_the_geopackage(database, tmp_path):
    """Also where models are written in a map that stretches them, and of faces too level to have an
    azimuth.
    """
    write_parameters(
        tmp_path / "parameters.jsonl", [reconstruct_gable(30.0), nearly_level()], "EPSG:7415"
    )
    build_file(
        tmp_path / "parameters.jsonl", tmp_path / "run", changes={"write": {"out_crs": "EPSG:3857"}}
    )
    load(tmp_path / "run", database, prefix="map")
    names = ["slope_deg", "azimuth_deg", "area_m2"]
    meta, _, _, columns = pyogrio.raw.read(
        tmp_path / "run" / "buildings.gpkg", layer="roof_surfaces", columns=names
    )
    with psycopg.connect(database) as connection:
        sql = f"select {', '.join(meta['fields'])} from map_roofs order by building_id desc, number"
        rows = np.array(connection.execute(sql).fetchall(), float)
    np.testing.assert_allclose(rows, np.array(columns).T, rtol=1e-4)


def read_documented_query(number, prefix):
    """A question of docs/tables.md, for the tables of a prefix."""
    return re.findall(r"```sql\n(.*?)```", (DOCS / "tables.md").read_text(), re.DOTALL)[
        number
    ].replace("hiproof_", f"{prefix}_")


def test_the_documented_question_of_a_solar_map(database, tmp_path):
    """Roof surfaces of 20 m2 or more that look between south-east and south-west, as docs/tables.md
    asks for them.
    """
    house = reconstruct_gable()
    (tmp_path / "run").mkdir()
    write_all(tmp_path / "run", [house], "EPSG:7415")
    load_postgis(tmp_path / "run", database, "solar")
    with psycopg.connect(database) as connection:
        rows = connection.execute(read_documented_query(1, "solar")).fetchall()
    assert [(id, kind, round(azimuth)) for id, kind, azimuth, *_ in rows] == [
        ("south", "gable", 180)
    ]


def test_the_documented_question_of_rectangles(database, tmp_path):
    """A part is drawn where it shows, and its whole rectangle is made of its columns."""
    house = reconstruct_gable(rotation=30.0)
    (tmp_path / "run").mkdir()
    write_all(tmp_path / "run", [house], "EPSG:7415")
    load_postgis(tmp_path / "run", database, "whole")
    with psycopg.connect(database) as connection:
        ((_, _, rectangle),) = connection.execute(read_documented_query(0, "whole")).fetchall()
        (geometry,) = connection.execute("select ST_AsBinary(geom) from whole_parts").fetchone()
    expected = affinity.translate(affinity.rotate(shapely.box(-6, -4, 6, 4), 30.0), 85000, 446000)
    assert shapely.from_wkb(rectangle).symmetric_difference(expected).area < 0.01
    outline = shapely.box(84994, 445996, 85006, 446004)
    assert shapely.from_wkb(geometry).symmetric_difference(outline).area < 0.01


def test_postgis_computes_the_volumes_that_the_attributes_name(database, run_of_two):
    folder, buildings = run_of_two
    load_postgis(folder, database, "volumes")
    with psycopg.connect(database) as connection:
        if not connection.execute(
            "select 1 from pg_available_extensions where name = 'postgis_sfcgal'"
        ).fetchone():
            pytest.skip("PostGIS was built without SFCGAL, which computes volumes")
        extension, question = read_documented_query(2, "volumes").split(";\n", 1)
        connection.execute(extension)
        volumes = dict(connection.execute(question).fetchall())
    assert volumes == pytest.approx(
        {b.id: roof_figures(b.solid).volume_m3 for b in buildings if b.built}, abs=0.0005
    )


def test_loading_again_replaces_the_run_whatever_its_reference_system(database, run_of_two):
    folder, buildings = run_of_two
    load_postgis(folder, database, "again")
    write_all(folder, buildings[1:], "EPSG:25832")
    load_postgis(folder, database, "again")
    with psycopg.connect(database) as connection:
        tables = connection.execute(
            "select distinct id, ST_SRID(geom) from again_buildings order by 1"
        ).fetchall()
        assert tables == [("lost", None), ("yard", 25832)]
        assert connection.execute("select distinct building_id from again_roofs").fetchall() == [
            ("yard",)
        ]


def test_loading_needs_a_run_and_a_database(database, tmp_path):
    with pytest.raises(InputError, match=r"buildings\.city\.jsonl"):
        load_postgis(tmp_path, database)
    write_sample_run(tmp_path / "run")
    with pytest.raises(OutputError, match="PostGIS database"):
        load_postgis(tmp_path / "run", f"postgresql://me@/postgres?host={tmp_path}")
    with pytest.raises(InputError, match="prefix"):
        load_postgis(tmp_path / "run", database, prefix="a; drop table")


@pytest.fixture
def empty_database(database):
    """A database of its own without PostGIS, gone afterwards."""
    with psycopg.connect(database, autocommit=True) as connection:
        connection.execute("create database fresh")
    yield database.replace("/postgres?", "/fresh?")
    with psycopg.connect(database, autocommit=True) as connection:
        connection.execute("drop database fresh with (force)")


def test_first_loads_at_once_wait_for_each_other(empty_database, tmp_path):
    """Into a database without PostGIS, half of them into the same tables."""
    write_sample_run(tmp_path / "run")
    prefixes = ["same", "same", "same", "Same", "one", "two"]
    with ThreadPoolExecutor(len(prefixes)) as pool:
        counts = list(
            pool.map(
                lambda prefix: load_postgis(tmp_path / "run", empty_database, prefix), prefixes
            )
        )
    assert counts == [3] * len(prefixes)
    with psycopg.connect(empty_database) as connection:
        for prefix in {prefix.lower() for prefix in prefixes}:
            assert connection.execute(f"select count(*) from {prefix}_buildings").fetchone() == (3,)


def test_the_longest_prefix_keeps_every_index_apart(database, tmp_path):
    write_sample_run(tmp_path / "run")
    longest = "p" * 48
    load_postgis(tmp_path / "run", database, longest)
    with psycopg.connect(database) as connection:
        indexes = connection.execute(
            "select count(*) from pg_indexes where indexname like %s and indexname not like "
            "'%%pkey'",
            (longest + "%",),
        )
        assert indexes.fetchone() == (5,)


@pytest.mark.parametrize("prefix", ["p" * 49, "größe", "a-b", "1st", "", "a b", "a\n"])
def test_other_prefixes_are_refused(database, tmp_path, prefix):
    write_sample_run(tmp_path / "run")
    with pytest.raises(InputError, match="at most 48 letters"):
        load_postgis(tmp_path / "run", database, prefix)


def test_a_damaged_building_is_left_out_of_the_tables(database, run_of_two):
    folder, _ = run_of_two
    path = folder / "parameters.jsonl"
    path.write_text(path.read_text().replace('"type":"flat"', '"type":"igloo"'))
    remarks = []
    assert load_postgis(folder, database, "damaged", remarks.append) == 2
    assert len(remarks) == 1 and "building yard" in str(remarks[0]) and "igloo" in str(remarks[0])
    with psycopg.connect(database) as connection:
        ids = connection.execute("select id from damaged_buildings order by id").fetchall()
        assert ids == [("house",), ("lost",)]
        assert connection.execute("select distinct building_id from damaged_parts").fetchall() == [
            ("house",)
        ]


def list_columns(connection, table):
    sql = (
        "select column_name, data_type from information_schema.columns where table_name = %s "
        "order by ordinal_position"
    )
    return dict(connection.execute(sql, (table,)).fetchall())


def test_columns_are_typed_and_named_as_in_the_geopackage(database, run_of_two):
    folder, buildings = run_of_two
    load_postgis(folder, database, "typed")
    with psycopg.connect(database) as connection:
        for layer, table in (
            ("buildings", "buildings"),
            ("parts", "parts"),
            ("roof_surfaces", "roofs"),
        ):
            info = pyogrio.read_info(folder / "buildings.gpkg", layer=layer)
            columns = list_columns(connection, f"typed_{table}")
            assert list(columns) == ["run", *info["fields"], "geom"]
            sql_types = {"float64": "double precision", "int64": "bigint", "object": "text"}
            assert [columns[name] for name in info["fields"]] == [
                sql_types[kind] for kind in info["dtypes"]
            ]
        told = connection.execute(
            "select run, id, rf_volume_lod22, hiproof_points from typed_buildings "
            "where id = 'house'"
        ).fetchone()
    volume = next(b.volume for b in buildings if b.id == "house")
    assert told == ("run", "house", pytest.approx(volume, abs=1e-3), 0)


def write_run(folder, id, **attributes):
    """A run of one gable with these attributes."""
    folder.mkdir(parents=True)
    write_all(folder, [replace(reconstruct_gable(), id=id, attributes=attributes)], "EPSG:7415")
    return folder


def list_runs(database, prefix):
    with psycopg.connect(database) as connection:
        sql = f"select run, id from {prefix}_buildings order by run, id"
        return connection.execute(sql).fetchall()


def test_another_run_is_replaced_only_when_asked(database, tmp_path):
    first, second = (write_run(tmp_path / name, name) for name in ("first", "second"))
    load_postgis(first, database, "kept")
    with pytest.raises(OutputError, match=r"the run first of .*--replace .*--append"):
        load_postgis(second, database, "kept")
    assert list_runs(database, "kept") == [("first", "first")]
    load_postgis(second, database, "kept", replace=True)
    assert list_runs(database, "kept") == [("second", "second")]


def test_tables_that_no_load_has_noted_are_not_replaced(database, tmp_path):
    with psycopg.connect(database) as connection:
        connection.execute("create table precious_buildings (id text)")
    with pytest.raises(OutputError, match="another program"):
        load_postgis(write_run(tmp_path / "a", "a"), database, "precious")


def test_runs_are_added_beside_others_with_the_attributes_that_they_bring(database, tmp_path):
    first = write_run(tmp_path / "first", "a", year=1905, level=3)
    second = write_run(tmp_path / "second", "a", year="unknown", level=2.5, colour="red")
    load_postgis(first, database, "both")
    for _ in range(2):
        load_postgis(second, database, "both", append=True)
    with psycopg.connect(database) as connection:
        sql = "select run, id, year, level, colour from both_buildings order by run"
        assert connection.execute(sql).fetchall() == [
            ("first", "a", "1905", 3.0, None),
            ("second", "a", "unknown", 2.5, "red"),
        ]
        assert connection.execute("select count(*) from both_roofs").fetchone() == (4,)
        assert connection.execute("select run from both_runs order by 1").fetchall() == [
            ("first",),
            ("second",),
        ]


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
    names = {
        'say "a"; --': 1,
        "é" * 60: 2,
        "é" * 60 + "x": 3,
        "Year": 4,
        "year": 5,
        "100 %s": 6,
        "run": 7,
    }
    load_postgis(write_run(tmp_path / "a", "a", **names), database, "odd")
    with psycopg.connect(database) as connection:
        row = connection.execute("select * from odd_buildings").fetchone()
        columns = list(list_columns(connection, "odd_buildings"))
    assert [row[columns.index(name)] for name in ('say "a"; --', "100 %s", "Year", "year_2")] == [
        1,
        6,
        4,
        5,
    ]
    assert row[columns.index("run_2")] == 7 and row[0] == "a"


def test_models_that_ended_have_a_table_of_their_own(database, tmp_path):
    house = replace(reconstruct_gable(), id="house")
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
    write_all(tmp_path, [replace(house, change=change)], "EPSG:7415")
    for _ in range(2):
        assert load_postgis(tmp_path, database, prefix="ended") == 1
    with psycopg.connect(database) as connection:
        rows = connection.execute(
            "select id, successor, valid_to, z_top, GeometryType(geom), ST_Area(geom) "
            "from ended_history"
        ).fetchall()
    area = shapely.Polygon(RING).area
    assert rows == [("barn", "house", "2024-05-01", 8.0, "MULTIPOLYGON", area)]


@pytest.mark.parametrize("condition", ["", "&where=id <> 'none'"])
def test_solids_that_were_loaded_are_footprints(database, run_of_two, condition):
    folder, buildings = run_of_two
    load_postgis(folder, database, "outlines", replace=True)
    found = read_footprints(f"{database}&table=outlines_buildings&geometry=geom{condition}")
    outlines = {f.id: f.polygon for f in found if not f.polygon.is_empty}
    expected = {
        building.id: shapely.transform(building.roof.outline, building.roof.frame.to_world)
        for building in buildings
        if building.built
    }
    assert outlines.keys() == expected.keys()
    for id, outline in outlines.items():
        assert shapely.symmetric_difference(outline, expected[id]).area < 0.05
    assert footprint_crs(f"{database}&table=outlines_buildings&geometry=geom").to_epsg() == 7415
