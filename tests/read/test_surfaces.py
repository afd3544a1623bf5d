"""Bodies and surfaces in space given as footprints: the outline is the area that they cover from
above.
"""

import itertools
import json
import struct

import numpy as np
import pytest
import shapely

from hiproof.errors import InputError, InputWarning
from hiproof.read.outlines.footprints import footprint_crs, read_footprints
from hiproof.read.outlines.polygons import (
    as_polygons,
    decode_geometries,
    is_surface,
    simple_polygons,
)
from layers import open_geopackage, write_layer

pytestmark = pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")
X, Y = 500000.0, 4649776.0
ELL = [(0, 0), (12, 0), (12, 6), (6, 6), (6, 9), (0, 9), (0, 0)]
POLYHEDRON, TIN, TRIANGLE = 15, 16, 17


def body(ring, z_bottom=100.0, z_top=106.0):
    """Faces of a block on `ring`, top and bottom first."""
    ring = [(x + X, y + Y) for x, y in ring]
    walls = [
        [(*a, z_bottom), (*b, z_bottom), (*b, z_top), (*a, z_top), (*a, z_bottom)]
        for a, b in itertools.pairwise(ring)
    ]
    return [[(x, y, z) for x, y in ring] for z in (z_bottom, z_top)] + walls


def triangles(faces):
    """A fan for each face with four corners."""
    return [t for f in faces for t in ([f[0], f[1], f[2], f[0]], [f[0], f[2], f[3], f[0]])]


def surface(kind, member, rings, order="<", add=1000):
    start = struct.pack(f"{order}BII", order == "<", kind + add, len(rings))
    parts = [
        struct.pack(f"{order}BIII", order == "<", member + add, 1, len(ring))
        + np.array(ring, f"{order}f8").tobytes()
        for ring in rings
    ]
    return start + b"".join(parts)


def collection(*members):
    return struct.pack("<BII", 1, 1007, len(members)) + b"".join(members)


SQUARE = [(0, 0), (12, 0), (12, 9), (0, 9), (0, 0)]
AWAY = [(x + 40, y) for x, y in SQUARE]
ROOFS = [
    [(X, Y, 5), (X + 12, Y, 5), (X + 12, Y + 4.5, 8), (X, Y + 4.5, 8), (X, Y, 5)],
    [(X, Y + 4.5, 8), (X + 12, Y + 4.5, 8), (X + 12, Y + 9, 5), (X, Y + 9, 5), (X, Y + 4.5, 8)],
]
HAIR_OFF = [(x, y + 4e-4, z) for x, y, z in ROOFS[1]]
TOWER = surface(6, 3, body([(x / 3, y / 3) for x, y in SQUARE], 106, 120))
CORNER = np.array([(X, Y, 0), (X + 4, Y, 9), (X, Y + 4, 3), (X, Y, 0)])
KINDS = {
    "TIN": (surface(TIN, TRIANGLE, triangles(body(SQUARE))), [108.0]),
    "TIN of the other byte order": (surface(TIN, TRIANGLE, triangles(body(SQUARE)), ">"), [108.0]),
    "polyhedral surface": (surface(POLYHEDRON, 3, body(ELL)), [90.0]),
    "multipolygon": (surface(6, 3, body(ELL)), [90.0]),
    "collection": (collection(surface(TIN, TRIANGLE, triangles(body(SQUARE)))), [108.0]),
    "collection in a collection": (collection(collection(surface(POLYHEDRON, 3, body(ELL)))), [90]),
    "collection of two bodies": (
        collection(*[surface(POLYHEDRON, 3, body(r)) for r in (SQUARE, AWAY)]),
        [108.0] * 2,
    ),
    "tower on a house": (collection(surface(POLYHEDRON, 3, body(SQUARE)), TOWER), [108.0]),
    "roofs alone": (surface(6, 3, ROOFS), [108.0]),
    "roofs a hair apart": (surface(6, 3, [ROOFS[0], HAIR_OFF]), [108.0]),
    "a triangle": (struct.pack("<BIII", 1, 1017, 1, 4) + CORNER.tobytes(), [8.0]),
}
"""(WKB, areas from above) by name."""


def write(path, declared, *geometries):
    """A GeoPackage of a layer that is declared so, whatever its geometries are."""
    ids = [f"h{i}" for i in range(len(geometries))]
    boxes = [shapely.box(X, Y, X + 1, Y + 1)] * len(geometries)
    write_layer(path, boxes, {"id": ids}, "EPSG:32633", SPATIAL_INDEX="NO")
    with open_geopackage(path) as base:
        head = b"GP\0\1" + struct.pack("<i", 32633)
        rows = [(head + geometry, id) for geometry, id in zip(geometries, ids, strict=True)]
        base.executemany(f"update {path.stem} set geom = ? where id = ?", rows)
        base.execute("update gpkg_geometry_columns set geometry_type_name = ?, z = 2", (declared,))
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_each_body_has_the_outline_of_its_faces_from_above(tmp_path, kind):
    geometry, areas = KINDS[kind]
    footprints = read_footprints(write(tmp_path / "a.gpkg", "GEOMETRY", geometry))
    polygons = [footprint.polygon for footprint in footprints]
    assert [polygon.area for polygon in polygons] == pytest.approx(areas, abs=0.02)
    assert [f.id for f in footprints] == (["h0"] if len(areas) == 1 else ["h0-1", "h0-2"])
    assert all(polygon.is_valid and not polygon.interiors for polygon in polygons)


