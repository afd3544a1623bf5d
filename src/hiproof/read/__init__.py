"""From files to values: point clouds, footprints, terrain, RoofN3D, and the split of a cloud into buildings.

`pointcloud.read_points` and `footprints.read_footprints` give what a run starts from; `assign` brings the two together,
`split` and `outline` stand in for footprints where there are none, `terrain` answers how high the ground is. Everything
unreadable raises `errors.InputError` with one sentence; what was put right on the way is said by `errors.InputWarning`.
"""
