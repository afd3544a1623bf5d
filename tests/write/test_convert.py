"""`hiproof convert`: every format from a run and from files, opened by programs that we did not
write.
"""

import importlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyogrio
import pytest
import shapely
from lxml import etree

import hiproof
from hiproof.cli.convert import convert
from hiproof.errors import InputError, InputWarning
from hiproof.formats import CONVERTED, FORMATS
from hiproof.parametric.run import build_file
from hiproof.read.models.solids import read_solids
from hiproof.write.colours import WALL_COLOUR, srgb
from written_run import require_schema

SCHEMAS = Path(__file__).parents[3] / "shared" / "schemas"
PARSER = {"no_network": True, "huge_tree": True}
MODELLED = ["gable", "hip and tower", "yard"]  # the run has one more without a model, "lost"


def reader(name):
    return pytest.importorskip(name, reason=f"no {name} here: pip install 'hiproof[test]'")


@pytest.fixture(scope="module")
def run(run_of_each_kind):
    return run_of_each_kind


@pytest.fixture(scope="module")
def volumes(run):
    """The volume of each modelled building, m3."""
    return {b.id: b.volume for b in hiproof.open_run(run) if b.built}


@pytest.fixture(scope="module")
def outputs(run, tmp_path_factory):
    """A function that converts the run to a format once, and gives the path."""
    folder = tmp_path_factory.mktemp("outputs")

    def write(name):
        if name in ("parquet", "parquet_parts", "parquet_surfaces"):
            reader("pyarrow")
        if name == "ifc":
            reader("ifcopenshell")
        if name == "dxf":
            reader("ezdxf")
        if name == "3dm":
            reader("rhino3dm")
        path = folder / FORMATS[name].file
        if not path.exists():
            given = {"geoid_height": 43.2} if name == "3dtiles" else {}
            convert(run, path, format=find_format(name), **given)
        return path

    return write


def find_format(name):
    return importlib.import_module("hiproof.cli.convert").FormatName(name)


@pytest.mark.parametrize(
    "name", [name for name in CONVERTED if FORMATS[name].fragment and "parquet" not in name]
)
def test_what_a_run_has_written_is_written_again_to_the_byte(name, run, outputs):
    original = run / FORMATS[name].file
    if not original.exists():
        build_file(
            run / "parameters.jsonl", run.parent / "other", changes={"write": {"citygml": "both"}}
        )
        original = run.parent / "other" / FORMATS[name].file
    assert outputs(name).read_bytes() == original.read_bytes()


def test_the_suffix_chooses_the_format(run, tmp_path):
    for name, head in (("a.glb", b"glTF"), ("b.gml", b"<?xml"), ("c.city.json", b'{"type"')):
        convert(run, tmp_path / name)
        assert (tmp_path / name).read_bytes().startswith(head)
    with pytest.raises(InputError, match=r"one of \.gml, .*got .*a\.doc; or pass --format"):
        convert(run, tmp_path / "a.doc")


def test_a_file_of_the_run_is_not_replaced_without_a_name(run):
    with pytest.raises(InputError, match=r"buildings\.gml is there already"):
        convert(run, format=find_format("citygml2"))


@pytest.mark.parametrize("name", ["cityjson", "cityjsonseq"])
def test_cjio_opens_cityjson(outputs, name):
    """In a process of its own, because it changes how all of a process writes numbers in JSON."""
    reader("cjio")
    source = "stdin" if name == "cityjsonseq" else str(outputs(name))
    command = [sys.executable, "-c", "from cjio.cjio import cli; cli()", source, "info"]
    with outputs(name).open() as file:
        done = subprocess.run(command, stdin=file, capture_output=True, text=True, check=True)
    told = "".join(done.stdout.split())
    assert "CityJSONversion=2.0" in told and "EPSG=7415" in told and "Building(4)" in told


@pytest.mark.parametrize("name", ["citygml2", "citygml3"])
def test_citygml_is_valid_by_its_schema(outputs, name):
    require_schema(name).assertValid(etree.parse(outputs(name), etree.XMLParser(**PARSER)))


