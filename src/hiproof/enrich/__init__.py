"""Answers from finished models: party walls, areas, house types, storeys, the sun.

records     the buildings of a parameters.jsonl, read one by one in any order
walls       the upright faces of a solid, each a polygon in its own plane; areas of all faces
party       where the walls of two buildings touch, and of all of a run
cut         a solid whose walls are cut along their party walls
far         the horizon of buildings, of a terrain model, or of a file as PVGIS has it
weather     the irradiance of a typical year: EPW, TMY3, PVGIS, or a clear sky
sun         the sun and the sky of a year at a place, and on a face: irradiation by month
cadastre    the sun on every roof and wall of a building
energy      thermal zones and their boundaries in the Energy ADE
answer      all answers about one building
run         `hiproof enrich`: every building of a run, in parallel
"""
