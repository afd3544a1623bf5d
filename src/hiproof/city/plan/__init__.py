"""The plan of a run: which buildings there are, and which work tile owns each.

checks        what is wrong with a request before any file is read
prepare       the plan made, from footprints or the cloud
work_plan     the plan itself: buildings, work tiles, what the files have in common
frame         the CRS and units of an area
overlap       whether footprints lie where the cloud does
classes       which classes of points may be roofs
from_overture footprints of an Overture Maps release, kept as a file before they are read
from_cloud    buildings of a cloud without footprints
registration  the common shift of all footprints, before there are tiles
outlines      those of all buildings around, and the rows that touching ones form
passages      passages below buildings, of a layer or a column
overrides     what is known better of some buildings
"""
