"""3D Tiles read back by lines of our own: each building once, in its place, under its own
attributes.
"""

import json
import shutil
import subprocess
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from pyproj import CRS

from glb_files import accessor_values, parse_glb, view_bytes
from hiproof.cli.convert import convert
from hiproof.errors import HiproofError, InputError, InputWarning
from hiproof.read.crs import find_units
from hiproof.write.colours import linear_rgb, type_colour
from hiproof.write.meshes.tiles import Globe, write_models
from hiproof.write.meshes.tiles.content import NO_NUMBER, Found
from hiproof.write.meshes.tiles.tileset import quadtree
from hiproof.write.meshes.viewed import ViewedModel
from hiproof.write.naming import FileUnits
from sample_models import ORIGIN, courtyard_solid, gable_solid, two_parts
from sample_parameters import write_parameters_of_each_kind

GEOID_M = 43.2
PLACES = {  # a place on land in each CRS, in its own unit
    "EPSG:7415": (85000.0, 446000.0),
    "EPSG:28992": (85000.0, 446000.0),
    "EPSG:25832": (360000.0, 5700000.0),
    "EPSG:2154+5720": (652000.0, 6862000.0),
    "EPSG:2263+6360": (985000.0, 200000.0),
    "EPSG:32633": (500000.0, 5000000.0),
}


@pytest.mark.parametrize(
    ("name", "sentence"),
    [("a.gpkg", "expected a new folder"), ("photos/a.jpg", "choose another name")],
)
def test_what_is_no_tileset_is_left_alone(tmp_path, name, sentence):
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("x")
    with pytest.raises(HiproofError, match=sentence):
        write_models(tmp_path / name.partition("/")[0], town(2), "EPSG:7415", GEOID_M)
    assert (tmp_path / name).read_text() == "x"


