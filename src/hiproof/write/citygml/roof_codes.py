"""Roof types in CityGML's code lists.

Lists are SIG3D's and that of the German surveys (AdV).
"""

from __future__ import annotations

from collections.abc import Iterable

from ...primitives.catalogue import CATALOGUE

CODE_SPACES = {
    "sig3d": "http://www.sig3d.org/codelists/standard/building/2.0/_AbstractBuilding_roofType.xml",
    "adv": "https://repository.gdi-de.org/schemas/adv/citygml/Codelisten/RoofTypeTypeAdV.xml",
}
MIXED = {"sig3d": "1130", "adv": "5000"}
"""Roofs of several forms, and of a form that the list does not know."""


def roof_type_code(types: Iterable[str], code_list: str = "sig3d") -> str:
    """Return the code of roof parts of `types`.

    It is their own where all have the same, else that of a mixed roof.

    >>> roof_type_code(["gable", "asymmetric_gable"]), roof_type_code(["gable",
    ...     "hip"]), roof_type_code(["hip"], "adv")
    ('1030', '1130', '3200')
    """
    codes = {find_code(name, code_list) for name in types}
    return codes.pop() if len(codes) == 1 else MIXED[code_list]


def find_code(name: str, code_list: str) -> str:
    """Return the code of one roof type."""
    if name not in CATALOGUE:
        return MIXED[code_list]
    shape = CATALOGUE[name]
    return shape.citygml_code if code_list == "sig3d" else shape.adv_code
