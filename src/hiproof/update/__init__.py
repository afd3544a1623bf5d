"""A finished run brought up to date with a new survey.

Each building is tested against the new points; what did not change stays.

request    what the user asked for
earlier    the earlier run: its parameters, settings and clouds
dates      when the new points were surveyed, and surveys as the user names them
members    the buildings of an update: earlier ones, and those of new footprints
plan       the plan of the update, from the earlier buildings
register   the common shift between the two surveys
cells      heights of points over the earlier roof, and both surveys compared in cells of a metre
clusters   connected cells that contradict the earlier roof, and how likely chance makes them
ground     the ground under an earlier roof
judge      the class of a building: unchanged, changed, gone, ...
kinds      what changed: a part raised, a dormer built, ...
before     the earlier points sorted and the surveys registered, before there are work tiles
unseen     parts of the earlier roof without new points
lineage    parts of the new roof that continue parts of the earlier one
moved      the earlier model with parts moved up or down, or without those pulled down
places     places that changed as parameters.jsonl holds them, roofs in one frame
outside    roofs outside all outlines
texts      texts of unchanged buildings, taken from the earlier run
epochs     the surveys, and the points of both in a work tile
refine     parameters of unchanged buildings, estimated by the points of both surveys
solve      a work tile brought up to date
several    a run of several surveys: these registered, and its tiles solved
best       the best survey of each building, and the model made of it
run        the steps above, one after the other
change_tables  changes.csv and changes.gpkg: what the update found
before_after   the report on buildings that changed, before and after

Earlier and new points are compared with each other wherever the earlier clouds still exist: what
the earlier model left out, such as a chimney, then is no change. Otherwise the new points are
compared with the model alone.
"""