def town(count=60, seed=0):
    """Houses of many sizes over half a kilometre, attributes that are not always known."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        position = ORIGIN + [*np.round(rng.uniform(0, 500, 2), 2), np.round(rng.uniform(0, 5), 2)]
        width = float(rng.uniform(4, 30))
        solid = (
            courtyard_solid(side=width, yard=width / 3)
            if k % 5 == 0
            else gable_solid(width, 1.5 * width)
        )
        attributes = {
            "k": k,
            "half known": None if k % 2 else k / 2,
            "name": None if k % 3 else f"Haus {k} ü",
            "flag": k > 3,
        }
        kind = "flat" if k % 5 == 0 else "gable"
        yield ViewedModel(f"house-{k}", kind, solid.move(position), attributes, {0: kind})


@pytest.fixture(scope="module")
def globe():
    return Globe.of("EPSG:7415", GEOID_M)


@pytest.fixture(scope="module")
def tiled_town(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tiles") / "town.3dtiles"
    assert write_models(folder, town(), "EPSG:7415", GEOID_M, most=120) == 60
    return folder, json.loads((folder / "tileset.json").read_text())


def iterate_tiles(tile, ancestors=()):
    """(tile, those above it) of all tiles."""
    yield tile, ancestors
    for child in tile.get("children", ()):
        yield from iterate_tiles(child, (*ancestors, tile))


def is_inside(xyz, volume, slack=1e-6):
    """Whether all of `xyz` (n, 3) lie in a box whose axes are those of the frame."""
    middle, half = np.array(volume["box"][:3]), np.array(volume["box"][3:]).reshape(3, 3)
    assert (half == np.diag(np.diag(half))).all()
    return (np.abs(xyz - middle) <= np.diag(half) + slack).all()


def compute_corners(volume):
    middle, half = np.array(volume["box"][:3]), np.diag(np.array(volume["box"][3:]).reshape(3, 3))
    return np.array([middle - half, middle + half])


def read_content(folder, tile):
    """Places (n, 3) in the tileset's frame, z up, the building of each and the table's rows."""
    document, binary = parse_glb(folder / tile["content"]["uri"])
    (mesh,) = document["meshes"]
    (primitive,) = mesh["primitives"]
    x, y, z = accessor_values(document, binary, primitive["attributes"]["POSITION"]).T.astype(float)
    tx, ty, tz = document["nodes"][0]["translation"]
    places = np.column_stack([x + tx, -(z + tz), y + ty])
    ids = accessor_values(document, binary, primitive["attributes"]["_FEATURE_ID_0"]).astype(int)
    indices = accessor_values(document, binary, primitive["indices"])
    return places[indices], ids[indices], read_table_rows(document, binary)


def read_table_rows(document, binary):
    extension = document["extensions"]["EXT_structural_metadata"]
    (table,) = extension["propertyTables"]
    columns = {}
    for id, property in extension["schema"]["classes"][table["class"]]["properties"].items():
        column = table["properties"][id]
        values = view_bytes(document, binary, column["values"])
        if property["type"] == "SCALAR":
            columns[property["name"]] = np.frombuffer(values, "<f8").tolist()
        else:
            ends = np.frombuffer(view_bytes(document, binary, column["stringOffsets"]), "<u4")
            columns[property["name"]] = [values[a:b].decode() for a, b in pairwise(ends.tolist())]
    assert {len(column) for column in columns.values()} == {table["count"]}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def test_every_building_stands_in_one_tile_at_its_place_within_a_centimetre(tiled_town, globe):
    folder, tileset = tiled_town
    transform = np.array(tileset["root"]["transform"]).reshape(4, 4).T
    expected = {model.id: model.solid for model in town()}
    results = []
    for tile, _ in iterate_tiles(tileset["root"]):
        places, ids, rows = read_content(folder, tile)
        world = globe.from_earth(places @ transform[:3, :3].T + transform[:3, 3])
        for number, row in enumerate(rows):
            results.append(row["id"])
            triangles = world[ids == number].reshape(-1, 3, 3)
            solid = expected[row["id"]]
            distance = np.linalg.norm(triangles.reshape(-1, 1, 3) - solid.vertices, axis=2)
            assert distance.min(axis=1).max() < 0.01 and distance.min(axis=0).max() < 0.01
            centred = triangles - solid.vertices.mean(axis=0)
            volume = np.einsum("ij,ij->", centred[:, 0], np.cross(centred[:, 1], centred[:, 2])) / 6
            assert volume > 10  # the triangles close it, and face outwards
    assert sorted(results) == sorted(expected)


def boxes_on_earth(folder):
    """The least and the largest Earth-centred coordinates (2, 3) of every building."""
    tileset, corners = json.loads((folder / "tileset.json").read_text()), {}
    transform = np.array(tileset["root"]["transform"]).reshape(4, 4).T
    for tile, _ in iterate_tiles(tileset["root"]):
        places, ids, rows = read_content(folder, tile)
        earth = places @ transform[:3, :3].T + transform[:3, 3]
        corners |= {
            row["id"]: np.array([f(earth[ids == k], axis=0) for f in (np.min, np.max)])
            for k, row in enumerate(rows)
        }
    return corners


@pytest.mark.parametrize("out", ["EPSG:25831", "EPSG:25832", "EPSG:3857"])
def test_models_stand_in_the_same_place_by_way_of_another_crs(tiled_town, tmp_path, out):
    """Whatever the frames of the tilesets, which may lie half a metre apart."""
    way = FileUnits.of("EPSG:7415", out_crs=out).gml
    moved = (
        m._replace(solid=replace(m.solid, vertices=way.from_metres(m.solid.vertices)))
        for m in town()
    )
    write_models(tmp_path / "there.3dtiles", moved, f"{out}+5709", GEOID_M)
    direct, indirect = boxes_on_earth(tiled_town[0]), boxes_on_earth(tmp_path / "there.3dtiles")
    assert direct.keys() == indirect.keys()
    assert max(np.abs(direct[id] - indirect[id]).max() for id in direct) < 0.01


def test_attributes_are_those_of_the_building(tiled_town):
    folder, tileset = tiled_town
    expected = {model.id: (model.roof_type, model.attributes) for model in town()}
    for tile, _ in iterate_tiles(tileset["root"]):
        for row in read_content(folder, tile)[2]:
            roof_type, attributes = expected[row["id"]]
            assert row["type"] == roof_type and row["k"] == attributes["k"]
            assert row["half known"] == (
                NO_NUMBER if attributes["half known"] is None else attributes["half known"]
            )
            assert row["name"] == (attributes["name"] or "")
            assert row["flag"] == str(attributes["flag"]).lower()


def test_a_roof_face_has_the_colour_of_its_part(tmp_path, globe):
    write_models(tmp_path / "a.3dtiles", [two_parts()], "EPSG:7415", GEOID_M)
    document, binary = parse_glb(tmp_path / "a.3dtiles/tiles/r.glb")
    names = document["meshes"][0]["primitives"][0]["attributes"]
    upward = accessor_values(document, binary, names["NORMAL"])[:, 1]
    colours = accessor_values(document, binary, names["COLOR_0"])
    painted = colours[(upward > 0.1) & (upward < 0.9)].tolist()
    types = [linear_rgb(type_colour(kind)) for kind in ("gable", "hip")]
    expected = {(*(round(255 * part) for part in rgb), 255) for rgb in types}
    assert set(map(tuple, painted)) == expected


def test_boxes_hold_what_is_drawn_in_them_and_below(tiled_town):
    folder, tileset = tiled_town
    for tile, ancestors in iterate_tiles(tileset["root"]):
        places, _, _ = read_content(folder, tile)
        assert is_inside(places, tile["content"]["boundingVolume"])
        for outer in (tile, *ancestors):
            assert is_inside(places, outer["boundingVolume"])
            assert is_inside(compute_corners(tile["boundingVolume"]), outer["boundingVolume"])


def test_geometric_errors_decrease_to_nothing(tiled_town):
    _, tileset = tiled_town
    assert len(list(iterate_tiles(tileset["root"]))) > 5
    for tile, ancestors in iterate_tiles(tileset["root"]):
        assert tile["refine"] == "ADD"
        assert tile["geometricError"] <= (ancestors[-1] if ancestors else tileset)["geometricError"]
        assert (tile["geometricError"] > 0) == bool(tile.get("children"))


def test_a_tile_is_one_draw_call_of_so_many_triangles(tiled_town):
    folder, tileset = tiled_town
    for tile, _ in iterate_tiles(tileset["root"]):
        places, ids, _ = read_content(folder, tile)
        assert len(places) // 3 <= 120 or len(set(ids.tolist())) == 1


@pytest.mark.parametrize("seed", range(4))
def test_a_quadtree_parts_its_buildings_and_shows_the_largest_first(seed):
    rng = np.random.default_rng(seed)
    centres = rng.uniform(0, 10 ** (seed + 2), (200, 2)).round(seed % 2)
    sizes, triangles = rng.uniform(1, 50, 200), rng.integers(1, 90, 200)
    if seed == 3:
        centres[:150] = 5.0  # all in one place
    root = quadtree(centres, sizes, triangles, limit=300, widest=20_000)
    items, stack = [], [root]
    while stack:
        tile = stack.pop()
        items += tile.items.tolist()
        assert len(tile.items) < 2 or triangles[tile.items].sum() <= 300
        if len(tile.items):
            assert np.ptp(centres[tile.items], axis=0).max() <= 20_000
            assert sizes[tile.items].min() >= sizes[tile.list_below()].max(initial=0)
        stack += tile.children
    assert sorted(items) == list(range(200))


@pytest.mark.parametrize("name", PLACES)
def test_places_come_back_from_the_globe(name):
    globe, units = Globe.of(name), find_units(CRS(name))
    rng = np.random.default_rng(0)
    world = units.to_metres(np.append(PLACES[name], 0.0)) + rng.uniform(0, 1000, (50, 3))
    earth = globe.to_earth(world)
    assert 6.3e6 < np.linalg.norm(earth, axis=1).min() < 6.4e6
    np.testing.assert_allclose(globe.from_earth(earth), world, atol=1e-3)
    scale = np.linalg.norm(earth[1:] - earth[0], axis=1) / np.linalg.norm(
        world[1:] - world[0], axis=1
    )
    assert abs(scale - 1).max() < 2e-3  # a projection's own, and metres that are metres


def test_a_geoid_height_raises_all_by_as_much():
    world = np.append(PLACES["EPSG:28992"], 3.0)[None]
    lower, upper = (Globe.of("EPSG:28992", height) for height in (0.0, 43.2))
    assert upper.geographic(world)[0, 2] == pytest.approx(46.2)
    assert np.linalg.norm(upper.to_earth(world) - lower.to_earth(world)) == pytest.approx(
        43.2, abs=1e-6
    )
    assert "43.2" in upper.heights and upper.is_known


def test_heights_that_are_guessed_are_said_to_be():
    plan = Globe.of("EPSG:28992")
    assert not plan.is_known and "names no heights" in plan.heights
    above_sea = Globe.of("EPSG:7415")
    if not above_sea.is_known:  # pyproj's grid of the Dutch geoid is seldom installed
        assert "NAP height" in above_sea.heights and "--geoid-height" in above_sea.heights


def test_coordinates_of_another_crs_are_refused():
    with pytest.raises(InputError, match="no place there"):
        Globe.of("EPSG:7415").to_earth(np.array([[1e9, 1e9, 0.0]]))


def test_without_a_crs_tiles_keep_the_planes_own_axes(tmp_path):
    with pytest.warns(InputWarning, match="nowhere on the globe"):
        write_models(tmp_path / "a.3dtiles", town(3))
    tileset = json.loads((tmp_path / "a.3dtiles" / "tileset.json").read_text())
    assert "transform" not in tileset["root"]
    places, ids, rows = read_content(tmp_path / "a.3dtiles", tileset["root"])
    solid = {model.id: model.solid for model in town(3)}[rows[0]["id"]]
    world = places[ids == 0] + tileset["asset"]["extras"]["origin"]
    np.testing.assert_allclose(world.min(axis=0), solid.vertices.min(axis=0), atol=0.001)


def test_an_older_tileset_is_replaced_whole(tmp_path):
    folder = tmp_path / "a.3dtiles"
    write_models(folder, town(40), "EPSG:7415", GEOID_M, most=60)
    write_models(folder, town(2), "EPSG:7415", GEOID_M)
    assert [file.name for file in (folder / "tiles").iterdir()] == ["r.glb"]
    assert [file.name for file in tmp_path.iterdir()] == ["a.3dtiles"]


def test_a_failure_leaves_the_older_tileset(tmp_path):
    folder = tmp_path / "a.3dtiles"
    write_models(folder, town(2), "EPSG:7415", GEOID_M)
    content = (folder / "tiles" / "r.glb").read_bytes()
    nowhere = ViewedModel("x", "flat", gable_solid().move(np.array([1e9, 1e9, 0])), {}, {})
    with pytest.raises(InputError, match="no place there"):
        write_models(folder, [*town(3), nowhere], "EPSG:7415", GEOID_M)
    assert (folder / "tiles" / "r.glb").read_bytes() == content
    assert [file.name for file in tmp_path.iterdir()] == ["a.3dtiles"]


def test_no_solids_are_told(tmp_path):
    with pytest.raises(InputError, match="expected buildings with solids"):
        write_models(tmp_path / "a.3dtiles", [], "EPSG:7415", GEOID_M)
    assert not list(tmp_path.iterdir())


def test_properties_have_ids_that_the_extension_allows():
    collected = Found()
    collected.add({"a b": 1, "a-b": "x", "9": None, "big": 2**60, "both": 1, "ü": True})
    collected.add({"a b": 2.5, "9": 3, "both": "y"})
    properties = {p.name: (p.id, p.is_number) for p in collected.properties()}
    assert properties == {
        "a b": ("a_b", True),
        "a-b": ("a_b_2", False),
        "9": ("_9", True),
        "big": ("big", False),
        "both": ("both", False),
        "ü": ("_", False),
    }


def test_the_command_tells_id_type_and_parameters(tmp_path, capsys):
    write_parameters_of_each_kind(tmp_path / "parameters.jsonl")
    convert(tmp_path, tmp_path / "city.3dtiles", geoid_height=43.2)
    assert "3 buildings" in capsys.readouterr().out
    tileset = json.loads((tmp_path / "city.3dtiles" / "tileset.json").read_text())
    assert "plus 43.2 m" in tileset["asset"]["extras"]["heights"]
    rows = {row["id"]: row for row in read_content(tmp_path / "city.3dtiles", tileset["root"])[2]}
    assert {id: row["type"] for id, row in rows.items()} == {
        "gable": "gable",
        "hip and tower": "hip",
        "yard": "flat",
    }
    (part,) = json.loads(rows["gable"]["parameters"])["parts"]
    assert part["parameters"] == {"width": 8.0, "length": 12.0, "height": 3.0}
    assert rows["gable"]["rf_volume_lod22"] == 624.0 and rows["gable"]["name"] == "mill"


def test_attributes_of_the_input_do_not_take_the_place_of_id_type_and_parameters(tmp_path, globe):
    attributes = {"id": 7, "type": "church", "year": 1905}
    model = ViewedModel("a", "gable", gable_solid().move(ORIGIN), attributes, {0: "gable"})
    write_models(tmp_path / "a.3dtiles", [model], "EPSG:7415", GEOID_M)
    tileset = json.loads((tmp_path / "a.3dtiles" / "tileset.json").read_text())
    (row,) = read_content(tmp_path / "a.3dtiles", tileset["root"])[2]
    assert row == {
        "id": "a",
        "type": "gable",
        "id_input": 7.0,
        "type_input": "church",
        "year": 1905.0,
    }


def find_node_package(package):
    """Whether Node.js finds `package`, and where packages for everyone lie."""
    if not shutil.which("node") or not shutil.which("npm"):
        return False, ""
    root = subprocess.run(
        ["npm", "root", "--global"], capture_output=True, text=True
    ).stdout.strip()
    process = subprocess.run(
        ["node", "-e", f"require('{package}')"], capture_output=True, env=node_environment(root)
    )
    return process.returncode == 0, root


def node_environment(root):
    import os

    paths = filter(None, (root, os.environ.get("NODE_PATH")))
    return os.environ | {"NODE_PATH": os.pathsep.join(paths)}


def test_the_gltf_validator_finds_no_fault(tiled_town):
    is_installed, root = find_node_package("gltf-validator")
    if not is_installed:
        pytest.skip("no gltf-validator here; npm install --global gltf-validator")
    script = """
    const validator = require("gltf-validator"), fs = require("fs");
    validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1]))).then(report =>
      console.log(JSON.stringify(
        [report.issues.numErrors, report.issues.numWarnings, report.info.drawCallCount])));
    """
    folder, _ = tiled_town
    for file in sorted((folder / "tiles").iterdir())[:3]:
        process = subprocess.run(
            ["node", "-e", script, str(file)],
            capture_output=True,
            text=True,
            env=node_environment(root),
            timeout=120,
        )
        assert json.loads(process.stdout) == [0, 0, 1], process.stderr