@pytest.mark.parametrize("name", ["citygml2", "citygml3"])
def test_gdal_opens_citygml(outputs, name):
    info = pyogrio.read_info(outputs(name), layer="Building", force_feature_count=True)
    assert info["features"] == 4


@pytest.mark.parametrize(("name", "count"), [("gpkg", 4), ("parquet", 4), ("fgb", 3)])
def test_geopandas_opens_the_outlines(outputs, name, count):
    """FlatGeobuf has no rows without an outline."""
    geopandas = reader("geopandas")
    if name == "parquet":
        frame = geopandas.read_parquet(outputs(name))
    else:
        frame = geopandas.read_file(outputs(name), layer="buildings")
    frame = frame.set_index("id")
    assert len(frame) == count and frame.crs.to_epsg() == 28992
    assert frame.geometry["gable"].area == 96.0 and frame.geometry["yard"].area == 88.0
    assert frame["hiproof_roof_type"]["gable"] == "gable" and frame["year"]["yard"] == 1905


@pytest.mark.parametrize("name", ["glb", "stl"])
def test_trimesh_opens_closed_meshes(outputs, volumes, name):
    trimesh = reader("trimesh")
    mesh = trimesh.load(outputs(name), force="mesh")
    mesh.merge_vertices(merge_norm=True, merge_tex=True)
    parts = mesh.split(only_watertight=True)
    assert sorted(part.volume for part in parts) == pytest.approx(
        sorted(volumes.values()), rel=1e-4
    )


def test_trimesh_opens_obj(outputs, volumes):
    trimesh = reader("trimesh")
    mesh = trimesh.load(outputs("obj"), force="mesh")
    mesh.merge_vertices(merge_norm=True, merge_tex=True)
    assert mesh.volume == pytest.approx(sum(volumes.values()), rel=1e-4)


def test_tiles_are_valid_by_the_schema_and_trimesh_opens_them(outputs, volumes, monkeypatch):
    trimesh = reader("trimesh")
    folder = outputs("3dtiles")
    (tile,) = folder.glob("tiles/*.glb")
    mesh = trimesh.load(tile, force="mesh")
    assert abs(mesh.volume) == pytest.approx(sum(volumes.values()), rel=2e-3)  # the map's scale
    if not (SCHEMAS / "3dtiles" / "validate.py").exists():
        pytest.skip(f"needs the schemas of 3D Tiles 1.1 in {SCHEMAS}")
    monkeypatch.syspath_prepend(SCHEMAS / "3dtiles")
    importlib.import_module("validate").check(folder / "tileset.json")


def test_ifcopenshell_opens_valid_buildings(outputs, volumes):
    ifcopenshell = reader("ifcopenshell")
    for name in ("validate", "geom", "util.shape", "util.element"):
        importlib.import_module(f"ifcopenshell.{name}")
    model, log = ifcopenshell.open(outputs("ifc")), ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(model, log)
    assert log.statements == [] and model.schema_identifier.startswith("IFC4X3")
    buildings = {building.Name: building for building in model.by_type("IfcBuilding")}
    assert list(buildings) == MODELLED
    for name, building in buildings.items():
        (contained,) = building.ContainsElements
        elements, volume = contained.RelatedElements, 0.0
        assert {element.is_a() for element in elements} == {"IfcRoof", "IfcWall", "IfcSlab"}
        for element in elements:
            shape = ifcopenshell.geom.create_shape(ifcopenshell.geom.settings(), element)
            vertices = ifcopenshell.util.shape.get_vertices(shape.geometry)
            faces = ifcopenshell.util.shape.get_faces(shape.geometry)
            volume += np.linalg.det(vertices[faces]).sum() / 6
            (style,) = shape.geometry.materials
            if element.is_a("IfcWall"):
                colour = [style.diffuse.r(), style.diffuse.g(), style.diffuse.b()]
                assert colour == pytest.approx(srgb(WALL_COLOUR))
        assert volume == pytest.approx(volumes[name], rel=1e-6)  # they close the solid
    assert {roof.PredefinedType for roof in model.by_type("IfcRoof")} >= {"GABLE_ROOF"}
    properties = ifcopenshell.util.element.get_psets(buildings["yard"])["hiproof"]
    assert properties["year"] == 1905 and properties["rf_volume_lod22"] == pytest.approx(440.0)
    (conversion,), (crs,) = (
        model.by_type(kind) for kind in ("IfcMapConversion", "IfcProjectedCRS")
    )
    assert (conversion.Eastings, conversion.Northings) == (84994.0, 445996.0)
    assert crs.Name == "EPSG:7415" and conversion.Scale == 1.0


