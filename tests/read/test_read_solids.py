"""Solids come back from CityJSON, CityJSONSeq and CityGML as they were, and broken files say what
is wrong.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from hiproof.compose import check_solid, compose
from hiproof.errors import InputError
from hiproof.read.models.solids import read_solids
from roof_zoo import generate_roof

DEN_HAAG = Path(__file__).parents[2] / "../shared/data/denhaag/DenHaag_01.city.json"
SOLID = compose(generate_roof("towers", 1), 0.0)
TRANSFORM = {"scale": [1e-4] * 3, "translate": [85000.0, 446000.0, 0.0]}
OTHER_SURFACES = [{"type": "RoofSurface"}, {"type": "WallSurface"}, {"type": "GroundSurface"}]


def city_object(kind="Solid"):
    """A building whose geometry is SOLID in the given kind of boundary, two of them where the kind
    holds several.
    """
    shell = [[list(ring) for ring in face.rings] for face in SOLID.faces]
    kinds = [surface["type"] for surface in OTHER_SURFACES]
    values = [kinds.index(face.kind) for face in SOLID.faces]
    nested = {"MultiSurface": (shell, values), "Solid": ([shell], [values])}
    boundaries, values = nested.get(kind, ([[shell], [shell]], [[values], [values]]))
    geometry = {"type": kind, "lod": "2.2", "boundaries": boundaries}
    geometry["semantics"] = {"surfaces": OTHER_SURFACES, "values": values}
    return {"type": "Building", "geometry": [geometry]}


def wrap(text, *names):
    """A text within XML elements, the innermost first."""
    for name in names:
        text = f"<{name}>{text}</{name.split()[0]}>"
    return text


def integer_vertices():
    return np.rint(SOLID.vertices / 1e-4).astype(int).tolist()


def city(kind="Solid"):
    return {
        "type": "CityJSON",
        "version": "2.0",
        "transform": TRANSFORM,
        "CityObjects": {"house": city_object(kind)},
        "vertices": integer_vertices(),
    }


def gml(xlinked=True, points="posList"):
    """SOLID as CityGML, its solid by xlink to the boundary surfaces or by value."""

    def ring_text(ring):
        xyz = [" ".join(map(repr, SOLID.vertices[v].tolist())) for v in (*ring, ring[0])]
        if points == "posList":
            return wrap(" ".join(xyz), "gml:posList", "gml:LinearRing")
        return wrap("".join(wrap(place, "gml:pos") for place in xyz), "gml:LinearRing")

    def polygon(k, face):
        outer, *holes = map(ring_text, face.rings)
        rings = wrap(outer, "gml:exterior") + "".join(wrap(h, "gml:interior") for h in holes)
        return wrap(rings, f'gml:Polygon gml:id="p{k}"', "gml:surfaceMember")

    surfaces, members = "", ""
    for k, face in enumerate(SOLID.faces):
        if xlinked:
            members += f'<gml:surfaceMember xlink:href="#p{k}"/>'
            outside = ("bldg:lod2MultiSurface", f"bldg:{face.kind}", "bldg:boundedBy")
            surfaces += wrap(polygon(k, face), "gml:MultiSurface", *outside)
        else:
            members += polygon(k, face)
    solid = wrap(members, "gml:CompositeSurface", "gml:exterior", "gml:Solid", "bldg:lod2Solid")
    names = (
        'xmlns="http://www.opengis.net/citygml/2.0" '
        'xmlns:bldg="http://www.opengis.net/citygml/building/2.0"'
        ' xmlns:gml="http://www.opengis.net/gml" xmlns:xlink="http://www.w3.org/1999/xlink"'
    )
    building = ('bldg:Building gml:id="house"', "cityObjectMember", f"CityModel {names}")
    return wrap(solid + surfaces, *building)


def write_text(folder, name, text):
    path = folder / name
    path.write_text(text)
    return path


def list_solids(folder, name, text):
    return list(read_solids(write_text(folder, name, text)))


def seq():
    feature = {"type": "CityJSONFeature", "id": "house", "vertices": integer_vertices()}
    feature["CityObjects"] = {"house": city_object()}
    header = {**city(), "CityObjects": {}, "vertices": []}
    return f"{json.dumps(header)}\n{json.dumps(feature)}\n\n"


FILES = {
    "a.city.json": json.dumps(city()),
    "a.city.jsonl": seq(),
    "xlinked.gml": gml(),
    "by_value.gml": gml(xlinked=False),
    "single_positions.gml": gml(points="pos"),
}


@pytest.mark.parametrize("name", FILES)
def test_solid_comes_back(tmp_path, name):
    ((found_id, solid),) = list_solids(tmp_path, name, FILES[name])
    assert found_id == "house"
    assert check_solid(solid) == ()
    assert solid.volume == pytest.approx(SOLID.volume)
    if name != "by_value.gml":
        for kind in ("RoofSurface", "WallSurface", "GroundSurface"):
            assert len(solid.select_faces(kind)) == len(SOLID.select_faces(kind))


@pytest.mark.parametrize(
    ("kind", "ids"), [("MultiSurface", 1), ("CompositeSolid", 2), ("MultiSolid", 2)]
)
def test_other_geometries_come_out_shell_by_shell(tmp_path, kind, ids):
    results = list(read_solids(write_text(tmp_path, "a.city.json", json.dumps(city(kind)))))
    assert [name for name, _ in results] == ["house", "house#2"][:ids]
    assert all(check_solid(solid) == () for _, solid in results)


def test_inner_shell_is_turned_inside_out(tmp_path):
    model = city()
    (geometry,) = model["CityObjects"]["house"]["geometry"]
    (outer,) = geometry["boundaries"]
    geometry["boundaries"] = [outer, [[ring[::-1] for ring in face] for face in outer]]
    del geometry["semantics"]
    results = list_solids(tmp_path, "a.json", json.dumps(model))
    assert len(results) == 2 and all(check_solid(solid) == () for _, solid in results)


def test_other_surfaces_of_a_shell_become_one_of_three(tmp_path):
    model = city()
    (geometry,) = model["CityObjects"]["house"]["geometry"]
    names = ("OuterFloorSurface", "ClosureSurface", "OuterCeilingSurface")
    geometry["semantics"]["surfaces"] = [{"type": name} for name in names]
    ((_, solid),) = list_solids(tmp_path, "a.json", json.dumps(model))
    assert [face.kind for face in solid.faces] == [face.kind for face in SOLID.faces]
    geometry["semantics"]["surfaces"][0]["type"] = "gable"
    with pytest.raises(InputError, match="gable"):
        list_solids(tmp_path, "b.json", json.dumps(model))


def test_open_ring_is_a_finding(tmp_path):
    before, start, text = gml().partition("<gml:posList>")
    places, stop, after = text.partition("</gml:posList>")
    opened = before + start + " ".join(places.split()[:-3]) + stop + after
    ((_, solid),) = list_solids(tmp_path, "open.gml", opened)
    assert [finding.code for finding in check_solid(solid)] == [103]


def test_building_without_solid_gives_its_surfaces(tmp_path):
    before, _, text = gml().partition("<bldg:lod2Solid>")
    surfaces = before + text.partition("</bldg:lod2Solid>")[2]
    ((name, solid),) = list_solids(tmp_path, "surfaces.gml", surfaces)
    assert name == "house" and check_solid(solid) == ()


BROKEN = {
    "cut.json": (FILES["a.city.json"][:500], "damaged or cut off"),
    "list.json": ("[1, 2]", "expected a JSON object"),
    "geo.json": ('{"type": "FeatureCollection"}', '"type": "CityJSON"'),
    "index.json": (json.dumps({**city(), "vertices": [[0, 0, 0]]}), "vertex 1 of 1"),
    "model.jsonl": (gml(), "got XML, such as CityGML; name a CityJSON file"),
    "headless.jsonl": (seq().split("\n")[1], "expected a CityJSON line"),
    "empty.jsonl": ("", "got an empty file"),
    "cut.gml": (gml()[:900], "damaged or cut off"),
    "other.gml": ("<a><b/></a>", "cityObjectMember"),
    "link.gml": (gml().replace('href="#p0"', 'href="#nowhere"'), "surface that is missing"),
    "words.gml": (gml().replace("<gml:posList>", "<gml:posList>here "), "expected numbers"),
    "flat.gml": (gml().replace("<gml:posList>", "<gml:posList>1.0 "), "three coordinates"),
    "model.obj": ("v 0 0 0", "expected a CityJSON"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_file_raises_a_sentence(tmp_path, name):
    text, sentence = BROKEN[name]
    with pytest.raises(InputError, match=sentence):
        list(read_solids(write_text(tmp_path, name, text)))


@pytest.mark.parametrize("name", ["a.city.json", "a.city.jsonl"])
def test_marks_of_the_encoding_are_no_damage(name, tmp_path):
    """Editors begin files with one, and joined files have more."""
    text = "\n".join("\ufeff" + line for line in FILES[name].split("\n") if line)
    ((id, _),) = read_solids(write_text(tmp_path, name, text))
    assert id == "house"


def test_missing_and_binary_files_raise_a_sentence(tmp_path):
    sentence = r"got the folder .*; name one in it, such as buildings\.city\.jsonl"
    with pytest.raises(InputError, match=sentence):
        list(read_solids(tmp_path))
    with pytest.raises(InputError, match="got none"):
        list(read_solids(tmp_path / "none.json"))
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InputError, match=r"readable text.*; save it as UTF-8"):
        list(read_solids(tmp_path / "binary.json"))


@pytest.mark.skipif(
    not DEN_HAAG.exists(), reason="needs The Hague's city model in ../shared/data/denhaag"
)
def test_the_hague_reads_whole_and_most_of_it_is_valid():
    solids = dict(read_solids(DEN_HAAG))
    assert len(solids) == 1990
    codes = [
        tuple(sorted({f.code for f in check_solid(solid, planarity_m=0.01)}))
        for solid in list(solids.values())[::4]
    ]
    assert codes.count(()) > 450
    assert set(codes) <= {(), (102,), (104,), (203,)}
