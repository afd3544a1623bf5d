"""From a fitted roof to a valid solid: plan cells -> levels -> closed shell, and the check every solid passes.

`compose` lays out the outline, the pieces and the lines where the active plane changes as one planar arrangement
(`arrangement`, `cells`), finds the levels that meet over every plan vertex (`levels`), and raises roof, wall and
ground faces that share them (`shell`). `check_solid` then asks whether the result is valid by ISO 19107.
"""

from .check import Finding, check_solid
from .solid import compose, terrain_intersection, volume

__all__ = ["Finding", "check_solid", "compose", "terrain_intersection", "volume"]
