"""Models in the browser: a run as 3D Tiles, and a page that shows them without a network.

run_models    the models of a run with all that is told of them
loading       the same into PostGIS
server        the page, for this machine alone
"""
