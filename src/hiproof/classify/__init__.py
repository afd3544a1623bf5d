"""Ground and buildings of clouds that come without these classes, from nothing but where their points lie.

`ground` takes what stands on the ground away (a morphological filter), `surfaces` tells how smooth and how large the
surface is that a point lies on, `buildings` puts both together; `files` writes what was found into a copy of a file.
"""

from .buildings import BUILDING, GROUND, UNKNOWN, classify, roof_points

__all__ = ["BUILDING", "GROUND", "UNKNOWN", "classify", "roof_points"]
