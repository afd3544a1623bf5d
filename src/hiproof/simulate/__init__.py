"""Roofs with known truth, and an airborne scanner over them.

Training, experiments, tests and the demo use them.

building = random_building(rng, "hip")          one primitive (roofs) ...
building = random_compound(rng, "L")            ... or several (compounds)
cloud = scan(building, rng, ScanSettings()) labelled points (scene -> flight -> raycast -> scanner)

town             houses along streets on hilly ground (relief), with what stands around them
survey           a town flown over: points, terrain and footprints in files
neighbourhood    the demo's town
city             a town of any size
"""

from .compounds import COMPOUND_KINDS, random_compound
from .neighbourhood import demo_files
from .roofs import NOT_ROOF, ROOF_TYPES, SimBuilding, random_building
from .scanner import Scan, ScanSettings, scan, scan_solids, uniform_points
from .scene import SOURCES, Defects

__all__ = [
    "COMPOUND_KINDS",
    "NOT_ROOF",
    "ROOF_TYPES",
    "SOURCES",
    "Defects",
    "Scan",
    "ScanSettings",
    "SimBuilding",
    "demo_files",
    "random_building",
    "random_compound",
    "scan",
    "scan_solids",
    "uniform_points",
]
