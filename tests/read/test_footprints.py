"""Every feature of a footprint file comes back: split, repaired, renamed or empty, never lost."""

import json

import numpy as np
import pyogrio
import pytest
import shapely
from pyproj import CRS, Transformer

from hiproof.city.plan.overlap import check_overlap
from hiproof.errors import InputError, InputWarning
from hiproof.model import Footprint
from hiproof.read.crs.positions import doubtful_place
from hiproof.read.outlines.footprints import footprint_crs, read_footprints
from hiproof.read.outlines.polygons import simple_polygons
from hiproof.settings import Settings
from layers import write_layer

pytestmark = pytest.mark.filterwarnings(
    "ignore:'crs' was not provided", "ignore:invalid value encountered"
)
SQUARE = shapely.box(85000, 446000, 85010, 446010, ccw=False)
RD, UTM31, UTM32, WGS84 = (CRS.from_epsg(code) for code in (28992, 25831, 25832, 4326))
HOLED = shapely.Polygon(
    SQUARE.exterior, [[(85002, 446002), (85004, 446002), (85004, 446004), (85002, 446004)]]
)


def write(path, geometries, crs="EPSG:28992", **fields):
    layer = {"layer": "buildings"} if path.suffix == ".gpkg" else {}
    return write_layer(path, geometries, fields, crs, geometry_type="Unknown", **layer)


def shift(polygon, x):
    return shapely.transform(polygon, lambda xy: xy + [x, 0])


@pytest.mark.parametrize("ending", ["gpkg", "geojson", "fgb"])
def test_polygons_holes_and_attributes_come_back(tmp_path, ending):
    fields = {"name": ["A", "B"], "floors": np.array([2, 3], np.int32), "height": [7.5, np.nan]}
    fields |= {"built": np.array(["1931-05-17", "2001-01-01"], "datetime64[D]")}
    path = write(tmp_path / f"a.{ending}", [SQUARE, shift(HOLED, 20)], **fields)
    # FlatGeobuf reorders
    first, second = sorted(read_footprints(path, id_attribute="name"), key=lambda f: f.id)
    assert (first.id, second.id) == ("A", "B")
    assert first.polygon.equals(SQUARE) and second.polygon.equals(shift(HOLED, 20))
    assert first.attributes.pop("built").startswith("1931-05-17")
    assert first.attributes == {"name": "A", "floors": 2, "height": 7.5}
    assert "height" not in second.attributes
    json.dumps(second.attributes)


@pytest.mark.parametrize("ending", ["gpkg", "geojson", "fgb", "shp"])
def test_which_way_rings_go_round_depends_on_no_format(tmp_path, ending):
    """A fit that begins at an edge sees a roof from the other side where its outline goes round the
    other way.
    """
    path = write(tmp_path / f"a.{ending}", [SQUARE, shapely.reverse(SQUARE), shift(HOLED, 20)])
    for footprint in read_footprints(path):
        assert not footprint.polygon.exterior.is_ccw
        assert all(hole.is_ccw for hole in footprint.polygon.interiors)


def write_with_gaps(path, **fields):
    """Three squares, of which the second has none of the `fields`."""
    squares, gap = [shift(SQUARE, 20 * i) for i in range(3)], np.array([False, True, False])
    columns, masks = {"name": ["A", "B", "C"], **fields}, [None] + [gap] * len(fields)
    return write_layer(path, squares, columns, field_mask=masks)


@pytest.mark.parametrize("ending", ["gpkg", "geojson", "fgb"])
@pytest.mark.parametrize("condition", [None, "name <> 'D' or name = 'E'"])
def test_whole_numbers_and_booleans_stay_so_where_a_feature_has_none(tmp_path, ending, condition):
    """They became decimals: a year 1931.0, a yes 1.0, an id beyond 2^53 that of its neighbour."""
    fields = {
        "year": np.array([1931, 0, 2001], np.int32),
        "listed": np.array([True, False, False]),
        "number": 2**53 + np.array([1, 0, 3], np.int64),
        "height": np.array([7.5, 0, 8.0]),
    }
    path = write_with_gaps(tmp_path / f"a.{ending}", **fields)
    found = read_footprints(path, id_attribute="name", where=condition)
    by_name = {f.id: f.attributes for f in found}
    assert by_name["B"] == {"name": "B"}
    for number, name in ((0, "A"), (2, "C")):
        for field, values in fields.items():
            expected = values[number].item()
            assert by_name[name][field] == expected
            assert type(by_name[name][field]) is type(expected)


