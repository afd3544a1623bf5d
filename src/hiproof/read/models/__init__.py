"""Models of CityJSON and CityGML files, as they stand."""
