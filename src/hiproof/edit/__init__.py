"""`hiproof edit`: a page on this machine for correcting buildings.

It lists the buildings of a run that need attention.

folder      the run's folder: buildings sorted by doubt, each read when it is asked for
points      the roof points of one building, read from the run's clouds as the run read them
actions     one edit: a building in, another out, by the functions of `parametric`
seen        what the page shows of a building: mesh, parts, numbers, heights of points over the roof
edits       the file of accepted edits, which is a file of overrides; two windows lose nothing
desk        what the page may ask, in one place
server      the same over HTTP: this machine alone, a token in the address, no path of the caller's
            choice

The page keeps the drafts and their history, so that the server has nothing to lose: only accepted
edits are state, and they are on disk before the page hears that they are accepted.
"""
