"""A format is one module and one line: whatever writes, converts or explains files learns of it
there.
"""

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from handmade import gable_house, make_building, make_lost_building
from hiproof import formats
from hiproof.formats import (
    FORMATS,
    Format,
    import_format,
    list_requested_files,
    list_requested_tile_files,
    requested_fragments,
)
from hiproof.settings import Settings
from hiproof.write.attribute_list import files_text
from hiproof.write.citygml.version3 import CityGML3Writer
from hiproof.write.fragments import Fragment
from hiproof.write.head import FileHead
from hiproof.write.run_files import fragments, join_fragments
from hiproof.write.writer import BuildingWriter
from written_run import write_all

README = Path(__file__).parents[1] / "README.md"


@pytest.mark.parametrize("name", FORMATS)
def test_a_format_has_what_its_kind_needs(name):
    format = FORMATS[name]
    module = import_format(format.module)
    assert callable(getattr(module, "writer", None) or module.write_models)
    if format.fragment:
        assert callable(import_format(format.fragment).writer.fragment) and module.writer
    else:
        assert not format.tile_ending


def test_files_have_names_of_their_own_and_the_readme_tells_those_of_every_run():
    assert len({format.file for format in FORMATS.values()}) == len(FORMATS)
    readme = README.read_text()
    assert [
        file.name
        for file in list_requested_files(Settings(), Path()).values()
        if f"`{file.name}`" not in readme
    ] == []


def test_models_by_work_tile_need_the_same_parts_of_buildings():
    by_tile = Settings.from_dict({"city": {"models": "tiles"}})
    assert set(list_requested_files(by_tile, Path())) == {"parameters", "gpkg"}
    assert requested_fragments(by_tile.write) == requested_fragments(Settings().write)


class Names(BuildingWriter):
    """A format for this test: a line a building."""

    @staticmethod
    def fragment(sheet):
        return Fragment(f"{sheet.building.id}\n".encode())

    def put(self, fragment):
        self.file.write(fragment.text)


def test_one_line_makes_a_new_format_known_everywhere(tmp_path, monkeypatch):
    module = ModuleType("hiproof.write.names")
    module.writer = Names
    monkeypatch.setitem(sys.modules, "hiproof.write.names", module)
    monkeypatch.setitem(
        formats.FORMATS, "names", Format("names.txt", "names alone", "names", "names")
    )
    buildings = [make_building(gable_house(), "a"), make_lost_building("b")]
    write_all(tmp_path / "one", buildings)
    head = FileHead(offset=np.array([85000.0, 446000.0, 0.0]))
    parts = [fragments(building, (building.id, building.id), head)[1] for building in buildings]
    join_fragments(list_requested_files(Settings(), tmp_path / "two"), parts, head)
    for folder in ("one", "two"):
        assert (tmp_path / folder / "names.txt").read_text() == "a\nb\n"
    for name in (
        format.file for format in FORMATS.values() if (tmp_path / "one" / format.file).exists()
    ):
        if name != "parameters.jsonl":  # its head tells an offset that is settled beforehand
            assert (tmp_path / "one" / name).read_bytes() == (
                tmp_path / "two" / name
            ).read_bytes(), name
    assert "| `names.txt` | names alone | `hiproof reconstruct` |" in files_text()


@pytest.mark.parametrize(
    ("version", "files"),
    [
        ("2.0", ["buildings.gml"]),
        ("3.0", ["buildings.citygml3.gml"]),
        ("both", ["buildings.gml", "buildings.citygml3.gml"]),
    ],
)
def test_citygml_is_written_in_the_versions_asked_for(tmp_path, version, files):
    settings = Settings.from_dict({"write": {"citygml": version}, "city": {"models": "both"}})
    request = list_requested_files(settings, tmp_path)
    assert [file.name for file in request.values() if file.suffix == ".gml"] == files
    by_tile = list_requested_tile_files(settings, tmp_path, "0_0_0").values()
    assert [file.name for file in by_tile if file.suffix == ".gml"] == [
        name.replace("buildings", "0_0_0") for name in files
    ]
    head = FileHead("EPSG:7415", offset=np.array([85000.0, 446000.0, 0.0]), write=settings.write)
    building = make_building(gable_house(), "a")
    join_fragments(request, [fragments(building, ("a", "a"), head)[1]], head)
    if version == "both":
        CityGML3Writer(tmp_path / "alone.gml", FileHead("EPSG:7415")).add_all([building])
        assert (tmp_path / "alone.gml").read_bytes() == request["citygml3"].read_bytes()