def test_ids_of_many_digits_stay_apart_where_a_feature_has_none(tmp_path):
    path = write_with_gaps(tmp_path / "a.gpkg", number=2**53 + np.array([0, 0, 1], np.int64))
    with pytest.warns(InputWarning, match="1 feature without number"):
        ids = [footprint.id for footprint in read_footprints(path, id_attribute="number")]
    assert ids[::2] == ["9007199254740992", "9007199254740993"]


def test_a_list_stays_a_list_however_long(tmp_path):
    ring = [[0, 0], [9, 0], [9, 9], [0, 0]]
    feature = {"type": "Feature", "properties": {"many": list(range(2000)), "names": ["a", "b"]}}
    feature["geometry"] = {"type": "Polygon", "coordinates": [ring]}
    path = tmp_path / "a.geojson"
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::28992"}}
    path.write_text(json.dumps({"type": "FeatureCollection", "crs": crs, "features": [feature]}))
    assert read_footprints(path)[0].attributes == feature["properties"]


def test_heights_of_the_outline_are_left_out(tmp_path):
    path = write(tmp_path / "a.gpkg", [shapely.force_3d(SQUARE, 12.0)])
    assert not read_footprints(path)[0].polygon.has_z


def test_multipolygons_are_split_and_name_their_feature(tmp_path):
    polygons = shapely.MultiPolygon([SQUARE, shift(HOLED, 20)])
    path = write(tmp_path / "a.gpkg", [polygons, shift(SQUARE, 60)], id=["M", "N"])
    footprints = read_footprints(path)
    assert [f.id for f in footprints] == ["M-1", "M-2", "N"]
    assert footprints[1].attributes == {"id": "M", "part_of": "M"}
    assert "part_of" not in footprints[2].attributes
    assert sum(f.polygon.area for f in footprints[:2]) == pytest.approx(polygons.area)


@pytest.mark.parametrize("code", [28992, 25831, 4326])
def test_footprints_move_into_the_clouds_plan_crs(tmp_path, code):
    transformer = Transformer.from_crs(28992, code, always_xy=True)
    polygon = shapely.transform(SQUARE, lambda xy: np.column_stack(transformer.transform(*xy.T)))
    path = write(tmp_path / "a.gpkg", [polygon], crs=f"EPSG:{code}")
    back = read_footprints(path, target_crs=CRS.from_epsg(7415))[0].polygon
    assert np.abs(np.subtract(back.exterior.coords, SQUARE.exterior.coords)).max() < 0.001
    assert footprint_crs(path).to_epsg() == code


def test_the_same_plan_crs_leaves_every_bit_as_it_is(tmp_path):
    path = write(tmp_path / "a.gpkg", [SQUARE])
    assert read_footprints(path, target_crs="EPSG:7415")[0].polygon.equals_exact(SQUARE, 0)
    in_cloud = Settings.from_dict({"read": {"crs": "EPSG:25831"}})
    assert not read_footprints(path, settings=in_cloud)[0].polygon.equals_exact(SQUARE, 1)


def test_footprints_without_a_crs_are_taken_to_be_in_the_clouds(tmp_path):
    path = write(tmp_path / "a.gpkg", [SQUARE], crs=None)
    with pytest.warns(InputWarning, match=r"names no CRS; taken to be in the cloud's, EPSG:7415"):
        assert read_footprints(path, target_crs="EPSG:7415")[0].polygon.equals(SQUARE)


def test_ids_come_from_a_usual_attribute_without_gaps_or_repeats(tmp_path):
    geometries, twins = [SQUARE, shift(SQUARE, 20)], ["x", "x"]
    path = write(tmp_path / "a.gpkg", geometries, id=twins, Identificatie=[7.0, 9.0])
    assert [f.id for f in read_footprints(path)] == ["7", "9"]
    remark = "id repeats or is missing, so buildings go by their number"
    for name, ids in (("b", twins), ("c", ["x", " "]), ("d", [None, "x"])):
        path = write(tmp_path / f"{name}.gpkg", geometries, id=ids)
        with pytest.warns(InputWarning, match=remark):
            assert [f.id for f in read_footprints(path)] == ["1", "2"]


