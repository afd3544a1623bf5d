"""A plain GeoPackage is read as GDAL reads it, and an unusual one is left to GDAL."""

import sqlite3
from contextlib import closing

import numpy as np
import pyogrio
import pytest
import shapely

from hiproof.read.footprints import attribute_rows
from hiproof.read.plain_geopackage import read_plain_crs, read_plain_geopackage
from hiproof.read.vector_file import read_vector_file, vector_file_crs

SQUARES = [shapely.box(x, 0, x + 1, 1) for x in range(3)]
GEOMETRIES = np.array([*shapely.to_wkb([*SQUARES, shapely.MultiPolygon(SQUARES[::2])]), None])
COLUMNS = {
    "name": np.array(["a", "Straße", "", None, 'so "called"'], dtype=object),
    "year": np.array([1950, 2**62, -1, 0, 7]),
    "floors": np.array([1, 2, 3, 4, 5], dtype=np.int32),
    "height": np.array([1.5, np.nan, 0.1, -0.0, 1e300]),
    "listed": np.array([True, False, True, True, False]),
}


def write(path, columns=COLUMNS, mask=(False, True, False, False, False), **options):
    """A GeoPackage by GDAL, where the second feature lacks each value that is no text."""
    options = {"geometry_type": "Unknown", "crs": "EPSG:28992", "layer": "houses"} | options
    masks = [None if values.dtype == object else np.array(mask) for values in columns.values()]
    pyogrio.raw.write(path, GEOMETRIES, list(columns.values()), list(columns), masks, **options)
    return path


@pytest.mark.parametrize("layer", [None, "houses"])
def test_a_plain_file_reads_as_by_gdal(tmp_path, layer):
    path = write(tmp_path / "a.gpkg")
    plain = read_plain_geopackage(path, layer)
    by_gdal = read_vector_file(path, layer, None, lambda crs: None)
    for (meta, numbers, geometries, columns), (want_meta, *want) in ((plain, by_gdal),):
        assert meta["crs"] == want_meta["crs"] == "EPSG:28992"
        assert numbers.tolist() == want[0].tolist() == [1, 2, 3, 4, 5]
        assert shapely.equals_identical(geometries[:4], want[1][:4]).all()
        assert geometries[4] is want[1][4] is None
        rows = attribute_rows(meta["fields"], columns, 5)
        assert rows == attribute_rows(list(want_meta["fields"]), want[2], 5)
        assert rows[0] == {"name": "a", "year": 1950, "floors": 1, "height": 1.5, "listed": True}
        assert rows[1] == {"name": "Straße"}
        assert [list(map(type, row.values())) for row in rows[:1]] == [[str, int, int, float, bool]]
    assert read_plain_crs(path, layer) == vector_file_crs(path, layer)


def change(path, statement):
    """The file after a statement; its triggers are GDAL's, which knows functions that they call."""
    with closing(sqlite3.connect(path)) as database:
        triggers = database.execute("select name from sqlite_master where type = 'trigger'")
        for (trigger,) in triggers.fetchall():
            database.execute(f'drop trigger "{trigger}"')
        database.execute(statement)
        database.commit()
    return path


@pytest.mark.parametrize(
    "statement",
    [
        "alter table houses add column built DATE",
        "update houses set year = 'old' where fid = 2",
        "update houses set name = cast(x'ff' as text) where fid = 2",
        "update houses set geom = x'00' where fid = 2",
        "update gpkg_geometry_columns set geometry_type_name = 'CURVEPOLYGON'",
        "update gpkg_spatial_ref_sys set organization = 'NONE' where srs_id = 28992",
        "delete from houses",
    ],
)
def test_an_unusual_file_is_left_to_gdal(tmp_path, statement):
    path = change(write(tmp_path / "a.gpkg"), statement)
    assert read_plain_geopackage(path, None) is None


def test_of_several_layers_none_is_chosen(tmp_path):
    path = write(write(tmp_path / "a.gpkg"), layer="sheds", append=False)
    assert read_plain_geopackage(path, None) is None
    assert read_plain_geopackage(path, "trees") is None
    assert len(read_plain_geopackage(path, "sheds")[1]) == 5
