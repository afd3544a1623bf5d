"""Names of CRSs in files of models: understood, given by hand, and one a file."""

import json
import warnings

import numpy as np
import pyogrio
import pytest
import shapely

import hiproof
from hiproof.cli.convert import convert
from hiproof.errors import InputError, InputWarning
from hiproof.evaluate.models import read_models
from hiproof.parametric.run import build_file
from hiproof.read.models.solids import read_solids
from hiproof.read.outlines.footprints import read_footprints
from layers import write_layer
from streets import place_house

CORNERS = np.array([[i, j, k] for k in (0, 6) for i, j in ((0, 0), (10, 0), (10, 10), (0, 10))])
SHELL = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
PLACE = np.array([500000.0, 5700000.0, 50.0])
UNKNOWN = "urn:town:crs:grid"


def write_gml(path, name, other=None):
    """Write a box as CityGML in the CRS `name`; a second one has a solid in another."""

    def write_building(id, attribute):
        rings = (
            " ".join(f"{v:.3f}" for k in (*f, f[0]) for v in CORNERS[k] + PLACE) for f in SHELL
        )
        polygons = "".join(
            "<gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing><gml:posList>"
            f"{ring}</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon>"
            "</gml:surfaceMember>"
            for ring in rings
        )
        return (
            f'<core:cityObjectMember><bldg:Building gml:id="{id}"><bldg:lod2Solid><gml:Solid'
            f"{attribute}><gml:exterior><gml:CompositeSurface>{polygons}</gml:CompositeSurface>"
            "</gml:exterior></gml:Solid></bldg:lod2Solid></bldg:Building></core:cityObjectMember>"
        )

    members = write_building("a", "")
    members += write_building("b", f' srsName="{other}"') if other else ""
    path.write_text(
        '<core:CityModel xmlns:core="http://www.opengis.net/citygml/2.0" '
        'xmlns:bldg="http://www.opengis.net/citygml/building/2.0" '
        f'xmlns:gml="http://www.opengis.net/gml"><gml:boundedBy><gml:Envelope srsName="{name}"/>'
        f"</gml:boundedBy>{members}</core:CityModel>"
    )
    return path


def write_head(code, x):
    head = {"type": "CityJSON", "version": "2.0", "CityObjects": {}, "vertices": []}
    head |= {"transform": {"scale": [0.001] * 3, "translate": [x, *PLACE[1:]]}}
    name = f"https://www.opengis.net/def/crs/EPSG/0/{code}"
    return head | ({"metadata": {"referenceSystem": name}} if code else {})


def write_seq(path, *heads):
    """Write CityJSONSeq files of a box each, one behind the other."""
    lines = []
    for k, (code, x) in enumerate(heads):
        solid = {"type": "Solid", "lod": "2.2", "boundaries": [[[f] for f in map(list, SHELL)]]}
        house = {"type": "Building", "attributes": {}, "geometry": [solid]}
        vertices = (CORNERS * 1000).tolist()
        feature = {"type": "CityJSONFeature", "id": f"b{k}", "vertices": vertices}
        lines += [write_head(code, x), feature | {"CityObjects": {f"b{k}": house}}]
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def read_boxes(path):
    head, _, geometries, _ = pyogrio.raw.read(path, layer="buildings")
    return head["crs"], shapely.total_bounds(shapely.from_wkb(geometries)).tolist()


ADV = {
    "urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH": "EPSG:25832+7837",
    "urn:adv:crs:ETRS89_UTM33*DE_DHHN92_NH": "EPSG:25833+5783",
    "urn:adv:crs:ETRS89_UTM32": "EPSG:25832",
    "urn:adv:crs:DE_DHDN_3GK3": "EPSG:31467",
    "http://www.opengis.net/gml/srs/epsg.xml#25832": "EPSG:25832",
    "EPSG::31467": "EPSG:31467",
    "http://www.opengis.net/def/crs-compound?1=http://www.opengis.net/def/crs/EPSG/0/25832&amp;"
    "2=http://www.opengis.net/def/crs/EPSG/0/5783": "EPSG:25832+5783",
}


@pytest.mark.parametrize("name", ADV)
def test_names_that_proj_does_not_read_are_understood(name, tmp_path):
    run = hiproof.open_run(write_gml(tmp_path / "a.gml", name))
    assert run.crs == hiproof.read.parse_crs(ADV[name])


def test_a_name_whose_plan_is_not_of_epsg_is_not_taken_for_its_heights_alone(tmp_path):
    name = "http://www.opengis.net/def/crs-compound?1=http://www.opengis.net/def/crs/OGC/1.3/CRS84"
    name += "&amp;2=http://www.opengis.net/def/crs/EPSG/0/5773"
    with pytest.warns(InputWarning, match="names a CRS that PROJ does not know"):
        convert(write_gml(tmp_path / "a.gml", name), tmp_path / "a.gpkg")