def test_repeated_ids_get_a_suffix_and_copies_name_their_original(tmp_path):
    shapes = [SQUARE, SQUARE.reverse(), shift(SQUARE, 20)]
    path = write(tmp_path / "a.gpkg", shapes, k=["x", "x", "x_2"])
    with pytest.warns(InputWarning) as caught:
        footprints = read_footprints(path, id_attribute="k")
    assert [f.id for f in footprints] == ["x", "x_3", "x_2"]
    assert footprints[1].attributes["copy_of"] == "x" and "copy_of" not in footprints[2].attributes
    remarks = " ".join(str(w.message) for w in caught)
    assert "id of an earlier" in remarks and "polygon of another" in remarks


def test_a_footprint_on_top_of_another_is_told_of_and_neighbours_and_courts_are_not(
    tmp_path, recwarn
):
    ring = shapely.Polygon(shift(SQUARE, 50).buffer(5).exterior, [shift(SQUARE, 50).exterior])
    separate = [SQUARE, shift(SQUARE, np.ptp(SQUARE.bounds[::2])), ring, shift(SQUARE, 50)]
    read_footprints(write(tmp_path / "a.gpkg", separate))
    assert not recwarn.list
    ids = ["house", "annex", "block"]
    path = write(tmp_path / "b.gpkg", [SQUARE, SQUARE.buffer(-2), shift(SQUARE, 20)], id=ids)
    remark = r"1 footprint on top of a larger one \(annex on house\): models of both"
    with pytest.warns(InputWarning, match=remark):
        assert len(read_footprints(path)) == 3


def test_features_without_area_stay_with_an_empty_polygon(tmp_path):
    line = shapely.Polygon([(0, 0), (5, 5), (2, 2), (0, 0)])
    shapes = [SQUARE, line, None, shapely.Point(1, 1)]
    path = write(tmp_path / "a.gpkg", shapes, id=["a", "b", "c", "d"])
    with pytest.warns(InputWarning, match="3 features with no area"):
        footprints = read_footprints(path)
    assert [f.id for f in footprints] == ["a", "b", "c", "d"]
    assert [f.polygon.is_empty for f in footprints] == [False, True, True, True]


def test_self_intersecting_footprints_are_repaired(tmp_path):
    bow_tie = shapely.Polygon([(0, 0), (8, 8), (8, 0), (0, 8)])
    spike = shapely.Polygon([(20, 0), (30, 0), (30, 10), (30, 15), (30, 10), (20, 10)])
    path = write(tmp_path / "a.gpkg", [bow_tie, spike], id=["tie", "spike"])
    with pytest.warns(InputWarning, match="2 invalid footprints repaired"):
        footprints = read_footprints(path)
    assert [f.id for f in footprints] == ["tie-1", "tie-2", "spike"]
    assert all(f.polygon.is_valid for f in footprints)
    assert footprints[2].polygon.area == pytest.approx(100)


@pytest.mark.parametrize("seed", range(20))
def test_any_tangle_of_edges_becomes_valid_polygons(seed):
    rng = np.random.default_rng(seed)
    tangle = shapely.Polygon(rng.uniform(0, 10, (rng.integers(3, 12), 2)))
    for polygon in (p for p in simple_polygons(tangle) if not p.is_empty):
        assert polygon.is_valid and polygon.geom_type == "Polygon" and polygon.area > 0


def test_coordinates_that_are_no_numbers_enclose_no_area():
    assert simple_polygons(shapely.Polygon([(0, 0), (1, np.nan), (1, 1)]))[0].is_empty
    assert simple_polygons(shapely.Polygon([(0, 0), (np.inf, 1), (1, 1)]))[0].is_empty


def test_a_file_of_several_layers_needs_a_name(tmp_path):
    path = write(tmp_path / "a.gpkg", [SQUARE], name=["A"])
    squares = [shift(SQUARE, 20), shift(SQUARE, 40)]
    write_layer(path, squares, {"name": ["B", "C"]}, layer="sheds", append=True)
    for read in (read_footprints, footprint_crs):
        with pytest.raises(InputError, match="2: buildings, sheds; name one with --layer"):
            read(path)
    assert len(read_footprints(path, layer="sheds")) == 2
    assert footprint_crs(path, "buildings").to_epsg() == 28992


def test_a_table_without_geometry_is_no_layer_to_choose_from(tmp_path):
    path = write(tmp_path / "a.gpkg", [SQUARE], name=["A"])
    notes, options = [np.array(["x"], object)], {"geometry_type": None, "append": True}
    pyogrio.raw.write(path, None, notes, ["note"], layer="notes", **options)
    assert len(pyogrio.list_layers(path)) == 2 and len(read_footprints(path)) == 1