def test_ifc_in_feet_names_its_unit(run, tmp_path):
    reader("ifcopenshell")
    convert(run, tmp_path / "a.ifc", crs="EPSG:2263+5703")
    text = (tmp_path / "a.ifc").read_text()
    assert "IFCMAPCONVERSIONSCALED" in text and "IFCCONVERSIONBASEDUNIT" in text


def test_rhino3dm_opens_meshes_that_close_each_solid(outputs, volumes):
    rhino = reader("rhino3dm")
    document = rhino.File3dm.Read(str(outputs("3dm")))
    layers = {layer.Index: layer.Name for layer in document.Layers}
    found, kinds = dict.fromkeys(volumes, 0.0), set()
    for item in document.Objects:
        mesh, attributes = item.Geometry, item.Attributes
        vertices = np.array([[p.X, p.Y, p.Z] for p in mesh.Vertices], float)
        faces = np.array([mesh.Faces[k][:3] for k in range(len(mesh.Faces))])
        found[attributes.Name] += np.linalg.det(vertices[faces]).sum() / 6
        kinds.add(layers[attributes.LayerIndex])
        assert dict(attributes.GetUserStrings())["id"] == attributes.Name
    assert found == pytest.approx(volumes, rel=1e-4)  # of float32
    assert kinds == {"RoofSurface", "WallSurface", "GroundSurface"}
    assert document.Strings["origin"].startswith("84994 445996 ")
    assert document.Strings["crs"] == "EPSG:7415"


def open_sound_drawing(path):
    """Open a drawing that ezdxf's own audit finds nothing wrong with."""
    document = reader("ezdxf").readfile(path)
    assert document.audit().errors == [] and document.audit().fixes == []
    return document


def measure_drawing(space):
    """The volume that the 3D faces of a drawing enclose, and the area of its outlines."""
    corners = np.array([[tuple(p) for p in f.wcs_vertices()[:3]] for f in space.query("3DFACE")])
    corners -= corners[0, 0]
    volume = np.linalg.det(corners).sum() / 6
    outlines = [shapely.Polygon(p.get_points("xy")) for p in space.query("LWPOLYLINE")]
    return volume, shapely.unary_union(outlines).area


def test_ezdxf_opens_faces_on_layers_and_outlines(run, outputs, volumes):
    document = open_sound_drawing(outputs("dxf"))
    space = document.modelspace()
    assert document.header["$INSUNITS"] == 6
    assert [text.dxf.text for text in space.query("TEXT")] == MODELLED
    volume, _ = measure_drawing(space)
    assert volume == pytest.approx(sum(volumes.values()), rel=1e-6)
    layers = {face.dxf.layer for face in space.query("3DFACE")}
    assert layers == {"RoofSurface", "WallSurface", "GroundSurface"}
    assert all(line.closed and line.dxf.layer == "Outline" for line in space.query("LWPOLYLINE"))


def test_visible_edges_of_a_drawing_are_those_of_the_faces(outputs, run):
    """An edge between two triangles of one face is drawn by neither."""
    expected = sum(
        len(ring)
        for b in hiproof.open_run(run)
        if b.built
        for f in b.solid.faces
        for ring in f.rings
    )
    faces = open_sound_drawing(outputs("dxf")).modelspace().query("3DFACE")
    hidden = [face.get_edges_visibility() for face in faces]
    assert sum(a + b + d for a, b, _, d in hidden) == expected


def test_a_drawing_in_feet_is_as_large_in_feet(run, outputs, tmp_path):
    convert(run, tmp_path / "a.dxf", crs="EPSG:2263+5703") if outputs("dxf") else None
    document = open_sound_drawing(tmp_path / "a.dxf")
    assert document.header["$INSUNITS"] == 21
    (volume, area), (volume_m3, area_m2) = (
        measure_drawing(d.modelspace()) for d in (document, open_sound_drawing(outputs("dxf")))
    )
    foot_m = 1200 / 3937
    assert (volume * foot_m**3, area * foot_m**2) == pytest.approx((volume_m3, area_m2), rel=1e-5)


