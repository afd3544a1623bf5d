"""glTF and OBJ files read back by a few lines of their own, and their triangles weighed."""

from itertools import combinations

import numpy as np
import pytest

from glb_files import accessor_values, parse_glb
from hiproof.cli.app import import_command
from hiproof.errors import HiproofError
from hiproof.geometry.rings import ring_normal
from hiproof.primitives import CATALOGUE
from hiproof.write.colours import (
    CHANGE_COLOURS,
    COLOURS,
    GRADE_COLOURS,
    RESIDUAL_STOPS,
    ROOF_COLOURS,
    STATUS_COLOURS,
    SUN_STOPS,
    UNKNOWN_COLOUR,
    WALL_COLOUR,
    linear_rgb,
    type_colour,
)
from hiproof.write.meshes.gltf import write_models as write_glb
from hiproof.write.meshes.obj import write_models as write_obj
from hiproof.write.meshes.triangles import face_triangles, faces_triangles
from hiproof.write.meshes.viewed import ViewedModel
from sample_models import SOLIDS, courtyard_solid, gable_solid, two_parts, write_sample_run

BUILDINGS = [
    ViewedModel(id, kind, solid, {"height": 3.5}, {0: kind}) for id, (kind, solid) in SOLIDS.items()
]


def glb_positions(document, binary, mesh):
    primitives = document["meshes"][mesh]["primitives"]
    parts = [
        accessor_values(document, binary, primitive["attributes"]["POSITION"])
        for primitive in primitives
    ]
    return np.concatenate(parts).reshape(-1, 3, 3)


def volume(triangles):
    return np.einsum("ij,ij->", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2])) / 6


@pytest.mark.parametrize("solid", [gable_solid(), courtyard_solid()], ids=["gable", "courtyard"])
def test_triangles_tile_every_face_and_keep_its_side(solid):
    for face, triangles in zip(
        solid.faces, faces_triangles(solid.vertices, solid.faces), strict=True
    ):
        assert (triangles == face_triangles(solid.vertices, face)).all()
        expected = sum(ring_normal(solid.vertices[list(ring)]) for ring in face.rings)
        normal = sum(ring_normal(solid.vertices[t]) for t in triangles)
        np.testing.assert_allclose(normal, expected, atol=1e-9)
        areas = [np.linalg.norm(ring_normal(solid.vertices[t])) for t in triangles]
        assert sum(areas) == pytest.approx(np.linalg.norm(expected))


def test_glb_holds_every_building_with_its_properties(tmp_path):
    assert write_glb(tmp_path / "a.glb", BUILDINGS, crs="EPSG:7415") == 2
    document, binary = parse_glb(tmp_path / "a.glb")
    assert [node["extras"] for node in document["nodes"]] == [
        {"id": "house-1", "roof_type": "gable", "height": 3.5},
        {"id": "block 2", "roof_type": "flat", "height": 3.5},
    ]
    assert document["buffers"][0]["byteLength"] == len(binary)
    assert document["asset"]["extras"]["crs"] == "EPSG:7415"
    for mesh, expected in enumerate([8 * 12 * 5.5, (400 - 64) * 9.0]):
        assert volume(glb_positions(document, binary, mesh)) == pytest.approx(expected, rel=1e-5)


def test_attributes_of_the_input_do_not_take_the_place_of_id_and_type(tmp_path):
    attributes = {"id": "a", "roof_type": "thatch", "type": "church"}
    write_glb(
        tmp_path / "a.glb", [ViewedModel("a", "gable", gable_solid(), attributes, {0: "gable"})]
    )
    (node,) = parse_glb(tmp_path / "a.glb")[0]["nodes"]
    assert node["extras"] == {
        "id": "a",
        "roof_type": "gable",
        "roof_type_input": "thatch",
        "type": "church",
    }


def test_obj_holds_every_building_closed(tmp_path):
    assert write_obj(tmp_path / "a.obj", BUILDINGS) == 2
    lines = (tmp_path / "a.obj").read_text().splitlines()
    assert [line for line in lines if line.startswith("o ")] == ["o house-1", "o block_2"]
    materials = {
        line[7:]
        for line in (tmp_path / "a.mtl").read_text().splitlines()
        if line.startswith("newmtl")
    }
    assert {line[7:] for line in lines if line.startswith("usemtl")} <= materials
    vertices = np.array([line.split()[1:] for line in lines if line.startswith("v ")], float)
    faces = [[int(i) - 1 for i in line.split()[1:]] for line in lines if line.startswith("f ")]
    fans = np.array(
        [(face[0], face[i], face[i + 1]) for face in faces for i in range(1, len(face) - 1)]
    )
    assert volume(vertices[fans]) == pytest.approx(8 * 12 * 5.5 + (400 - 64) * 9.0)


