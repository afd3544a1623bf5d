"""Buildings from their written parameters.

The parameters are the model: they are enough to build it again, by hand or by program.

file        parameters.jsonl read line by line, its head and its errors by line and column
schema      the JSON schema of that file
record      the JSON object of one building checked, and its parts made
building    the object built: composed, checked, measured, as a run does
run         a file of parameters into the files of a run
finished    finished models read building by building, of any file, and loaded into PostGIS
change      one part changed: another type, a height, a side
arrange     parts put otherwise: cut in two, joined, a dormer, a recess
edit        a building with another part, or without one
refit       heights and pitches of given parts fitted to points
override    what a person says of a building, obeyed by the fit
fallback    a block of the height in a footprint's attributes, where points are missing
"""

from .building import build
from .file import read_parameters

__all__ = ["build", "read_parameters"]
