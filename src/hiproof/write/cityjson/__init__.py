"""CityJSON 2.0.

features      a sequence of features (CityJSONSeq), or one document
boundaries    the geometry of one building
"""
