"""The steps of `reconstruct`, in their order.

Every step takes values and returns values, and a failure becomes a status.

arguments   what is refused before the first step
outline     outlines of one valid polygon, without needless vertices
points      the points that can be used, in one order
footprint   the building to start from, and its footprint moved onto its points
ground      bare ground inside the footprint; the lower end of the walls
recognise   the network's opinion
fit         roof parts fitted to the points
solid       the solid of a roof, with terrain, passages, installations and overhangs
judge       quality, verdict and doubts
remarks     remarks in a building's detail
"""
