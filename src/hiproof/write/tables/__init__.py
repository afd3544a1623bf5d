"""Tables of buildings, parts and roof surfaces.

rows             the rows of one building
geopackage_file  a GeoPackage in SQLite
geopackage       the GeoPackage of a run
styles           how QGIS draws its layers
geoparquet       GeoParquet, made of the same columns
postgis          a PostGIS database
"""