def test_an_unheard_of_roof_type_gets_a_material_that_exists(tmp_path):
    write_obj(tmp_path / "a.obj", [ViewedModel("x", "igloo", gable_solid(), {}, {0: "igloo"})])
    assert "usemtl roof_unknown" in (tmp_path / "a.obj").read_text()


def test_a_roof_face_has_the_colour_of_its_part(tmp_path):
    write_glb(tmp_path / "a.glb", [two_parts()])
    document, _ = parse_glb(tmp_path / "a.glb")
    materials = [document["materials"][p["material"]] for p in document["meshes"][0]["primitives"]]
    colours = {m["name"]: m["pbrMetallicRoughness"]["baseColorFactor"] for m in materials}
    assert list(colours) == ["roof gable", "roof hip", "WallSurface", "GroundSurface"]
    assert [colours[f"roof {kind}"][:3] for kind in ("gable", "hip")] == [
        list(linear_rgb(type_colour(kind))) for kind in ("gable", "hip")
    ]
    write_obj(tmp_path / "a.obj", [two_parts()])
    is_used = [
        line[7:]
        for line in (tmp_path / "a.obj").read_text().splitlines()
        if line.startswith("usemtl")
    ]
    assert is_used == ["roof_gable", "roof_hip", "WallSurface", "GroundSurface"]


def test_no_buildings_make_a_valid_empty_file(tmp_path):
    write_glb(tmp_path / "a.glb", [])
    document, binary = parse_glb(tmp_path / "a.glb")
    assert document["scenes"] == [{}] and not binary and "meshes" not in document


@pytest.mark.parametrize("format", ["glb", "obj"])
def test_the_command_converts_a_run(tmp_path, format):
    write_sample_run(tmp_path)
    import_command("convert")([str(tmp_path), "--format", format], standalone_mode=False)
    assert (tmp_path / f"buildings.{format}").stat().st_size > 500


def test_a_place_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(HiproofError, match="expected to write"):
        write_glb(tmp_path / "file" / "a.glb", BUILDINGS)


# linear RGB as people see it: all cones, and without one kind of them (Machado et al. 2009, table)
SEEN = {
    "all cones": np.eye(3),
    "protanopia": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deuteranopia": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritanopia": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
LEGENDS = {
    "roof types": [*ROOF_COLOURS.values(), WALL_COLOUR, COLOURS["mark"]],
    "quality": [*GRADE_COLOURS.values(), UNKNOWN_COLOUR],
    "status": list(STATUS_COLOURS.values()),
    "changes": [*CHANGE_COLOURS.values(), COLOURS["unchanged"]],
    "residuals": [colour for _, colour in RESIDUAL_STOPS],
    "sun": [colour for _, colour in SUN_STOPS],
}
FAR = {"residuals": 20.0, "sun": 20.0}  # in CIELAB, neighbours of a ramp may be nearer than others
FAR_ELSE = 25.0


def cielab(linear):
    """CIELAB of linear RGB under daylight (D65)."""
    share = XYZ @ np.clip(linear, 0, 1) / XYZ.sum(axis=1)
    root = np.where(share > 0.008856, np.cbrt(share), 7.787 * share + 16 / 116)
    return np.array([116 * root[1] - 16, 500 * (root[0] - root[1]), 200 * (root[1] - root[2])])


@pytest.mark.parametrize("vision", SEEN)
@pytest.mark.parametrize("legend", LEGENDS)
def test_colours_of_a_legend_are_far_apart(legend, vision):
    colours = [cielab(np.array(SEEN[vision]) @ linear_rgb(colour)) for colour in LEGENDS[legend]]
    nearest = min(np.linalg.norm(a - b) for a, b in combinations(colours, 2))
    assert nearest >= FAR.get(legend, FAR_ELSE)


def test_a_legend_has_at_most_eight_colours():
    legends = (ROOF_COLOURS, GRADE_COLOURS, STATUS_COLOURS, RESIDUAL_STOPS)
    assert max(map(len, legends)) <= 8
    assert {type_colour(kind) for kind in (*CATALOGUE, "free", None)} == set(ROOF_COLOURS.values())
