"""Tables of buildings, parts and roof surfaces.

rows             the rows of one building
vector_layer     a layer of a vector file, by GDAL
geopackage       the GeoPackage of a run
styles           how QGIS draws its layers
geoparquet       GeoParquet, made of the same columns
flatgeobuf       FlatGeobuf of the outlines
postgis          a PostGIS database
"""
