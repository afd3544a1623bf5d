"""Roof shapes.

algebra     formulas of planes in the half extents and the numbers of a shape
contract    a roof shape, and all that follows from its planes and parameters
table       shapes made of the rows of data/shapes.toml
facets      polygons for circles, chords for profiles
revolved    profiles turned around an axis: domes, barrel vaults, onions
shed        saw-teeth
cone        cones, spires and half cones
catalogue   all shapes by name
ribs        facets along the sides of an outline
cants       further planes over walls that cut corners off
family      shapes of at most one plane a side and a level top
parameters  whether given parameters make a shape
"""

from .catalogue import CATALOGUE, get
from .contract import Primitive

__all__ = ["CATALOGUE", "Primitive", "get"]
