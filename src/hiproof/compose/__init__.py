"""From a fitted roof to a valid solid.

Plan cells become levels, levels a closed shell, and every solid is checked.

settle            the roof made of exactly the numbers that are written of it
readable          whether a file of parameters can hold a roof
solid             `compose`: the steps below, one after the other; terrain intersection
cells             outline, pieces and the lines where the active plane changes as one plan of cells
arrangement       the planar arrangement under them, on an integer grid
levels            which heights meet over every vertex of the plan
lids              walls that close a solid between its other faces
shell             roof faces over the cells, and the solid under them
check             whether the result is valid by ISO 19107
check_faces       its rules for each face by itself
simpler           parts given up one by one, where a roof cannot become a valid solid
blocks            LoD1: prisms over the outline; installations on roofs
underside         walls down to the terrain, and passages below a solid
overhang          slabs of a roof beyond walls
eaves             a model with overhangs, as many as make a valid solid
building_parts    a solid cut where its roofs meet, for formats that know building parts
"""

from .check import Finding, check_solid
from .simpler import compose_simpler
from .solid import compose, terrain_intersection

__all__ = ["Finding", "check_solid", "compose", "compose_simpler", "terrain_intersection"]
