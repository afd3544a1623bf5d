"""Attributes that pyogrio cannot read pass through as text, in one remark, and refuse no file."""

import json

import numpy as np
import pytest
import shapely

from hiproof.city.plan.prepare import say_if_columns_run_out
from hiproof.errors import InputError, InputWarning
from hiproof.model import Footprint
from hiproof.read.outlines.footprints import read_footprints
from hiproof.write.tables.geopackage import attributes_with_a_column
from layers import open_geopackage, write_layer

SQUARES = [shapely.box(500000 + 20 * i, 4649776, 500010 + 20 * i, 4649786) for i in range(4)]


def write_geojson(path, **columns):
    """Four squares with an id h0, h1, ... and these attributes."""
    rows = [
        {"id": f"h{i}", **{name: values[i] for name, values in columns.items()}} for i in range(4)
    ]
    features = [
        {"type": "Feature", "properties": row, "geometry": shapely.geometry.mapping(square)}
        for row, square in zip(rows, SQUARES, strict=True)
    ]
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::32633"}}
    path.write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": features}))
    return path


def read_values(path, name, **options):
    """The attribute of each footprint, and the remarks that reading them made."""
    with pytest.warns(InputWarning) as remarks:
        footprints = read_footprints(path, **options)
    return [footprint.attributes.get(name) for footprint in footprints], [
        str(remark.message) for remark in remarks
    ]


ODD = {
    "the 30th of February": ["1999-12-31", "2024-02-30", None, "1998-01-01"],
    "the year nought": ["1999-12-31", "0000-01-01", None, "1998-01-01"],
}


@pytest.mark.parametrize("kind", ODD)
def test_one_impossible_date_refuses_no_file(tmp_path, kind):
    dates = ODD[kind]
    path = write_geojson(tmp_path / "a.geojson", built=dates, year=[1999, 2024, 2001, None])
    values, remarks = read_values(path, "built")
    assert values == dates
    assert len(remarks) == 1 and "read as text" in remarks[0] and remarks[0].endswith(": built")
    years = [footprint.attributes.get("year") for footprint in read_footprints(path)]
    assert years == [1999, 2024, 2001, None] and type(years[0]) is int


@pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")
def test_an_impossible_date_goes_with_conditions_and_boxes(tmp_path):
    path = write_geojson(
        tmp_path / "a.geojson", built=ODD["the 30th of February"], year=[1999, 2024, 2001, 1998]
    )
    footprints = read_footprints(
        path, where="year < 2010", target_crs="EPSG:32633", bbox=(500025, 4649776, 500080, 4649786)
    )
    assert [(footprint.id, footprint.attributes.get("built")) for footprint in footprints] == [
        ("h2", None),
        ("h3", "1998-01-01"),
    ]
    with pytest.raises(InputError, match="--where"):
        read_footprints(path, where="nonsense < 2010")


def test_a_date_of_a_shapefile_that_is_none_is_text(tmp_path):
    columns = {"id": np.arange(4), "built": np.array(["1999-12-31"] * 4, "datetime64[D]")}
    path = write_layer(tmp_path / "a.shp", SQUARES, columns, "EPSG:32633")
    table = (tmp_path / "a.dbf").read_bytes()
    (tmp_path / "a.dbf").write_bytes(table.replace(b"19991231", b"19500000", 1))
    assert read_values(path, "built")[0] == ["1950-00-00", "1999-12-31", "1999-12-31", "1999-12-31"]


def test_text_in_no_encoding_keeps_what_can_be_read(tmp_path):
    path, names = tmp_path / "a.gpkg", {"name": ["Straße", "b", "c", "d"]}
    write_layer(path, SQUARES, names, "EPSG:32633", SPATIAL_INDEX="NO")
    with open_geopackage(path) as base:
        base.execute("update a set name = cast(x'41ff42' as text) where name = 'b'")
    values, remarks = read_values(path, "name")
    assert values == ["Straße", "A\ufffdB", "c", "d"] and len(remarks) == 1


def test_several_odd_attributes_are_named_in_one_remark(tmp_path):
    lists = [[True, False], [True], [], None]
    path = write_geojson(
        tmp_path / "a.geojson", built=ODD["the year nought"], flags=lists, name=list("abcd")
    )
    values, remarks = read_values(path, "name")
    assert values == list("abcd") and len(remarks) == 1 and remarks[0].endswith(": built, flags")


def test_more_attributes_than_a_geopackage_has_columns_are_told_before_work(recwarn):
    def write_attributes(count):
        return (Footprint("a", SQUARES[0], {f"a{i}": i for i in range(count)}),)

    room = attributes_with_a_column()
    assert 1900 < room < 1998
    say_if_columns_run_out("f.gpkg", write_attributes(room))
    assert not recwarn
    remark = f"has 2,500 attributes; buildings.gpkg holds the first {room:,}"
    with pytest.warns(InputWarning, match=remark):
        say_if_columns_run_out("f.gpkg", write_attributes(2500))