@pytest.mark.parametrize("crs", ["EPSG:25832", "urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH"])
@pytest.mark.parametrize("name", [UNKNOWN, "EPSG:3068", *ADV])
def test_a_crs_by_hand_counts_whatever_the_file_names(name, crs, tmp_path):
    convert(write_gml(tmp_path / "a.gml", name), tmp_path / "a.gpkg", crs=crs)
    named, box = read_boxes(tmp_path / "a.gpkg")
    assert named == "EPSG:25832"
    assert box == pytest.approx([*PLACE[:2], *(PLACE[:2] + 10)])


@pytest.mark.parametrize("crs", ["EPSG:2263", "EPSG:25832"])
def test_coordinates_by_hand_are_those_of_the_file_in_any_unit(crs, tmp_path):
    convert(write_gml(tmp_path / "a.gml", UNKNOWN), tmp_path / "a.gpkg", crs=crs)
    assert read_boxes(tmp_path / "a.gpkg")[1] == pytest.approx([*PLACE[:2], *(PLACE[:2] + 10)])


@pytest.mark.parametrize("file", ["a.glb", "a.stl", "a.obj", "a.gpkg", "a.city.json"])
def test_an_unknown_name_is_told_and_stops_nothing(file, tmp_path):
    source = write_gml(tmp_path / "a.gml", UNKNOWN)
    with pytest.warns(InputWarning, match=f"names a CRS that PROJ does not know, '{UNKNOWN}'"):
        convert(source, tmp_path / file)
    assert (tmp_path / file).stat().st_size > 0


READERS = {
    "read_solids": read_solids,
    "read_models": read_models,
    "open_run": lambda path: iter(hiproof.open_run(path)),
    "open_run by hand": lambda path: iter(hiproof.open_run(path, "EPSG:25832")),
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("codes", [(25833, 25832), (None, 25832), (25832, 7415)])
def test_files_put_one_behind_the_other_have_one_crs(codes, reader, tmp_path):
    path = write_seq(tmp_path / "a.city.jsonl", *((code, PLACE[0]) for code in codes))
    with pytest.raises(InputError, match=r"expected one CRS in a file, got .* in line 3 of"):
        list(READERS[reader](path))


def test_parameters_put_one_behind_the_other_are_refused(tmp_path):
    """What follows a second head would stand in the first one's CRS."""
    lines = [{"hiproof_parameters": 1, "crs": f"EPSG:{code}"} for code in (25832, 7415)]
    text = "".join(json.dumps(line) + "\n" for line in (lines[0], place_house("a", 0, 0), lines[1]))
    (tmp_path / "parameters.jsonl").write_text(text)
    with pytest.raises(InputError, match=r"expected one head in .*, got another in line 3"):
        convert(tmp_path / "parameters.jsonl", tmp_path / "a.gpkg")
    with pytest.raises(InputError, match=r"expected one head in .*, got another in line 3"):
        build_file(tmp_path / "parameters.jsonl", tmp_path / "built")


@pytest.mark.parametrize("codes", [(25832, 25832), (25832, None), (None, None)])
def test_files_of_one_crs_may_stand_one_behind_the_other(codes, tmp_path):
    heads = [(code, PLACE[0] + 100 * k) for k, code in enumerate(codes)]
    solids = dict(read_solids(write_seq(tmp_path / "a.city.jsonl", *heads)))
    assert [solid.vertices[0, 0] for solid in solids.values()] == [x for _, x in heads]


def test_a_city_object_in_another_crs_is_refused(tmp_path):
    path = write_gml(tmp_path / "a.gml", "EPSG:25832", "EPSG:25833")
    with pytest.raises(InputError, match=r"expected one CRS in a file, got EPSG:25833 in b in"):
        convert(path, tmp_path / "a.gpkg")
    same = write_gml(tmp_path / "b.gml", "EPSG:25832", "urn:ogc:def:crs:EPSG::25832")
    convert(same, tmp_path / "b.gpkg")


def test_footprints_whose_crs_is_unknown_are_taken_to_be_in_that_of_the_clouds(
    tmp_path, monkeypatch
):
    """No file of GDAL names such a CRS at will, so a reader does."""
    from hiproof.read.outlines import vector_file

    real = vector_file.read_features

    def read_features(*given):
        meta, *others = real(*given)
        return {**meta, "crs": UNKNOWN}, *others

    monkeypatch.setattr(vector_file, "read_features", read_features)
    square = shapely.box(*PLACE[:2], *(PLACE[:2] + 10))
    write_layer(tmp_path / "a.shp", [square], {"id": ["a"]}, "EPSG:25832")
    with pytest.warns(InputWarning, match="names a CRS that PROJ does not know"):
        found = read_footprints(tmp_path / "a.shp", target_crs="EPSG:25832")
    assert found[0].polygon.equals(square)


@pytest.mark.parametrize("name, is_other", [("EPSG:25832", False), ("EPSG:25833", True)])
def test_a_crs_by_hand_of_other_places_than_the_files_is_told(name, is_other, tmp_path):
    """Who expects a transformation gets models elsewhere."""
    source = write_gml(tmp_path / "a.gml", name)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        convert(source, tmp_path / "a.city.json", crs="EPSG:25832")
    told = [str(w.message) for w in caught if "as given, and are not transformed" in str(w.message)]
    assert len(told) == is_other, told
