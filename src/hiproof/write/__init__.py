"""Buildings out: CityGML, CityJSON, parameters and an attribute table, each file whole or not at all.

Every format is a function over an iterable of buildings and an incremental writer with `add`; both hold one building in
memory at a time. `write_all` writes the four files of a run in one pass.
"""

from .attributes import AttributesWriter, write_attributes
from .building_attributes import building_attributes
from .citygml import CityGMLWriter, write_citygml
from .cityjson import CityJSONWriter, write_cityjson
from .files import atomic, atomic_file
from .fragments import Fragments, load_fragments, save_fragments
from .parameters import FileHead, ParametersWriter, write_parameters
from .roof_figures import RoofFigures, roof_figures
from .run_files import fragments, join_fragments, write_all
from .writer import BuildingWriter

__all__ = [
    "AttributesWriter",
    "BuildingWriter",
    "CityGMLWriter",
    "CityJSONWriter",
    "FileHead",
    "Fragments",
    "ParametersWriter",
    "RoofFigures",
    "atomic",
    "atomic_file",
    "building_attributes",
    "fragments",
    "join_fragments",
    "load_fragments",
    "roof_figures",
    "save_fragments",
    "write_all",
    "write_attributes",
    "write_citygml",
    "write_cityjson",
    "write_parameters",
]
