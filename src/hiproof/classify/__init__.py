"""Ground and buildings of clouds without these classes.

Nothing is used but where the points lie.

cells       points counted by square cells, and their density
ground      what stands on the ground is taken away (a morphological filter)
surfaces    how smooth and how large the surface is that a point lies on
buildings   ground and buildings, of both; the roofs of a whole cloud
cut_out     roofs cut out beforehand, told from a scene with its ground
houses      touching houses told apart
split       a cloud without footprints into buildings
files       what was found, written into a copy of a file
"""

from .buildings import BUILDING, GROUND_CLASS, UNKNOWN, classify, roof_points

__all__ = ["BUILDING", "GROUND_CLASS", "UNKNOWN", "classify", "roof_points"]
