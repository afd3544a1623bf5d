"""3D Tiles 1.1: a quadtree of binary glTF tiles on the globe.

Each tile is one draw call, with the buildings' attributes.

`globe` says where coordinates lie on the Earth, `content` what is told of a building, how it looks
and a tile's file, `tileset` the whole, and which building is drawn in which tile.
"""

from .globe import Globe
from .tileset import write_models

__all__ = ["Globe", "write_models"]
