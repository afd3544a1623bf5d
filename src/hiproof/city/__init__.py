"""Many buildings: from an area to the files of its models.

An area becomes tasks, tasks become part files, and part files become the output.

request       what the user asked for
checks        what is wrong with that before any file is read
run           the steps below, one after the other
lock          one run a folder at a time
marks         by what a folder knows whose run it holds
resume        a folder held against the request: gone on from, or begun anew
passages      passages below buildings, of a layer or a column
overrides     what is known better of some buildings, and which of them have to be made again
table_values  values of columns as overrides want them
changed       a run whose footprints changed: what is the same stays
overlap       whether footprints lie where the cloud does
prepare       the plan made: which buildings there are, from footprints or the cloud
from_overture footprints of an Overture Maps release, kept as a file before they are read
frame         the CRS and units of an area
classes       which classes of points may be roofs
registration  the common shift of all footprints, before there are tiles
outlines      those of all buildings around, and the rows that touching ones form
from_cloud    buildings of a cloud without footprints
plan          which buildings there are, which work tile owns each, which point files there are
sort          each point file, read once in chunks, leaves the points each work tile needs
noted         where the points of each file lie, for whoever wants some of them again
bundle_folders  the folders of bundles: their names, and which of them stay
bundles       the input of buildings that hiproof failed on, kept to be sent and run again
repro         such a building solved again
solve         each work tile reconstructs its own buildings and writes them as text, ready to join
solved        buildings counted as they are solved, for the progress of a run
ground        the ground around a building, from its tile's cells
surveys       the points of several surveys, and those of which a model is made
terrain_check a terrain model against the ground points
found         the roof of one building among points without classes
other_classes what the points of other classes say of a building
merge         the tiles' parts are joined in plan order into the files of the output folder
outputs       digests of what was written
ledger        which tasks are done, what came of each building: SQLite
cores         how many processes pay on this machine
executors     where tasks run: this process, processes, a Dask cluster
processes     the second of these
workers       how worker processes begin and end
tasks         the tasks by name, for processes that have imported nothing yet
quarantine    a task that kills its process, found by trying it alone
warm          what tasks call, compiled before they start
warm_pieces   that, in pieces which processes compile side by side

A building is owned by one tile and sees all points in and around its footprint from all files, in
an order of its own: its answer does not depend on how the area was cut. Tasks are idempotent and
write whole files or none, so a run that was killed goes on where it stopped.
"""
