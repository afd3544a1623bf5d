"""Building footprints from vector files, GeoParquet, PostGIS and Overture Maps."""
