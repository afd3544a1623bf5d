"""Answers from finished models: party walls, areas, house types, storeys, the sun.

records     the buildings of a parameters.jsonl, read one by one in any order
walls       the upright faces of a solid, each a polygon in its own plane
party       where the walls of two buildings touch
cut         a solid whose walls are cut along their party walls
town        the buildings of a run with their walls and where these touch
areas       areas of outer walls, party walls, roofs and grounds
house_type  the type of a house by the houses that it touches, its size, and its use
storeys     storeys and floor areas, as intervals
ridge       the direction of a roof's ridge
horizon     the horizon that buildings make around places on roofs, compiled
sky         the sun and the sky of a year at a place, from pvlib
sun         the sun on a roof face: irradiation by month
shade       the roof edges around a building that may shade it
cadastre    the sun on every roof face of a building, and what panels would yield
answer      all answers about one building
write       a building's answers as texts for the files of a run
run         `hiproof enrich`: every building of a run, in parallel
"""
