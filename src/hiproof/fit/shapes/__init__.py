"""Fit composite and curved shapes in place of a roof's parts, and tidy the parts up.

regions    what parts touch and cover
shown      hidden parts removed
teeth      rows of equal monopitches as saw-teeth
accept     the price of a roof of parts, and the one place that judges shapes
composite  gambrels and shapes of your own over several parts
arcs       arcs of the outline
rounds     cones, spires, domes, onions and half cones over arcs and around the tops of parts
drums      level discs over arcs and around level parts
barrels    barrel vaults over parts with slopes to two sides
curved     these shapes in turn, where they are cheaper
"""
