"""3D Tiles 1.1: a quadtree of binary glTF tiles on the globe.

Each tile is one draw call, with the buildings' attributes.

`globe` says where coordinates lie on the Earth, `quadtree` which building is drawn in which tile,
`meshes` how one looks, `properties` what is told of it, `content` makes a tile's file of these,
`tileset` the whole.
"""

from .globe import Globe
from .tileset import write_models

__all__ = ["Globe", "write_models"]
