"""Write buildings to files, each whole or not at all.

Formats: citygml, cityjson, tables, meshes, and parameters (the parametric models).

Contents that formats share:

attribute_list         every attribute and table, declared once
building_attributes    the attributes of one building
surfaces               faces that are one surface, such as the facets of a cone
shapes                 LoD0, blocks and building parts, as far as requested
colours                one colour a roof type
values                 numbers and text as every format holds them, in XML and JSON, too
naming                 ids, names of reference systems, units, codes of objects on roofs
reprojected            coordinates in another reference system than the run's

Files:

writer       a file is opened, given one building after another, finished
files        files that appear whole or not at all, and stand for no input or run's own file
head         what all files of a run have in common
fragments    one building's texts, kept until they are joined
run_files    all files of a run in one pass, a file of any format
"""

from ..model.roof_figures import RoofFigures, roof_figures
from .building_attributes import building_attributes
from .citygml.version2 import CityGMLWriter, write_citygml
from .cityjson.features import CityJSONWriter, write_cityjson
from .files import atomic, atomic_file
from .fragments import Fragments, load_fragments, save_fragments
from .head import FileHead
from .parameters import ParametersWriter, write_parameters
from .run_files import fragments, join_fragments
from .tables.geopackage import AttributesWriter, write_attributes
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
    "write_attributes",
    "write_citygml",
    "write_cityjson",
    "write_parameters",
]
