"""Buildings out: CityGML, CityJSON, parameters and tables, each file whole or not at all.

What is written: attribute_list (every attribute, once), building_attributes (those of one building), roof_figures and
roof_levels (measured on its solid), roof_codes and osm_tags (its type in other words), shapes (blocks, parts, LoD0),
shown (where its parts show), table_rows (its rows), values (numbers and text as every format holds them), naming (ids), reprojected (another CRS), colours.

Formats: citygml (citygml_geometry, xml_text), citygml3 (made of 2.0), cityjson (cityjson_geometry), parameters (json_text), attributes (the
GeoPackage, with styles), geoparquet, gltf (in the container glb), obj, triangles and viewed for these, tiles, postgis, page_mesh (for pages).

Files: writer (the life of one: opened, added to, finished), files (whole or none), head (what all of a run have in common),
fragments (a building's texts, to be joined), run_files (all files of a run in one pass).
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
