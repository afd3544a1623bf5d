"""The files of a run written of given buildings, and built again of their parameters."""

import json
from contextlib import ExitStack
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from hiproof.compose import check_solid
from hiproof.formats import list_requested_files
from hiproof.parametric.run import build_file
from hiproof.read.models.solids import read_solids
from hiproof.settings import Settings
from hiproof.write import FileHead, fragments, join_fragments
from hiproof.write.fragments import describe
from hiproof.write.naming import gml_name
from hiproof.write.run_files import make_writer, measure_or_drop_solid

MODELS = (".gml", ".jsonl")
SCHEMAS = Path(__file__).parents[2] / "shared/schemas"
OF_CITYGML = {"buildings.gml": "citygml2", "buildings.citygml3.gml": "citygml3"}


@cache
def open_schema(name, file="CityGML.xsd"):
    """The schema of a version of CityGML, None where ../shared has none."""
    path = SCHEMAS / name / file
    parser = etree.XMLParser(no_network=True, huge_tree=True)
    return etree.XMLSchema(etree.parse(path, parser)) if path.exists() else None


def require_schema(*name):
    """The schema that `open_schema` gives; without one the test is skipped."""
    schema = open_schema(*name)
    return pytest.skip(f"needs {name[0]} in ../shared/schemas") if schema is None else schema


def require_json_schema(name):
    """The validator of a schema of CityJSON 2.0; without one the test is skipped."""
    path = SCHEMAS / "cityjson" / name
    if not path.exists():
        pytest.skip(f"needs {path}")
    return pytest.importorskip("jsonschema").Draft7Validator(json.loads(path.read_text()))


def write_run(folder, buildings, write, crs="EPSG:7415"):
    """Write the files that settings [write] ask for, and return their paths."""
    settings = Settings.from_dict({"write": write})
    head = FileHead(crs, offset=np.array([85000.0, 446000.0, 0.0]), write=settings.write)
    files = list_requested_files(settings, folder)
    texts = [fragments(b, (b.id, gml_name(b.id)), head)[1] for b in buildings]
    join_fragments(files, texts, head)
    return list(files.values())


def list_faults(folder, buildings, write):
    """List the shells of all files that are not valid, the CityGML that does not obey its schema
    where ../shared has it, and the files that `hiproof build` makes otherwise.
    """
    faults, paths = [], write_run(folder, buildings, write)
    for path in paths:
        if path.suffix in MODELS and path.name != "parameters.jsonl":
            solids = list(read_solids(path))
            faults += [(path.name, name, check_solid(s)) for name, s in solids if check_solid(s)]
            faults += ["solids missing"] * (len(solids) < len(buildings))
        if path.name in OF_CITYGML and (schema := open_schema(OF_CITYGML[path.name])):
            faults += [] if schema.validate(etree.parse(path)) else list(schema.error_log)
    build_file(folder / "parameters.jsonl", folder / "again")
    again = [p for p in paths if (folder / "again" / p.name).read_bytes() != p.read_bytes()]
    return faults + again


def write_all(folder, buildings, crs=None):
    """Write the four default files of a run; return the ids of buildings with a broken solid."""
    broken, head = [], FileHead(crs)
    with ExitStack() as stack:
        files = list_requested_files(Settings(), Path(folder))
        writers = [
            stack.enter_context(make_writer(name, path, head)) for name, path in files.items()
        ]
        for building in buildings:
            sheet = describe(*measure_or_drop_solid(building), head)
            broken += [] if sheet.building is building else [building.id]
            for writer in writers:
                writer.add(sheet)
    return broken
