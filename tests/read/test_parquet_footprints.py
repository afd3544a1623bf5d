"""GeoParquet footprints: what comes back is what other formats give, whatever the encoding, and of
a file with boxes only the row groups around the box asked for are read.
"""

import json

import numpy as np
import pytest
import shapely
from pyproj import CRS

from hiproof.errors import InputError
from hiproof.read.outlines.footprints import footprint_crs, read_footprints
from layers import write_layer
from range_server import serve

pyarrow = pytest.importorskip("pyarrow", reason="the extra `parquet` is not installed")
parquet = pytest.importorskip("pyarrow.parquet")

RD = CRS.from_epsg(28992)
RD_JSON = RD.to_json_dict()
HOLE = [(85002, 446002), (85004, 446002), (85004, 446004), (85002, 446004)]
HOLED = shapely.Polygon(shapely.box(85000, 446000, 85010, 446010).exterior, [HOLE])
SIDES = ("xmin", "ymin", "xmax", "ymax")


def shift(polygon, x):
    return shapely.transform(polygon, lambda xy: xy + [x, 0])


SHAPES = [shift(HOLED, 20 * i) for i in range(9)]
IDS = [f"h{i}" for i in range(9)]
YEARS = [None if i == 4 else 1900 + i for i in range(9)]


def write(path, geometry, encoding="WKB", covering=None, crs=RD_JSON, **columns):
    """A file of the `columns` and a geometry column, in row groups of three rows."""
    metadata = {"encoding": encoding, "geometry_types": ["Polygon"]}
    metadata |= {"crs": crs} if crs != "absent" else {}
    if covering:
        columns["box"] = [dict(zip(SIDES, b, strict=True)) for b in covering]
        metadata["covering"] = {"bbox": {side: ["box", side] for side in SIDES}}
    geo = {"version": "1.1.0", "primary_column": "outline", "columns": {"outline": metadata}}
    table = pyarrow.table({**columns, "outline": geometry})
    table = table.replace_schema_metadata({"geo": json.dumps(geo)})
    parquet.write_table(table, path, row_group_size=3)
    return path


def boxes(shapes):
    return shapely.bounds(shapes).tolist()


def rings(polygon):
    return [
        [{"x": x, "y": y} for x, y in ring.coords]
        for ring in (polygon.exterior, *polygon.interiors)
    ]


def in_lists(shapes, kind):
    """Shapes as the format's own lists of coordinates, None where there is none."""
    point = pyarrow.struct([("x", pyarrow.float64()), ("y", pyarrow.float64())])
    surface = pyarrow.list_(pyarrow.list_(point))
    if kind == "polygon":
        return pyarrow.array([s and rings(s) for s in shapes], surface)
    parts = [s and [rings(part) for part in shapely.get_parts(s)] for s in shapes]
    return pyarrow.array(parts, pyarrow.list_(surface))


@pytest.mark.parametrize("has_boxes", [True, False])
@pytest.mark.parametrize("encoding", ["WKB", "polygon", "multipolygon"])
def test_a_file_gives_what_a_geopackage_gives(tmp_path, encoding, has_boxes):
    wkb = shapely.to_wkb(SHAPES)
    geometry = wkb.tolist() if encoding == "WKB" else in_lists(SHAPES, encoding)
    path = write(
        tmp_path / "a.parquet",
        geometry,
        encoding,
        boxes(SHAPES) if has_boxes else None,
        id=IDS,
        year=YEARS,
        height=pyarrow.array([0.2] * 9, pyarrow.float32()),
    )
    years, gap = np.array([y or 0 for y in YEARS], np.int32), np.array([y is None for y in YEARS])
    columns, masks = {"id": IDS, "year": years, "height": np.full(9, 0.2)}, [None, gap, None]
    geopackage = write_layer(tmp_path / "a.gpkg", SHAPES, columns, field_mask=masks)
    assert footprint_crs(path) == RD
    for options in (
        {},
        {"where": "year > 1904 and id <> 'h8'"},
        {"where": "year is null"},
        {"bbox": (85045, 446000, 85075, 446001), "target_crs": RD},
        {"bbox": (85045, 446000, 85075, 446001), "target_crs": RD, "where": "year = 1903"},
    ):
        assert read_footprints(path, **options) == read_footprints(geopackage, **options)


def test_rows_keep_their_number_whichever_are_read(tmp_path):
    path = write(tmp_path / "a.parquet", shapely.to_wkb(SHAPES).tolist(), covering=boxes(SHAPES))
    subset = read_footprints(path, bbox=(85155, 446000, 85161, 446001), target_crs=RD)
    assert [f.id for f in subset] == ["8"]
    assert [f.id for f in read_footprints(path)] == [str(i) for i in range(9)]


