"""Roofs with known truth, and an airborne scanner over them.

Training, experiments, tests and the demo use them.

building = random_building(rng, "hip")          one primitive (roofs) ...
building = random_compound(rng, "L")            ... or several (compounds)
cloud = scan(building, rng, ScanSettings()) labelled points (scene -> flight -> raycast -> scanner)
points, labels, type = training_sample(rng)     the same for a network (training)

town             houses along streets on hilly ground (relief), with what stands around them
survey           a town flown over: points, terrain and footprints in files
neighbourhood    the demo's town
city             a town of any size
"""

from .compounds import COMPOUND_KINDS, random_compound
from .neighbourhood import demo_files
from .roofs import NOT_ROOF, ROOF_TYPES, SimBuilding, random_building, read_truth
from .scanner import Scan, ScanSettings, scan, scan_solids, uniform_points
from .scene import SOURCES, Defects
from .training import training_sample

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
    "read_truth",
    "scan",
    "scan_solids",
    "training_sample",
    "uniform_points",
]