def test_features_of_several_polygons_are_said_once(tmp_path):
    polygons = shapely.MultiPolygon([SQUARE, shift(SQUARE, 20)])
    path = write(tmp_path / "a.gpkg", [polygons, shift(polygons, 60)], id=["M", "N"])
    remark = "2 features of several polygons became 4 buildings"
    with pytest.warns(InputWarning, match=remark) as remarks:
        read_footprints(path)
    assert len(remarks) == 1


def reproject(xy, source, target):
    return np.column_stack(Transformer.from_crs(source, target, always_xy=True).transform(*xy.T))


HERE = np.array([[85005.0, 446005.0], [85035.0, 446005.0]])
IN_UTM = reproject(HERE, RD, UTM31)
NEXT_ZONE, DEGREES = reproject(IN_UTM, UTM31, UTM32), reproject(HERE, RD, WGS84)


ZONE_32 = r"they look like EPSG:25832 \(ETRS89 / UTM zone 32N\)"


LAT_FIRST = "latitude and longitude in degrees"
SLIPS = {
    "swapped axes": (HERE[:, ::-1], RD, HERE, RD, "x and y look swapped"),
    "swapped axes of an unknown CRS": (HERE[:, ::-1], None, HERE, None, "x and y look swapped"),
    "degrees": (DEGREES, None, HERE, RD, "longitude and latitude in degrees"),
    "degrees, latitude first": (DEGREES[:, ::-1], None, HERE, RD, LAT_FIRST),
    "a cloud in degrees": (HERE, RD, DEGREES, None, "the cloud looks like longitude and latitude"),
    "the wrong label": (HERE, UTM31, HERE, RD, "look like the cloud's EPSG:28992"),
    "a neighbouring zone": (IN_UTM, UTM32, IN_UTM, UTM31, "look like the cloud's EPSG:25831"),
    "two zones off": (NEXT_ZONE, None, IN_UTM, UTM31, ZONE_32),
    "a cloud in the next zone": (IN_UTM, UTM31, NEXT_ZONE, None, "the cloud looks like EPSG:25832"),
    "a cloud in the UTM zone": (HERE, RD, IN_UTM, None, "the cloud looks like EPSG:25831"),
    "feet": (HERE / 0.3048, None, HERE, None, "they look like feet"),
    "a cloud in feet": (HERE, None, HERE / 0.3048, None, "the cloud like feet"),
    "elsewhere": (HERE + 50000, RD, HERE, RD, "check the CRS each file names"),
}


@pytest.mark.parametrize("slip", SLIPS)
def test_footprints_elsewhere_are_refused_with_what_they_look_like(slip):
    xy, source, cloud_xy, cloud, expected = SLIPS[slip]
    in_use = xy if source is None or cloud is None else reproject(xy, source, cloud)
    shapes = shapely.buffer(shapely.points(in_use), 1e-3)
    footprints = [Footprint(str(i), shape) for i, shape in enumerate(shapes)]
    reach = 1e-5 if np.abs(cloud_xy).max() < 180 else 20.0
    bounds = np.array([[*(cloud_xy.min(axis=0) - reach), *(cloud_xy.max(axis=0) + reach)]])
    with pytest.raises(InputError, match=expected) as caught:
        check_overlap(footprints, bounds, source, cloud)
    assert str(caught.value).startswith("expected footprints that overlap the cloud in x")


@pytest.mark.parametrize(
    ("code", "xy", "expected"),
    [
        (7415, HERE, None),
        (25831, IN_UTM, None),
        (25832, reproject(IN_UTM, UTM31, UTM32), None),
        (25831, HERE, "far from where EPSG:25831 (ETRS89 / UTM zone 31N) is used (0 to 6 E, 37 to"),
        (2263, HERE, "far from where EPSG:2263"),
        (25831, HERE * 1e7, "nowhere on Earth"),
    ],
)
def test_coordinates_far_from_where_their_crs_is_used_are_told(code, xy, expected):
    remark = doubtful_place(CRS.from_epsg(code), xy)
    assert remark is None if expected is None else expected in remark


