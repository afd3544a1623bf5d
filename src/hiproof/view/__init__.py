"""Models in the browser: a run as 3D Tiles, and a page that shows them.

The page needs no network.

loading       a run into PostGIS
server        the page, for this machine alone
"""
