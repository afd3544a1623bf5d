"""Many buildings: from an area to the files of its models.

An area becomes tasks, tasks become part files, and part files become the output.

request       what the user asked for
run           the steps below, one after the other
plan          which buildings there are, and which work tile owns each
folder        what a run's folder knows: whose run it is, and what is done
work          tasks: points sorted into tiles, tiles solved, in one or many processes
merge         the tiles' parts joined into the files of the output folder

A building is owned by one tile and sees all points in and around its footprint from all files, in
an order of its own: its answer does not depend on how the area was cut. Tasks are idempotent and
write whole files or none, so a run that was killed goes on where it stopped.
"""
