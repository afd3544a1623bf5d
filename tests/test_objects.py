"""Buildings as objects of Python: one line each, meshes, data frames, runs read lazily."""

import sys
from contextlib import ExitStack
from types import ModuleType

import numpy as np
import pytest

import hiproof
from hiproof import progress
from hiproof.cli.convert import convert
from hiproof.cli.report import report
from hiproof.cli.view import open_tiles
from hiproof.enrich.run import enrich_run
from hiproof.errors import InputError, NoModelError
from hiproof.evaluate.models import run_models
from hiproof.evaluate.run import evaluate_run
from hiproof.formats import FORMATS
from hiproof.status import Grade, Status
from parametric_house import gable_house

LOST = hiproof.Building("lost", Status.NO_POINTS)


def test_a_building_is_shown_in_one_line(run_of_each_kind):
    assert [repr(building) for building in hiproof.open_run(run_of_each_kind)] == [
        "<Building 'gable': modelled, gable, 1 part>",
        "<Building 'hip and tower': modelled, hip, 2 parts>",
        "<Building 'yard': modelled, flat, 1 part>",
        "<Building 'lost': no_points>",
    ]
    assert repr(hiproof.Building("a\nb", Status.NO_ROOF, grade=Grade.POOR)) == (
        r"<Building 'a\nb': no_roof, quality poor>"
    )


def test_a_mesh_of_trimesh_is_closed_and_coloured_by_roof_type(run_of_each_kind):
    pytest.importorskip("trimesh", reason="no trimesh here: pip install 'hiproof[trimesh]'")
    for building in hiproof.open_run(run_of_each_kind):
        if building.built is None:
            continue
        mesh = building.to_trimesh()
        assert mesh.is_watertight and mesh.volume == pytest.approx(building.volume)
        assert mesh.metadata == {"id": building.id, "type": building.type}
        colours = {tuple(colour) for colour in mesh.visual.face_colors.tolist()}
        types = {part.type for part in building.parts}
        assert len(colours) == len(types) + 2  # walls and ground
    with pytest.raises(NoModelError):
        LOST.to_trimesh()


def test_a_mesh_of_pyvista_says_what_its_cells_are():
    pytest.importorskip("pyvista", reason="no pyvista here: pip install 'hiproof[pyvista]'")
    house = gable_house()
    mesh = house.to_pyvista()
    assert mesh.volume == pytest.approx(house.volume) and mesh.n_open_edges == 0
    kinds, counts = np.unique(mesh.cell_data["kind"], return_counts=True)
    assert dict(zip(kinds.tolist(), counts.tolist(), strict=True)) == {
        "GroundSurface": 2,
        "RoofSurface": 4,
        "WallSurface": 10,
    }
    assert set(mesh.cell_data["part"][mesh.cell_data["kind"] == "RoofSurface"].tolist()) == {0}


def test_a_data_frame_has_the_rows_of_the_geopackage(run_of_each_kind):
    geopandas = pytest.importorskip("geopandas", reason="needs the extra `geopandas`")
    frame = hiproof.to_geodataframe(hiproof.open_run(run_of_each_kind))
    table = geopandas.read_file(run_of_each_kind / FORMATS["gpkg"].file, layer="buildings")
    assert list(frame.columns.drop("geometry")) == list(table.columns.drop("geometry"))
    assert frame.crs == table.crs == "EPSG:28992"
    assert frame["id"].tolist() == table["id"].tolist()
    assert frame["rf_volume_lod22"][:3].tolist() == table["rf_volume_lod22"][:3].tolist()
    assert frame.geometry[:3].geom_equals_exact(table.geometry[:3].explode(), 1e-9).all()
    assert frame.geometry[3] is None and table.geometry[3] is None


def test_a_data_frame_is_made_of_buildings_too():
    pytest.importorskip("geopandas", reason="needs the extra `geopandas`")
    house = gable_house()
    for models in (house, [house], iter([house, LOST])):
        frame = hiproof.to_geodataframe(models, crs="EPSG:7415")
        assert frame["id"][0] == house.id and frame.geometry.area[0] == pytest.approx(96.0)
        assert frame.crs == "EPSG:28992"


def test_a_run_is_read_while_it_is_iterated(run_of_each_kind, tmp_path):
    lines = (run_of_each_kind / "parameters.jsonl").read_text().splitlines(keepends=True)
    path = tmp_path / "parameters.jsonl"
    path.write_text("".join(lines[:2]) + "no JSON\n")
    run = hiproof.open_run(path)
    assert run.crs.to_epsg() == 7415 and run.record == {}
    buildings = iter(run)
    assert next(buildings).id == "gable"
    with pytest.raises(InputError, match="line 3"):
        next(buildings)


def test_a_run_without_parameters_has_solids(run_of_each_kind, tmp_path):
    name = FORMATS["cityjsonseq"].file
    (tmp_path / name).write_bytes((run_of_each_kind / name).read_bytes())
    before, after = (list(hiproof.open_run(folder)) for folder in (run_of_each_kind, tmp_path))
    assert [b.id for b in after] == [b.id for b in before]
    for one, other in zip(before[:3], after[:3], strict=True):
        assert other.volume == pytest.approx(one.volume, abs=1e-3) and other.type == one.type
        areas = [[area.area for area in b.compute_visible_areas()] for b in (one, other)]
        assert areas[1] == pytest.approx(areas[0], abs=0.01)
    assert after[3].status is Status.NO_POINTS
    assert hiproof.open_run(run_of_each_kind).record["buildings"] == 4


@pytest.mark.parametrize(
    "read", [hiproof.open_run, evaluate_run, report, run_models, convert, enrich_run, open_tiles]
)
def test_a_folder_of_no_run_is_refused(read, tmp_path):
    with pytest.raises(InputError, match="`hiproof reconstruct`"), ExitStack() as opened:
        result = read(tmp_path)
        opened.enter_context(result)  # of what reads when it is entered


def test_a_notebook_shows_bars(monkeypatch):
    """As IPython and ipywidgets would be there; rich draws what they display."""
    drawn = []

    class Output:
        def __init__(self):
            self.outputs = ()

        def append_display_data(self, data):
            drawn.append(data)

        def clear_output(self, wait=False):
            pass

        def close(self):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *_):
            return None

    for name, members in (
        ("IPython", {}),
        ("IPython.display", {"display": drawn.append}),
        ("ipywidgets", {"Output": Output}),
    ):
        module = ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(progress, "find_spec", lambda name: object())
    monkeypatch.setattr("rich.console._is_jupyter", lambda: True)
    with progress.show_in_notebook("plan") as update:
        update("solve", 3, 12)
    assert any(isinstance(thing, Output) for thing in drawn)


def test_a_script_shows_no_bars(capsys):
    with progress.show_in_notebook("plan") as update:
        update("solve", 3, 12)
    assert capsys.readouterr() == ("", "")
