"""buildings.parquet holds what buildings.gpkg holds, in a form that columnar tools read."""

import json

import numpy as np
import pyogrio
import pytest
import shapely

from handmade import courtyard, gable_house, make_building, make_lost_building
from hiproof.errors import InputError
from hiproof.write.head import FileHead
from hiproof.write.tables.geopackage import write_attributes
from hiproof.write.tables.geoparquet import GEOMETRY_TYPES, GeoParquetWriter


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
