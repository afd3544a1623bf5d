"""CityJSON against its own schema, read back, and as a tool sees it that measures models."""

import json

import numpy as np
import pytest
import shapely

from handmade import RD_ORIGIN, box, courtyard, gable_house, make_building, make_lost_building
from hiproof.model import ROOF
from hiproof.write.cityjson.features import write_cityjson
from written_run import require_json_schema

FOOTPRINT = shapely.Polygon([(85000, 446000), (85000, 446009), (85009, 446009), (85009, 446000)])


def street():
    return [
        make_lost_building("first"),
        make_lost_building("drawn", footprint=FOOTPRINT, z_ground=1.5),
        make_building(gable_house(), "0503/1 ä"),
        make_building(courtyard(), "yard", ("flat", "hip")),
        make_building(box(), "yard"),
    ]


def sequence(tmp_path, buildings, crs="EPSG:7415", **options):
    write_cityjson(tmp_path / "a.city.jsonl", buildings, crs, **options)
    return [
        json.loads(line) for line in (tmp_path / "a.city.jsonl").read_text("utf-8").splitlines()
    ]


def document(tmp_path, buildings, crs="EPSG:7415", **options):
    write_cityjson(tmp_path / "a.city.json", buildings, crs, **options)
    return json.loads((tmp_path / "a.city.json").read_text("utf-8"))


@pytest.mark.parametrize(
    "buildings", [street(), [], [make_lost_building()]], ids=["street", "none", "no model"]
)
@pytest.mark.parametrize("crs", ["EPSG:7415", None])
def test_valid_by_the_schema(tmp_path, buildings, crs):
    whole = require_json_schema("cityjson.min.schema.json")
    feature = require_json_schema("cityjsonfeature.min.schema.json")
    head, *features = sequence(tmp_path, buildings, crs)
    assert len(features) == len(buildings)
    assert [error.message for item in features for error in feature.iter_errors(item)] == []
    assert [
        error.message
        for item in (head, document(tmp_path, buildings, crs))
        for error in whole.iter_errors(item)
    ] == []


def find_solid(city_object):
    return next(g for g in city_object["geometry"] if g["type"] == "Solid")


def test_the_solid_comes_back(tmp_path):
    head, *_, feature = sequence(tmp_path, [make_lost_building(), make_building(courtyard())])
    transform = head["transform"]
    xyz = np.array(feature["vertices"]) * transform["scale"] + transform["translate"]
    assert len(np.unique(xyz, axis=0)) == len(xyz)
    want = courtyard().move(RD_ORIGIN)
    geometry = find_solid(feature["CityObjects"]["a"])
    kinds = [
        geometry["semantics"]["surfaces"][v]["type"] for v in geometry["semantics"]["values"][0]
    ]
    assert kinds == [face.kind for face in want.faces]
    for rings, face in zip(geometry["boundaries"][0], want.faces, strict=True):
        for ring, indices in zip(rings, face.rings, strict=True):
            np.testing.assert_allclose(xyz[ring], want.vertices[list(indices)], atol=5e-5)


def test_document_and_sequence_hold_the_same(tmp_path):
    head, *features = sequence(tmp_path, street())
    whole = document(tmp_path, street())
    assert whole["transform"] == head["transform"]
    assert whole["metadata"] == head["metadata"]
    vertices = np.array(whole["vertices"])
    for feature in features:
        ((name, feature_object),) = feature["CityObjects"].items()
        other = whole["CityObjects"][name]
        assert other["attributes"] == feature_object["attributes"]
        for feature_geometry, document_geometry in zip(
            feature_object.get("geometry", []), other.get("geometry", []), strict=True
        ):
            own_vertices = np.array(feature["vertices"])
            assert (
                own_vertices[flat(feature_geometry["boundaries"])].tolist()
                == vertices[flat(document_geometry["boundaries"])].tolist()
            )


def flat(nested):
    return (
        [nested]
        if isinstance(nested, int)
        else [index for inner in nested for index in flat(inner)]
    )


