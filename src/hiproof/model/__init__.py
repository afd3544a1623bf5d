"""The frozen values handed from stage to stage.

Arrays are float64; plan geometry is shapely; frames are in the names.

inputs      point clouds and footprints
roof        pieces, parts, roofs: a roof is a max of mins of planes
solid       faces, solids
installation  objects on a roof
overhang    how far a roof reaches beyond its walls
building    models and buildings; how a solid ends below: terrain, passages
shown       where each part of a roof shows from above
heights     heights of roofs at many points
roof_figures  heights, slopes, ridge and volume of a solid
"""

from .building import ONE_LEVEL, Building, Model, Passage, Quality, Underside
from .inputs import Footprint, PointCloud, as_xyz
from .installation import Installation
from .overhang import Eaves, Overhang
from .roof import Fit, Part, Piece, Roof
from .solid import CEILING, GROUND, ROOF, WALL, Face, Solid

__all__ = [
    "CEILING",
    "GROUND",
    "ONE_LEVEL",
    "ROOF",
    "WALL",
    "Building",
    "Eaves",
    "Face",
    "Fit",
    "Footprint",
    "Installation",
    "Model",
    "Overhang",
    "Part",
    "Passage",
    "Piece",
    "PointCloud",
    "Quality",
    "Roof",
    "Solid",
    "Underside",
    "as_xyz",
]