def test_a_row_without_geometry_stays(tmp_path):
    shapes = [SHAPES[0], None, SHAPES[2]]
    for kind in ("polygon", "multipolygon"):
        path = write(tmp_path / f"{kind}.parquet", in_lists(shapes, kind), kind, id=IDS[:3])
        with pytest.warns(match="no area that a building could have"):
            footprints = read_footprints(path)
        assert [f.polygon.is_empty for f in footprints] == [False, True, False]
        assert footprints[2].polygon.equals(SHAPES[2])


def test_attributes_of_any_type_become_plain_values(tmp_path):
    path = write(
        tmp_path / "a.parquet",
        shapely.to_wkb(SHAPES[:2]).tolist(),
        names=[{"primary": "Town hall"}, None],
        tags=[["a", "b"], []],
        kind=pyarrow.array(["x", None]).dictionary_encode(),
        price=pyarrow.array([1.25, 2.5]).cast(pyarrow.decimal128(10, 2)),
        seen=pyarrow.array([0, 1_700_000_000_000_000_001], pyarrow.timestamp("ns")),
        listed=[True, None],
    )
    first, second = (f.attributes for f in read_footprints(path))
    assert first == {
        "names": '{"primary": "Town hall"}',
        "tags": '["a", "b"]',
        "kind": "x",
        "price": 1.25,
        "seen": "1970-01-01T00:00:00",
        "listed": True,
    }
    assert second == {"tags": "[]", "price": 2.5, "seen": "2023-11-14T22:13:20"}
    assert len(read_footprints(path, where="kind = 'x' and price < 2 and tags like '%b%'")) == 1


@pytest.mark.parametrize(
    ("crs", "expected"), [("absent", "OGC:CRS84"), (RD.to_wkt(), "EPSG:28992"), (None, None)]
)
def test_the_crs_is_the_one_that_the_format_means(tmp_path, crs, expected):
    path = write(tmp_path / "a.parquet", shapely.to_wkb(SHAPES).tolist(), crs=crs)
    assert footprint_crs(path) == (expected and CRS(expected))


def test_only_row_groups_around_a_box_are_fetched(tmp_path):
    pytest.importorskip("aiohttp", reason="needs fsspec[http], part of the extra `parquet`")
    folder, log = tmp_path / "served", tmp_path / "ranges"
    folder.mkdir()
    log.touch()
    detailed = [shapely.segmentize(shape, 0.01) for shape in SHAPES]
    wkb = shapely.to_wkb(detailed).tolist()
    path = write(folder / "a.parquet", wkb, covering=boxes(SHAPES), id=IDS)
    box = {"bbox": (85155, 446000, 85161, 446001), "target_crs": RD}
    with serve(folder, log) as address:
        footprints = read_footprints(f"{address}/a.parquet", **box)
        with pytest.raises(InputError, match=r"^expected GeoParquet footprints at .+no\.parquet"):
            read_footprints(f"{address}/no.parquet")
    assert footprints == read_footprints(path, **box) and [f.id for f in footprints] == ["h8"]
    columns = parquet.ParquetFile(path).metadata.row_group(2).to_dict()["columns"]
    starts = [int(line.split()[1]) for line in log.read_text().splitlines()]
    assert min(starts) >= min(c["dictionary_page_offset"] or c["data_page_offset"] for c in columns)


def write_bytes(path, content):
    path.write_bytes(content)
    return path


BAD = {
    "no GeoParquet": (
        lambda path: parquet.write_table(pyarrow.table({"a": [1]}), path),
        {},
        "describes no geometry",
    ),
    "points": (
        lambda path: write(path, shapely.to_wkb(shapely.points([[0, 0]])).tolist()),
        {},
        "expected polygons in .+ got Point",
    ),
    "points as lists": (
        lambda path: write(path, [{"x": 0.0, "y": 0.0}], "point"),
        {},
        "encoded as point",
    ),
    "cut short": (lambda path: write_bytes(path, b"PAR1" + bytes(100)), {}, "a GeoParquet file at"),
    "a page": (lambda path: write_bytes(path, b"<html>"), {}, "a GeoParquet file at"),
    "no rows": (
        lambda path: write(path, pyarrow.array([], pyarrow.binary())),
        {},
        "a layer without features",
    ),
    "another layer": (
        lambda path: write(path, shapely.to_wkb(SHAPES).tolist()),
        {"layer": "roofs"},
        "one table, got 'roofs'",
    ),
    "a column it lacks": (
        lambda path: write(path, shapely.to_wkb(SHAPES).tolist(), id=IDS),
        {"where": "floors > 2"},
        r"on the attributes of .+ \(id\), got: no such column: floors",
    ),
    "a box elsewhere": (
        lambda path: write(path, shapely.to_wkb(SHAPES).tolist(), covering=boxes(SHAPES)),
        {"bbox": (0, 0, 1, 1), "target_crs": RD},
        "that --bbox let through, got none",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_footprints_gets_one_sentence(tmp_path, name):
    make, options, expected = BAD[name]
    make(tmp_path / "a.parquet")
    with pytest.raises(InputError, match=expected):
        read_footprints(tmp_path / "a.parquet", **options)
