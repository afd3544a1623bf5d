"""What installations are in CityGML and CityJSON."""

from __future__ import annotations

from ..model.installation import CHIMNEY, ROOF_OBJECT

FUNCTIONS = {CHIMNEY: "1030", ROOF_OBJECT: "1070"}
FUNCTION_SPACE = (
    "http://www.sig3d.org/codelists/standard/building/2.0/BuildingInstallation_function.xml"
)
"""Codes of SIG3D: chimney, and others."""