def read_global_ids(path):
    """Return the GlobalIds of an IFC file: those of buildings by name, and all."""
    model = reader("ifcopenshell").open(path)
    by_name = {building.Name: building.GlobalId for building in model.by_type("IfcBuilding")}
    return by_name, {item.GlobalId for item in model.by_type("IfcRoot")}


def write_town(folder, lines, **changes):
    """Write a parameters.jsonl of the records in `lines`, moved or in another CRS."""
    head, *buildings = lines
    folder.mkdir()
    for building in buildings:
        x, y, z = building.get("origin") or (0.0, 0.0, 0.0)
        building["origin"] = [x + changes.get("east", 0.0), y, z]
    head = {**head, **({"crs": changes["crs"]} if "crs" in changes else {})}
    text = "".join(json.dumps(line) + "\n" for line in [head, *buildings])
    (folder / "parameters.jsonl").write_text(text)
    return folder / "parameters.jsonl"


def read_lines(run):
    return [json.loads(line) for line in (run / "parameters.jsonl").read_text().splitlines()]


@pytest.mark.parametrize("gone", range(3))
def test_global_ids_stay_when_another_building_leaves(gone, run, outputs, tmp_path):
    ids, _ = read_global_ids(outputs("ifc"))
    lines = read_lines(run)
    name = [line["id"] for line in lines[1:] if line["id"] in ids][gone]
    rest = write_town(tmp_path / "a", [line for line in lines if line.get("id") != name])
    convert(rest, tmp_path / "a.ifc")
    found, _ = read_global_ids(tmp_path / "a.ifc")
    assert found == {id: ids[id] for id in ids if id != name}


def read_mesh_ids(path):
    """Return the identifiers of the meshes and the group of each building of a 3DM file."""
    ids, document = {}, reader("rhino3dm").File3dm.Read(str(path))
    for item in document.Objects:
        ids.setdefault(item.Attributes.Name, set()).add(str(item.Attributes.Id))
    for group in document.Groups:
        ids[group.Name].add(str(group.Id))
    return ids


def test_layers_keep_their_identifiers(run, outputs, tmp_path):
    convert(run, tmp_path / "a.3dm")
    read = reader("rhino3dm").File3dm.Read
    first, second = (read(str(path)) for path in (tmp_path / "a.3dm", outputs("3dm")))
    assert [layer.Id for layer in first.Layers] == [layer.Id for layer in second.Layers]


def test_meshes_keep_their_identifiers_when_another_building_leaves(run, outputs, tmp_path):
    ids, lines = read_mesh_ids(outputs("3dm")), read_lines(run)
    name = min(ids)
    rest = write_town(tmp_path / "a", [line for line in lines if line.get("id") != name])
    convert(rest, tmp_path / "a.3dm")
    assert read_mesh_ids(tmp_path / "a.3dm") == {id: ids[id] for id in ids if id != name}
    assert len(set().union(*ids.values())) == sum(map(len, ids.values()))
    far = write_town(tmp_path / "b", lines, east=25_000.0)
    convert(far, tmp_path / "b.3dm")
    assert not set().union(*ids.values()) & set().union(*read_mesh_ids(tmp_path / "b.3dm").values())


def test_drawings_of_a_town_have_one_fingerprint_and_those_of_another_have_not(
    run, outputs, tmp_path
):
    lines = read_lines(run)
    name = next(line["id"] for line in lines[1:] if line.get("parts"))
    rest = write_town(tmp_path / "a", [line for line in lines if line.get("id") != name])
    far = write_town(tmp_path / "b", lines, east=25_000.0)
    for source, file in ((rest, "a.dxf"), (far, "b.dxf")):
        convert(source, tmp_path / file)
    first, second, other = (
        open_sound_drawing(path).header["$FINGERPRINTGUID"]
        for path in (outputs("dxf"), tmp_path / "a.dxf", tmp_path / "b.dxf")
    )
    assert first == second != other


