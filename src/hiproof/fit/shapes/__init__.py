"""Fit larger and curved shapes in place of a roof's parts, and tidy the parts up.

regions     what parts touch and cover
shown       hidden parts removed
composite   gambrels combined from their parts
teeth       rows of equal monopitches as saw-teeth
custom      custom shapes instead of neighbouring parts
judged      roofs judged by points, with one shape in place of several parts
round_ends  cones, spires, domes, onions and half cones over round stretches of the outline
spires      how near points lie to spires
round_tops  cones, spires, domes and onions around the tops of parts
onions      onions around round parts, which may be their tops
drums       level discs over arcs of the outline and around level parts
barrels     barrel vaults over parts with slopes to two sides
bases       one level part under and around a curved shape
curved      these shapes where points follow them better
clamp       heights limited to the range of the points
"""
