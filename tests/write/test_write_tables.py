"""parameters.jsonl and buildings.gpkg: what goes in comes out, whatever the attributes are."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pyogrio
import pytest
import shapely
from pyproj import CRS

from handmade import RD_ORIGIN, box, courtyard, gable_house, make_building, make_lost_building
from hiproof import build, read_parameters
from hiproof.errors import InputError
from hiproof.parametric.run import build_file
from hiproof.write import write_attributes, write_parameters
from hiproof.write.head import FileHead
from hiproof.write.tables import vector_layer
from hiproof.write.tables.geopackage import attributes_with_a_column
from hiproof.write.tables.geoparquet import GEOMETRY_TYPES, GeoParquetWriter
from hiproof.write.tables.rows import part_rows


def table(tmp_path, buildings, crs="EPSG:7415"):
    """Columns by name, and geometries, of the GeoPackage written."""
    write_attributes(tmp_path / "a.gpkg", buildings, crs)
    meta, _, wkb, columns = pyogrio.raw.read(tmp_path / "a.gpkg", layer="buildings")
    return dict(zip(meta["fields"], columns, strict=True)), shapely.from_wkb(wkb), meta


def test_parameters_come_back(tmp_path):
    building = make_building(gable_house(), kinds=("gable", "flat"), objective=-12.3456789)
    write_parameters(tmp_path / "p.jsonl", [make_lost_building(), building])
    lost, record = read_parameters(tmp_path / "p.jsonl")
    assert [lost[name] for name in ("id", "status", "type")] == ["lost", "no_points", None]
    assert lost["parts"] == [] and [p["type"] for p in record["parts"]] == ["gable", "flat"]
    part = record["parts"][0]
    assert part["parameters"] == {"width": 8.0, "height": 4.0}
    assert record["origin"] == RD_ORIGIN.tolist()
    assert part["position"] == [0.1, -0.2, 3.0]
    assert part["rotation"] == pytest.approx(np.degrees(0.25), abs=1e-6)
    assert record["objective"] == -12.345679
    assert record["residuals"]["psd_mean"] == 0.05
    assert record["residuals"]["psd_std"] is None


def test_of_thousands_of_attributes_a_table_holds_the_first_and_all_of_our_own(tmp_path):
    """SQLite has 2,000 columns at most: the table failed when all work was done, as if the disk
    were full.
    """
    building = make_building(box())
    attributes = building.attributes | {f"a{i}": i for i in range(2500)}
    columns_of_few, _, _ = table(tmp_path, [building])
    columns, _, _ = table(tmp_path, [replace(building, attributes=attributes)])
    assert set(columns_of_few) < set(columns) and len(columns) == 1998
    room = attributes_with_a_column()
    assert all(columns[f"a{i}"][0] == i for i in range(room)) and "a2499" not in columns


def test_outlines_come_back(tmp_path):
    building = make_building(courtyard())
    write_parameters(tmp_path / "p.jsonl", [building])
    (record,) = read_parameters(tmp_path / "p.jsonl")
    ((outer, *holes),) = record["parts"][0]["outlines"]
    assert shapely.Polygon(outer, holes).equals(building.parts[0].pieces[0].outline)


def test_parameters_are_strict_json(tmp_path):
    building = make_building(box(), objective=float("nan"))
    odd = {"parameters": {"width": float("nan")}, "translation": np.array([0, -0.0, np.inf])}
    roof = replace(building.roof, parts=(replace(building.parts[0], **odd),))
    building = replace(building, built=replace(building.model, roof=roof))
    write_parameters(tmp_path / "p.jsonl", [building])
    text = (tmp_path / "p.jsonl").read_text()
    record = json.loads(
        text.splitlines()[1], parse_constant=lambda name: pytest.fail(f"{name} is no JSON")
    )
    (part,) = record["parts"]
    assert part["parameters"] == {"width": None}
    assert part["position"] == [0.0, 0.0, None]
    assert "-0.0" not in text


@pytest.mark.parametrize("content", ["{", "[1]\n", '{"id": 1}\n', "\x00\x01"])
def test_a_file_that_is_no_parameters_file(tmp_path, content):
    (tmp_path / "p.jsonl").write_text(content)
    with pytest.raises(InputError, match=r"(first line|line 1) of .*p\.jsonl"):
        read_parameters(tmp_path / "p.jsonl")


def test_a_parameters_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="check the path"):
        read_parameters(tmp_path / "p.jsonl")


def test_the_table_has_every_building(tmp_path):
    square = shapely.box(85000, 446000, 85001, 446001)
    lost = [make_lost_building(), make_lost_building("asked", footprint=square)]
    built = [make_building(gable_house()), make_building(courtyard())]
    columns, outlines, meta = table(tmp_path, [*lost, *built])
    assert columns["id"].tolist() == ["lost", "asked", "a", "a"]
    assert columns["hiproof_status"].tolist() == ["no_points", "no_points", "modelled", "modelled"]
    assert columns["rf_volume_lod22"][2:].tolist() == [480.0, 420.0]
    assert outlines[0] is None
    assert [outline.area for outline in outlines[1:]] == [1.0, 96.0, 100.0]
    assert (meta["crs"], meta["geometry_type"]) == ("EPSG:28992", "MultiPolygon")


def test_a_footprint_without_area_is_no_geometry_as_in_what_is_built_of_its_parameters(tmp_path):
    void = make_lost_building("void", footprint=shapely.Polygon())
    write_attributes(tmp_path / "a.gpkg", [void], "EPSG:7415")
    write_parameters(tmp_path / "p.jsonl", [void], "EPSG:7415")
    build_file(tmp_path / "p.jsonl", tmp_path / "built")
    assert (tmp_path / "built/buildings.gpkg").read_bytes() == (tmp_path / "a.gpkg").read_bytes()
    assert table(tmp_path, [void])[1].tolist() == [None]


@pytest.mark.parametrize(
    "values, dtype, want",
    [
        ([1, 2, None], "float64", [1, 2, np.nan]),
        ([1, 2, 3], "int64", [1, 2, 3]),
        ([1, 2.5, True], "float64", [1, 2.5, 1]),
        ([True, 2, 3], "int64", [1, 2, 3]),
        ([True, False, True], "bool", [True, False, True]),
        ([1, "x", None], "object", ["1", "x", None]),
        ([None, None, None], "object", [None, None, None]),
        ([2**70, 1, 2], "object", [str(2**70), "1", "2"]),
        ([float("nan"), 1, np.int32(2)], "float64", [np.nan, 1, 2]),
    ],
)
def test_a_column_has_one_type(tmp_path, values, dtype, want):
    lost = [make_lost_building(attributes={"v": value}) for value in values]
    columns, _, _ = table(tmp_path, lost)
    assert columns["v"].dtype == dtype
    np.testing.assert_array_equal(columns["v"], np.array(want, dtype=columns["v"].dtype))


def test_unknown_figures_stay_numbers_and_counts_stay_counts(tmp_path):
    _, _, meta = table(tmp_path, [make_lost_building()])
    kinds = dict(zip(meta["fields"], meta["dtypes"], strict=True))
    figures = ("rf_h_ground", "hiproof_psd_mean", "hiproof_iso19107_lod22")
    assert [kinds[name] for name in figures] == ["float64", "float64", "object"]
    counts = {"buildings": ["rf_roof_n_surfaces"], "parts": ["part"]}
    for layer, names in (counts | {"roof_surfaces": ["number", "part"]}).items():
        info = pyogrio.read_info(tmp_path / "a.gpkg", layer=layer)
        kinds = dict(zip(info["fields"], info["ogr_types"], strict=True))
        assert {kinds[name] for name in names} == {"OFTInteger64"}


def test_names_that_clash(tmp_path):
    clashing = {"fid": 7, "geom": "x", "ID": 3, "Name": 1, "name": 2, "hiproof_status": "theirs"}
    columns, _, _ = table(tmp_path, [make_building(box(), attributes=clashing)])
    expected = {"id": "a", "hiproof_status": "modelled"}
    expected |= {"fid_2": 7, "geom_2": "x", "name_2": 2, "ID_input": 3}
    assert {name: columns[name][0] for name in expected} == expected


def test_many_rows_are_written_in_batches(tmp_path, monkeypatch):
    monkeypatch.setattr(vector_layer, "BATCH_ROWS", 4)
    lost = [make_lost_building(str(n), attributes={"n": n}) for n in range(11)]
    columns, _, _ = table(tmp_path, lost)
    assert columns["n"].tolist() == list(range(11))


def test_nothing_is_said_where_no_crs_is_known(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _, _, meta = table(tmp_path, [make_building(box())], crs=None)
    assert meta["fields"][0] == "id"


def test_other_programs_find_features_by_their_place_and_keep_the_index(tmp_path):
    """GDAL finds features by the spatial index, and the triggers keep up with what it adds."""
    squares = [shapely.box(x, 0, x + 1, 1) for x in range(0, 100, 10)]
    buildings = [make_lost_building(str(n), footprint=square) for n, square in enumerate(squares)]
    write_attributes(tmp_path / "a.gpkg", buildings, "EPSG:28992")

    def find(box):
        meta, _, _, columns = pyogrio.raw.read(tmp_path / "a.gpkg", layer="buildings", bbox=box)
        return columns[meta["fields"].tolist().index("id")].tolist()

    assert find((19, 0, 41, 1)) == ["2", "3", "4"]
    added = np.array([shapely.to_wkb(shapely.box(200, 0, 201, 1))], dtype=object)
    names = [np.array(["new"], dtype=object)]
    options = {"layer": "buildings", "driver": "GPKG", "promote_to_multi": True}
    pyogrio.raw.write(
        tmp_path / "a.gpkg", added, names, ["id"], append=True, crs="EPSG:28992", **options
    )
    assert find((199, 0, 210, 1)) == ["new"]
    bounds = pyogrio.read_info(tmp_path / "a.gpkg", layer="buildings")["total_bounds"]
    assert bounds == (0.0, 0.0, 201.0, 1.0)


DERIVED = CRS.from_wkt(
    'DERIVEDPROJCRS["site",BASEPROJCRS["UTM 31N",BASEGEOGCRS["WGS 84",DATUM["World Geodetic '
    'System 1984",ELLIPSOID["WGS 84",6378137,298.257223563]]],CONVERSION["UTM zone 31N",METHOD['
    '"Transverse Mercator",ID["EPSG",9807]],PARAMETER["Longitude of natural origin",3,ANGLEUNIT['
    '"degree",0.0174532925199433]],PARAMETER["Scale factor at natural origin",0.9996]]],'
    'DERIVINGCONVERSION["turned",METHOD["Affine parametric transformation",ID["EPSG",9624]],'
    'PARAMETER["A0",1,LENGTHUNIT["metre",1]],PARAMETER["A1",1],PARAMETER["A2",0],PARAMETER["B0",0,'
    'LENGTHUNIT["metre",1]],PARAMETER["B1",0],PARAMETER["B2",1]],CS[Cartesian,2],AXIS["(E)",east],'
    'AXIS["(N)",north],LENGTHUNIT["metre",1]]'
)


@pytest.mark.parametrize(
    "crs", [CRS("EPSG:28992"), CRS("+proj=tmerc +lat_0=52 +lon_0=5 +ellps=bessel"), DERIVED]
)
def test_the_crs_comes_back_whether_it_has_a_code_or_not(tmp_path, crs):
    _, _, meta = table(tmp_path, [make_building(box())], crs)
    assert CRS(meta["crs"]) == crs


def test_a_part_that_nothing_shows_of_has_no_row():
    ring = [[0, 0], [10, 0], [10, 6], [0, 6]]
    flat = {"type": "flat", "parameters": {"width": 6, "length": 10}, "position": [5, 3, 4]}
    hidden = {"type": "flat", "parameters": {"width": 4, "length": 4}, "position": [5, 3, 3]}
    record = {"id": "a", "origin": [0, 0, 0], "z_ground": 0, "outline": [ring]}
    building = build(record | {"parts": [flat, hidden]})
    (row,) = part_rows(building)
    assert row[0] is not None and row[1]["part"] == 0


def street():
    attributes = {"year": 1905, "name": "Oude Kerk", "listed": True}
    yield make_building(gable_house(), attributes=attributes)
    yield make_building(courtyard(), id="block", attributes={"year": 1999.5})
    yield make_lost_building()


@pytest.mark.parametrize("layer", GEOMETRY_TYPES)
def test_the_same_rows_as_the_geopackage(tmp_path, layer):
    pq = pytest.importorskip("pyarrow.parquet", reason="needs pyarrow, part of the extra `city`")
    write_attributes(tmp_path / "b.gpkg", street(), "EPSG:7415")
    GeoParquetWriter(tmp_path / "b.parquet", FileHead("EPSG:7415"), layer).add_all(street())
    table = pq.read_table(tmp_path / "b.parquet")
    meta, _, wkb, columns = pyogrio.raw.read(tmp_path / "b.gpkg", layer=layer)
    assert table.column_names == [*meta["fields"], "geometry"]
    for name, expected in zip(meta["fields"], columns, strict=True):
        for got, value in zip(table[name].to_pylist(), expected.tolist(), strict=True):
            missing = value is None or (isinstance(value, float) and np.isnan(value))
            assert got is None if missing else got == value
    for got, expected in zip(table["geometry"].to_pylist(), wkb, strict=True):
        assert (got is None) == (expected is None)
        assert got is None or shapely.from_wkb(got).equals(shapely.from_wkb(expected))


def test_an_attribute_called_geometry_stands_beside_the_outline(tmp_path):
    pq = pytest.importorskip("pyarrow.parquet", reason="needs pyarrow, part of the extra `city`")
    house = make_building(gable_house(), attributes={"geometry": "poly", "Geometry": 1})
    GeoParquetWriter(tmp_path / "b.parquet", FileHead("EPSG:7415")).add_all([house])
    (row,) = pq.read_table(tmp_path / "b.parquet").to_pylist()
    assert (row["geometry_2"], row["Geometry_3"]) == ("poly", 1)
    assert shapely.from_wkb(row["geometry"]).area == pytest.approx(96.0)


def test_the_file_describes_its_geometry(tmp_path):
    pq = pytest.importorskip("pyarrow.parquet", reason="needs pyarrow, part of the extra `city`")
    with GeoParquetWriter(tmp_path / "b.parquet", FileHead("EPSG:7415")):
        pass
    geo = json.loads(pq.read_schema(tmp_path / "b.parquet").metadata[b"geo"])
    assert geo["primary_column"] == "geometry"
    assert geo["columns"]["geometry"]["encoding"] == "WKB"
    assert geo["columns"]["geometry"]["crs"]["id"] == {"authority": "EPSG", "code": 28992}


def test_without_pyarrow_one_sentence_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"hiproof\[parquet\]"):
        GeoParquetWriter(tmp_path / "b.parquet", FileHead())
    assert not list(tmp_path.iterdir())