@pytest.mark.parametrize("number", range(3))
def test_global_ids_stay_when_a_building_crosses_a_kilometre_line(number, run, outputs, tmp_path):
    first = [line for line in read_lines(run)[1:] if line.get("parts")][number]
    x = hiproof.build(first).solid.vertices[:, 0]
    to_line = 1_000.0 - (x.min() + x.max()) / 2 % 1_000.0
    sides = []
    for name, beside in (("before", -0.5), ("behind", 0.5)):
        town = write_town(tmp_path / name, read_lines(run), east=to_line + beside)
        convert(town, tmp_path / f"{name}.ifc") if outputs("ifc") else None
        sides.append(read_global_ids(tmp_path / f"{name}.ifc")[0])
    assert sides[0] == sides[1]


@pytest.mark.parametrize("changes", [{"east": 25_000.0}, {"crs": "EPSG:25831"}])
def test_two_towns_share_no_global_id(changes, run, outputs, tmp_path):
    convert(write_town(tmp_path / "a", read_lines(run), **changes), tmp_path / "a.ifc")
    (names, all_ids), (others, other_ids) = (
        read_global_ids(path) for path in (outputs("ifc"), tmp_path / "a.ifc")
    )
    assert set(names) == set(others) and not all_ids & other_ids


def test_the_same_run_makes_the_same_ifc(run, outputs, tmp_path):
    convert(run, tmp_path / "again.ifc") if outputs("ifc") else None
    assert (tmp_path / "again.ifc").read_bytes() == outputs("ifc").read_bytes()


@pytest.mark.parametrize("source", ["cityjson", "cityjsonseq", "citygml2"])
@pytest.mark.parametrize("target", ["citygml3", "cityjson", "gpkg", "stl"])
def test_files_are_converted_as_runs_are(source, target, outputs, volumes, tmp_path):
    path = tmp_path / FORMATS[target].file
    convert(outputs(source), path)
    if target == "stl":
        assert (
            np.fromfile(path, "<u4", 1, offset=80) == (len(outputs("stl").read_bytes()) - 84) / 50
        )
    elif target == "gpkg":
        tables = {
            layer: pyogrio.read_info(path, layer=layer, force_feature_count=True)["features"]
            for layer in ("buildings", "roof_surfaces")
        }
        # in CityGML, buildings without a solid are not read
        assert tables == {"buildings": 3 if source == "citygml2" else 4, "roof_surfaces": 11}
    else:
        found = {id.removeprefix("bldg-"): s.volume for id, s in read_solids(path)}
        assert sorted(found.values()) == pytest.approx(sorted(volumes.values()), rel=1e-4)


def test_attributes_of_a_file_are_kept_as_they_stand(outputs, tmp_path):
    convert(outputs("cityjson"), tmp_path / "again.city.json")
    before, after = (
        json.loads(path.read_text())["CityObjects"]
        for path in (outputs("cityjson"), tmp_path / "again.city.json")
    )
    assert {id: o["attributes"] for id, o in after.items()} == {
        id: o["attributes"] for id, o in before.items()
    }


def test_a_file_that_holds_a_building_twice_is_told(run, outputs, tmp_path):
    lines = outputs("cityjsonseq").read_text().splitlines(keepends=True)
    (tmp_path / "joined.city.jsonl").write_text("".join([*lines, *lines[1:3]]))
    with pytest.warns(InputWarning, match="2 buildings with an id given before"):
        convert(tmp_path / "joined.city.jsonl", tmp_path / "joined.gml")


def test_a_building_that_cannot_be_built_is_left_out(run, tmp_path, caplog):
    text = (run / "parameters.jsonl").read_text()
    (tmp_path / "parameters.jsonl").write_text(text.replace('"type":"hip"', '"type":"igloo"'))
    assert convert(tmp_path / "parameters.jsonl", tmp_path / "a.city.json") == 2
    assert "hip and tower" in caplog.text
    assert set(json.loads((tmp_path / "a.city.json").read_text())["CityObjects"]) == {
        "gable",
        "yard",
        "lost",
    }
