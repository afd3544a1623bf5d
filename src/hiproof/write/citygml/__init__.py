"""CityGML.

version2      CityGML 2.0, streamed
version3      CityGML 3.0, translated from 2.0
surfaces      the geometry of one building
"""