@pytest.mark.parametrize("declared", ["TIN", "POLYHEDRALSURFACE", "GEOMETRY"])
def test_layers_that_pyogrio_refuses_are_read(tmp_path, declared):
    """A traceback before, and another while the layers were listed."""
    bodies = [surface(POLYHEDRON, 3, body([(x + 20 * i, y) for x, y in SQUARE])) for i in range(3)]
    path = write(tmp_path / "a.gpkg", declared, *bodies)
    assert footprint_crs(path).to_epsg() == 32633
    with pytest.warns(InputWarning, match="3 features of faces in space"):
        assert [footprint.id for footprint in read_footprints(path)] == ["h0", "h1", "h2"]
    for layer in ("a", 0):
        assert len(read_footprints(path, layer=layer)) == 3
    (selection,) = read_footprints(
        path, where="id = 'h1'", target_crs="EPSG:32633", bbox=(X + 21, Y, X + 22, Y + 1)
    )
    assert selection.id == "h1" and selection.polygon.area == pytest.approx(108.0)
    with pytest.raises(InputError, match="it has a"):
        read_footprints(path, layer="b")


@pytest.mark.filterwarnings("ignore::hiproof.errors.InputWarning")
def test_an_odd_attribute_of_a_refused_layer_is_text(tmp_path):
    path = write(tmp_path / "a.gpkg", "TIN", surface(TIN, TRIANGLE, triangles(body(SQUARE))))
    with open_geopackage(path) as base:
        base.execute("update a set id = cast(x'41ff42' as text)")
    (footprint,) = read_footprints(path)
    assert footprint.attributes["id"] == "A\ufffdB"


def test_one_refused_layer_among_others_is_listed(tmp_path):
    path = write(tmp_path / "a.gpkg", "TIN", surface(TIN, TRIANGLE, triangles(body(SQUARE))))
    write_layer(path, [shapely.box(0, 0, 5, 5)], crs="EPSG:32633", layer="sheds", append=True)
    with pytest.raises(InputError, match="got 2: a, sheds; name one with --layer"):
        read_footprints(path)
    assert [len(read_footprints(path, layer=layer)) for layer in ("a", "sheds")] == [1, 1]


def test_polygons_of_one_feature_that_overlap_are_one_and_those_beside_each_other_several():
    house, other = shapely.box(0, 0, 10, 10), shapely.box(10, 0, 15, 10)
    (whole,) = simple_polygons(shapely.MultiPolygon([house, shapely.box(8, 0, 14, 6)]))
    assert whole.area == pytest.approx(124.0)
    beside = shapely.MultiPolygon([house, other])
    assert [polygon.area for polygon in simple_polygons(beside)] == [100.0, 50.0]
    level = shapely.force_3d(beside, 4.0)
    assert not is_surface(level) and not is_surface(house) and not is_surface(None)


def test_a_wall_alone_has_no_outline(tmp_path):
    wall = body(SQUARE)[2]
    (footprint,) = read_footprints(
        write(tmp_path / "a.gpkg", "GEOMETRY", surface(6, 3, [wall, wall]))
    )
    assert footprint.polygon.is_empty


def test_closed_lines_are_refused_in_one_sentence(tmp_path):
    line = {"type": "LineString", "coordinates": [[x / 1e4, y / 1e4] for x, y in SQUARE]}
    features = [{"type": "Feature", "properties": {}, "geometry": line}]
    (tmp_path / "a.geojson").write_text(
        json.dumps({"type": "FeatureCollection", "features": features})
    )
    with pytest.raises(InputError, match=r"expected polygons in .* got LineString"):
        read_footprints(tmp_path / "a.geojson")


def test_wkb_of_postgis_is_renamed_too_and_damaged_wkb_left_alone():
    flags = 0x80000000 | 0x20000000
    faces = surface(TIN, TRIANGLE, triangles(body(SQUARE)), add=0x80000000)
    head = struct.pack("<IiI", TIN | flags, 32633, struct.unpack_from("<I", faces, 5)[0])
    ewkb = faces[:1] + head + faces[9:]
    (geometry,) = decode_geometries(np.array([ewkb], object))
    assert geometry.geom_type == "MultiPolygon" and shapely.get_srid(geometry) == 32633
    assert as_polygons(ewkb[:100]) == ewkb[:100]
    damaged = np.array([ewkb[:100], struct.pack("<BII", 1, 10, 0), None], object)
    assert list(decode_geometries(damaged)) == [None] * 3