def test_metadata(tmp_path):
    head, *features = sequence(tmp_path, street())
    assert head["metadata"]["referenceSystem"] == "https://www.opengis.net/def/crs/EPSG/0/7415"
    assert head["metadata"]["geographicalExtent"] == [85000, 446000, 0, 85010, 446012, 7]
    assert max(head["transform"]["scale"]) <= 0.0001
    assert head["transform"]["translate"] == [85000, 446000, 0]
    assert [list(f["CityObjects"]) for f in features[-2:]] == [["yard"], ["yard..2"]]


def test_attributes_under_roofers_names(tmp_path):
    _, feature = sequence(tmp_path, [make_building(gable_house())])
    attributes = feature["CityObjects"]["a"]["attributes"]
    expected = {
        "rf_h_ground": 0,
        "rf_h_roof_min": 3,
        "rf_h_roof_50p": 5,
        "rf_h_roof_70p": 5.8,
        "rf_h_roof_max": 7,
        "rf_h_roof_ridge": 7,
        "rf_roof_type": "slanted",
        "rf_rmse_lod22": 0.06,
        "hiproof_iso19107_lod22": "[]",
        "rf_volume_lod22": 480,
        "rf_pt_density": 4.5,
        "rf_nodata_frac": None,
        "hiproof_status": "modelled",
        "hiproof_roof_type": "gable",
        "hiproof_share_within_20cm": 0.99,
        "bouwjaar": 1930,
        "naam": "Café <&>",
    }
    assert {name: attributes[name] for name in expected} == expected


def test_the_prefix_is_the_callers(tmp_path):
    _, feature = sequence(tmp_path, [make_building(gable_house())], prefix="b3_")
    city_object = feature["CityObjects"]["a"]
    assert city_object["attributes"]["b3_volume_lod22"] == 480
    roofs = [s for s in find_solid(city_object)["semantics"]["surfaces"] if s["type"] == ROOF]
    assert [(s["b3_slope"], s["b3_azimuth"]) for s in roofs] == [(45, 270), (45, 90)]


def test_footprint_looks_up(tmp_path):
    _, drawing, yard = sequence(tmp_path, [street()[1], street()[3]])
    for feature in (drawing, yard):
        (city_object,) = feature["CityObjects"].values()
        footprint = city_object["geometry"][0]
        assert (footprint["type"], footprint["lod"]) == ("MultiSurface", "0")
        outer, *holes = (np.array(feature["vertices"])[ring] for ring in footprint["boundaries"][0])
        assert shapely.LinearRing(outer[:, :2]).is_ccw
        assert not any(shapely.LinearRing(hole[:, :2]).is_ccw for hole in holes)
    assert drawing["vertices"][0][2] == 15000
    assert len(holes) == 1


def test_a_building_without_model_has_its_status(tmp_path):
    _, feature = sequence(tmp_path, [make_lost_building()])
    assert "geometry" not in feature["CityObjects"]["lost"]
    assert feature["CityObjects"]["lost"]["attributes"]["hiproof_status"] == "no_points"


def test_not_a_number_never_reaches_the_file(tmp_path):
    strange = {
        "a": float("nan"),
        "b": np.float64("inf"),
        "c": np.datetime64("NaT"),
        "d": {1: 2},
        "e": b"\xff",
    }
    _, feature = sequence(
        tmp_path, [make_building(box(), attributes=strange, z_ground=float("nan"))]
    )
    attributes = feature["CityObjects"]["a"]["attributes"]
    assert [attributes[name] for name in "abcde"] == [None, None, None, '{"1": 2}', "\ufffd"]
    assert attributes["rf_h_ground"] == 0.0


@pytest.mark.parametrize("origin", [(1e7, 1e7, -430.0), (-12345678.9, 1e7, 8848.0)])
def test_far_away_and_under_water(tmp_path, origin):
    head, feature = sequence(tmp_path, [make_building(box(), origin=np.array(origin))])
    xyz = (
        np.array(feature["vertices"]) * head["transform"]["scale"] + head["transform"]["translate"]
    )
    np.testing.assert_allclose(xyz.min(axis=0), origin, atol=1e-4)


def test_an_added_building_leaves_the_others_as_they_were(tmp_path):
    old = sequence(tmp_path, street()[2:])
    new = sequence(
        tmp_path,
        [*street()[2:], make_building(box(), "far", origin=np.array([88123.0, 449000.0, 0.0]))],
    )
    assert new[1:-1] == old[1:]
