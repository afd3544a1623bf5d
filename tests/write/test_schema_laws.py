"""The rules of CityJSON 2.0 that its schema cannot say."""

import json

import pytest

from handmade import box, courtyard, gable_house, make_building, make_lost_building
from written_run import write_all


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run's files with a gable, a courtyard, two of one id, ids that XML forbids, and one without
    a model.
    """
    place = tmp_path_factory.mktemp("schema")
    solids = {"a": gable_house(), "yard": courtyard(), "1 b/<c>": box()}
    buildings = [make_building(solid, id) for id, solid in solids.items()]
    write_all(
        place,
        [*buildings, make_building(box(), "yard"), make_lost_building(), make_lost_building("ü")],
        "EPSG:7415",
    )
    return place


@pytest.fixture(scope="module")
def features(folder):
    return [*map(json.loads, (folder / "buildings.city.jsonl").read_text().splitlines())][1:]


def test_cityjson_features_hold_their_object_and_its_vertices(features):
    ids = [feature["id"] for feature in features]
    assert len(set(ids)) == len(ids) == 6
    for feature in features:
        assert feature["type"] == "CityJSONFeature"
        assert set(feature) == {"type", "id", "CityObjects", "vertices"}
        assert list(feature["CityObjects"]) == [feature["id"]]
        (city_object,) = feature["CityObjects"].values()
        assert city_object["type"] == "Building" and isinstance(city_object["attributes"], dict)
        assert not city_object.keys() & {"parents", "children"}  # both ways or none
        assert all(len(v) == 3 and all(type(c) is int for c in v) for v in feature["vertices"])
        assert len(set(map(tuple, feature["vertices"]))) == len(feature["vertices"])


def test_cityjson_geometries_have_type_lod_boundaries_and_matching_semantics(features):
    for feature in features:
        (city_object,) = feature["CityObjects"].values()
        indices = set()
        for geometry in city_object.get("geometry", []):
            assert isinstance(geometry["lod"], str)
            shells = (
                geometry["boundaries"] if geometry["type"] == "Solid" else [geometry["boundaries"]]
            )
            assert geometry["type"] in ("Solid", "MultiSurface")
            rings = [ring for shell in shells for surface in shell for ring in surface]
            # not closed, no repeats
            assert all(len(ring) >= 3 and len(set(ring)) == len(ring) for ring in rings)
            indices |= {index for ring in rings for index in ring}
            if "semantics" in geometry:
                semantics = geometry["semantics"]
                assert set(semantics) == {"surfaces", "values"}
                assert {s["type"] for s in semantics["surfaces"]} <= {
                    "RoofSurface",
                    "WallSurface",
                    "GroundSurface",
                }
                assert [len(values) for values in semantics["values"]] == [
                    len(shell) for shell in shells
                ]
                assert {v for values in semantics["values"] for v in values} == set(
                    range(len(semantics["surfaces"]))
                )
        assert indices == set(range(len(feature["vertices"])))