@pytest.mark.parametrize("crs", [None, "EPSG:28992"])
def test_footprints_in_degrees_that_name_another_crs_are_refused(crs, tmp_path):
    path = write(tmp_path / "a.gpkg", [shapely.box(4.36, 51.99, 4.3602, 51.9901)], crs)
    sentence = r"a\.gpkg, which names .*, in metres, got .* look like degrees; name their CRS"
    with pytest.raises(InputError, match=sentence):
        read_footprints(path, target_crs=RD)


@pytest.mark.parametrize("target", [None, "EPSG:7415"])
def test_footprints_in_degrees_that_name_no_crs_are_refused_although_none_has_an_area(
    tmp_path, target
):
    in_degrees = shapely.transform(SQUARE, lambda xy: reproject(xy, RD, WGS84))
    path = write(tmp_path / "a.gpkg", [in_degrees, None], crs=None)
    sentence = r"names no CRS, in metres, got .* look like degrees; name their CRS"
    with pytest.raises(InputError, match=sentence):
        read_footprints(path, target_crs=target)


def test_overlap_is_checked_and_both_boxes_are_named():
    footprints = (Footprint("a", SQUARE), Footprint("empty", shapely.Polygon()))
    elsewhere, around = (0, 0, 1, 1), (84990, 445990, 85001, 446001)
    check_overlap(footprints, np.array([elsewhere, around]))
    check_overlap(footprints[1:], np.array([elsewhere]))
    sentence = r"x 4\.0.* to 5\.0.*RD New.*x 85005\.0 to 85005\.0.*no CRS"
    with pytest.raises(InputError, match=sentence):
        check_overlap(footprints, np.array([[4.0, 51.0, 5.0, 52.0]]), None, CRS.from_epsg(28992))


def bad_file(tmp_path, kind):
    path = tmp_path / "bad.gpkg"
    if kind == "empty file":
        path.write_bytes(b"")
    elif kind == "not a vector file":
        path.write_bytes(b"LASF" + bytes(400))
    elif kind == "truncated":
        path.write_bytes(write(path, [SQUARE] * 50).read_bytes()[:5000])
    elif kind == "no features":
        write(path, [])
    elif kind == "no polygons":
        write(path, [shapely.LineString([(0, 0), (1, 1)])])
    elif kind == "no geometry":
        path = tmp_path / "bad.csv"
        path.write_text("name,floors\na,2\n")
    elif kind == "metres called degrees":
        write(path, [SQUARE], crs="EPSG:4326")
    return path


BAD = {
    "missing": "no such file",
    "empty file": "an empty file",
    "not a vector file": "that GDAL reads",
    "truncated": "that GDAL reads|layer",
    "no features": "without features",
    "no polygons": "got LineString",
    "no geometry": "without geometry",
    "metres called degrees": "outside that system",
}


@pytest.mark.parametrize("kind", BAD)
def test_what_cannot_be_read_gets_one_full_sentence(tmp_path, kind):
    with pytest.raises(InputError, match=BAD[kind]) as caught:
        read_footprints(bad_file(tmp_path, kind), target_crs="EPSG:7415")
    assert str(caught.value).startswith("expected") and "got" in str(caught.value)


def test_unknown_layers_and_attributes_are_answered_with_the_known_ones(tmp_path):
    path = write(tmp_path / "a.gpkg", [SQUARE], name=["A"])
    with pytest.raises(InputError, match="it has buildings"):
        read_footprints(path, layer="roofs")
    with pytest.raises(InputError, match="got name; name one"):
        read_footprints(path, id_attribute="bag_id")


def test_degrees_without_a_cloud_crs_are_refused(tmp_path):
    with pytest.raises(InputError, match="in a projected CRS"):
        read_footprints(
            write(tmp_path / "a.gpkg", [shapely.box(4, 52, 4.001, 52.001)], crs="EPSG:4326")
        )


def test_a_geojson_in_a_national_grid_that_names_no_crs_is_told_how_to_name_it(tmp_path):
    geometry = shapely.geometry.mapping(SQUARE)
    feature = {"type": "Feature", "properties": {}, "geometry": geometry}
    (tmp_path / "a.geojson").write_text(
        json.dumps({"type": "FeatureCollection", "features": [feature]})
    )
    sentence = r"they are no degrees: name their CRS in the file, .* \(`ogr2ogr -a_srs`\)"
    with pytest.raises(InputError, match=sentence):
        read_footprints(tmp_path / "a.geojson", target_crs="EPSG:28992")
