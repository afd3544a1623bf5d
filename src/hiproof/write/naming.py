"""Names in files: ids valid, unique and the same in every run, CRSs, units and codes."""

from __future__ import annotations

import re
import uuid
from dataclasses import dataclass
from typing import Any

import numpy as np
from pyproj import CRS

from ..data_files import Values
from ..frames import METRES, Units
from ..model.installation import CHIMNEY, ROOF_OBJECT
from ..read.crs import (
    epsg_code,
    find_named_units,
    find_units,
    horizontal_crs,
    parse_crs,
    vertical_crs,
)

NAMESPACE = uuid.uuid5(uuid.NAMESPACE_DNS, "hiproof")
# Side (m) of the squares of the plan within which an id names one building, and a file one town: a
# building that is remodelled may cross a line between them, which few stand near.
TOWN_SQUARE_M = 10_000.0
NOT_IN_NAME = re.compile(r"[^A-Za-z0-9_.-]")


def gml_name(building_id: str) -> str:
    """Return `building_id` as a valid XML name.

    A character that such a name forbids is replaced by its code between underscores.

    >>> gml_name("NL.IMBAG.Pand.05031/a b")
    'NL.IMBAG.Pand.05031_2f_a_20_b'
    """
    return NOT_IN_NAME.sub(lambda match: f"_{ord(match[0]):x}_", str(building_id))


class UniqueNames:
    """Hands every name out once: the first comer keeps it, later ones get a number.

    >>> names = UniqueNames()
    >>> [names.take(name) for name in ("a", "b", "a", "a")]
    ['a', 'b', 'a..2', 'a..3']
    """

    def __init__(self) -> None:
        self.taken: set[str] = set()

    def take(self, name: str) -> str:
        unique, count = name, 1
        while unique in self.taken:
            count += 1
            unique = f"{name}..{count}"
        self.taken.add(unique)
        return unique


class PlacedNames(UniqueNames):
    """Names of buildings that hold in all files: of their ids and the places where they stand."""

    def __init__(self, crs: str | None) -> None:
        super().__init__()
        self.crs_name = "" if crs is None else crs_name(crs)

    def take_at(self, building_id: str, vertices: np.ndarray) -> str:
        """Hand out the name of a building with vertices (n, 3)."""
        middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        return self.take(f"{building_id} {self.name_square(middle)}")

    def name_square(self, place: np.ndarray) -> str:
        """Return the CRS and the square of the plan that a place (3,) lies in."""
        x, y = np.floor(place[:2] / TOWN_SQUARE_M).astype(int).tolist()
        return f"{self.crs_name} {x} {y}"


def crs_name(crs: str) -> str:
    """Return IFC's name of a CRS, "EPSG:28992" of the plan where it has a code."""
    code = epsg_code(CRS(crs)) or epsg_code(horizontal_crs(CRS(crs)))
    return CRS(crs).name if code is None else f"EPSG:{code}"


def make_uuid(kind: str, key: str) -> uuid.UUID:
    """Return the identifier of a thing, which programs keep: the same one in every file."""
    return uuid.uuid5(NAMESPACE, f"{kind} {key}")


def srs_name(crs: Any) -> str | None:
    """Return GML's `srsName` of a CRS.

    It is a URN with one EPSG code, or OGC's compound URN. None when `crs` is unknown or has no
    code. A URN promises the order of axes that EPSG gives, and coordinates here are east, north: a
    CRS that counts north first goes by its bare codes, which promise none and are read as east,
    north.

    >>> srs_name("EPSG:7415")
    'urn:ogc:def:crs,crs:EPSG::28992,crs:EPSG::5709'
    >>> srs_name("EPSG:26918"), srs_name("EPSG:2193+7839")
    ('urn:ogc:def:crs:EPSG::26918', 'EPSG:2193+7839')
    """
    crs = parse_crs(crs)
    if crs is None:
        return None
    plan, height = horizontal_crs(crs), vertical_crs(crs)
    combined = () if height is None else (epsg_code(plan), epsg_code(height))
    codes = combined if combined and None not in combined else (epsg_code(crs) or epsg_code(plan),)
    if None in codes:
        return None
    if plan.axis_info[0].direction == "north":
        return "EPSG:" + "+".join(map(str, codes))
    names = [f"crs:EPSG::{code}" for code in codes]
    return f"urn:ogc:def:{names[0]}" if len(names) == 1 else f"urn:ogc:def:crs,{','.join(names)}"


def reference_system(crs: Any) -> str | None:
    """Return CityJSON's `referenceSystem`: the code of the compound, else that of the plan.

    >>> reference_system("EPSG:28992+5709"), reference_system(None)
    ('https://www.opengis.net/def/crs/EPSG/0/7415', None)
    """
    crs = parse_crs(crs)
    code = None if crs is None else epsg_code(crs) or epsg_code(horizontal_crs(crs))
    return None if code is None else f"https://www.opengis.net/def/crs/EPSG/0/{code}"


def plan_wkt(crs: Any) -> str | None:
    """Return WKT of the plan of `crs` for layers without heights, None without one."""
    crs = parse_crs(crs)
    return None if crs is None else horizontal_crs(crs).to_wkt()


@dataclass(frozen=True)
class FileUnits:
    """Units of coordinates in the files of a run.

    Attributes and parameters are in metres in all of them. They are those of the CRS that a file
    names, so that a reader who knows only the file is right: where CityJSON can name the plan's CRS
    alone, and in tables, which always do, heights are in the plan's unit.
    """

    gml: Units = METRES
    cityjson: Units = METRES
    table: Units = METRES

    @classmethod
    def of(cls, crs: Any, world_units: Units | None = None, out_crs: str = "") -> FileUnits:
        """Return the units of files of a run in `crs`.

        They are written in `out_crs` where that is one. `world_units` are those of coordinates
        without a CRS, or without a name for it.

        >>> files = FileUnits.of("EPSG:2263+5703")
        >>> str(files.gml), str(files.cityjson), str(files.table)
        ('US survey foot, heights in metre', 'US survey foot', 'US survey foot')
        """
        from .reprojected import choose_file_crs, make_reprojection

        world_units = world_units or find_units(parse_crs(crs), "the models")
        there = parse_crs(choose_file_crs(crs, out_crs) if out_crs else crs)
        plan = world_units if there is None else find_units(horizontal_crs(there))
        other = find_units(there) if out_crs else world_units
        names = (
            find_named_units(name, other) for name in (srs_name(there), reference_system(there))
        )
        return cls(
            *(
                make_reprojection(crs, there, world_units, units) if out_crs else units
                for units in (*names, plan)
            )
        )

    def describe(self) -> Values:
        """Return the units for the record of a run."""
        metres = {"metres_in_plan_unit": self.gml.plan, "metres_in_height_unit": self.gml.height}
        return {"coordinates": str(self.gml), "attributes": "metre", **metres}


FUNCTIONS = {CHIMNEY: "1030", ROOF_OBJECT: "1070"}
# Codes of SIG3D: chimney, and others.
FUNCTION_SPACE = (
    "http://www.sig3d.org/codelists/standard/building/2.0/BuildingInstallation_function.xml"
)
