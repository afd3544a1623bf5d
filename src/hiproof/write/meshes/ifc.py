"""IFC4X3: one IfcBuilding a model (needs ifcopenshell).

It has a property set, and contains an IfcRoof for each part, an IfcWall and an IfcSlab. These are
surfaces, which together close its solid.

Coordinates are metres about an origin that IfcMapConversion places in the CRS. Names of properties
are those of all other formats.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from ...extras import import_extra
from ...frames import Units
from ...model import CEILING, GROUND, ROOF, WALL, Face
from ..colours import list_legend, srgb
from ..naming import PlacedNames, crs_name, make_uuid
from .viewed import Look, ViewedModel, choose_look

IFC_SCHEMA = "IFC4X3"
PROPERTY_SET = "hiproof"
FIXED_TIME = "2000-01-01T00:00:00"  # in place of the clock's, for files that do not depend on it
PRECISION_M = 1e-4  # of coordinates, as all formats have them

# The element of a building that faces other than roofs belong to, and its predefined type.
ELEMENTS = {
    WALL: ("IfcWall", "NOTDEFINED"),
    GROUND: ("IfcSlab", "BASESLAB"),
    CEILING: ("IfcSlab", "NOTDEFINED"),
}

# Predefined types of IfcRoof by entry of the legend; the others are user-defined.
IFC_ROOF_TYPES = {
    "flat": "FLAT_ROOF",
    "monopitch": "SHED_ROOF",
    "gable": "GABLE_ROOF",
    "hip": "HIP_ROOF",
    "half hip": "HIPPED_GABLE_ROOF",
    "mansard": "MANSARD_ROOF",
    "pyramid": "PAVILION_ROOF",
}

IFC_VALUES = {str: "IfcText", float: "IfcReal", int: "IfcInteger", bool: "IfcBoolean"}


def write_models(path: Path, buildings: Iterable[ViewedModel], crs: str | None = None) -> int:
    """Write `buildings` to `path`; returns how many.

    The file is made in memory. Raises InputError where ifcopenshell is missing, OutputError when
    the file cannot be written.
    """
    from ..files import atomic_file

    model = IfcModel(import_extra("ifcopenshell", "ifc", "IFC"), crs)
    for building in buildings:
        model.add(building)
    model.finish()
    with atomic_file(path) as file:
        file.write(model.file.to_string().encode())
    return len(model.buildings)


class IfcModel:
    """A growing IFC file: a project with a site, and its buildings."""

    def __init__(self, ifcopenshell: Any, crs: str | None) -> None:
        self.guid, self.crs = ifcopenshell.guid, crs
        self.keys = PlacedNames(crs)
        self.file = ifcopenshell.file(schema=IFC_SCHEMA)
        self.file.header.file_name.time_stamp = FIXED_TIME
        self.file.header.file_name.originating_system = "hiproof"
        self.buildings: list[Any] = []
        self.styles: dict[Look, Any] = {}
        self.origin = np.zeros(3)
        axes = self.make("IfcAxis2Placement3D", Location=self.point(np.zeros(3)))
        self.context = self.make(
            "IfcGeometricRepresentationContext",
            ContextType="Model",
            CoordinateSpaceDimension=3,
            Precision=PRECISION_M,
            WorldCoordinateSystem=axes,
        )
        self.body = self.make(
            "IfcGeometricRepresentationSubContext",
            ContextIdentifier="Body",
            ContextType="Model",
            ParentContext=self.context,
            TargetView="MODEL_VIEW",
        )
        self.placement = self.make("IfcLocalPlacement", RelativePlacement=axes)

    def make(self, kind: str, *ordered: Any, **values: Any) -> Any:
        return self.file.create_entity(kind, *ordered, **values)

    def make_rooted(self, kind: str, key: str, **values: Any) -> Any:
        """Make an entity whose GlobalId follows from its kind and `key`."""
        name = self.guid.compress(make_uuid(kind, key).hex)
        return self.make(kind, GlobalId=name, **values)

    def point(self, place: np.ndarray) -> Any:
        return self.make("IfcCartesianPoint", Coordinates=np.round(place, 4).tolist())

    def add(self, model: ViewedModel) -> None:
        """Add a building with its body and its properties."""
        if not self.buildings:
            self.origin = model.corner
        key = self.keys.take_at(model.id, model.solid.vertices)
        building = self.make_rooted(
            "IfcBuilding",
            key,
            Name=model.id,
            ObjectType=model.roof_type,
            ObjectPlacement=self.place(),
            CompositionType="ELEMENT",
        )
        self.buildings.append(building)
        self.add_properties(building, key, model)
        self.make_rooted(
            "IfcRelContainedInSpatialStructure",
            key,
            RelatedElements=self.make_elements(key, model),
            RelatingStructure=building,
        )

    def place(self) -> Any:
        return self.make(
            "IfcLocalPlacement",
            PlacementRelTo=self.placement,
            RelativePlacement=self.placement.RelativePlacement,
        )

    def make_elements(self, key: str, model: ViewedModel) -> list[Any]:
        """Make the roof of each part, the walls and the slabs of a building."""
        points = [self.point(place) for place in model.solid.vertices - self.origin]
        elements = []
        for (kind, part), faces in model.faces_by_element().items():
            roof_type = model.part_types.get(part, model.roof_type)
            predefined = IFC_ROOF_TYPES.get(list_legend(roof_type), "USERDEFINED")
            entity, predefined = ELEMENTS.get(kind) or ("IfcRoof", predefined)
            elements.append(
                self.make_rooted(
                    entity,
                    f"{key} {kind} {part}",
                    Name=f"{kind} {part}" if kind == ROOF else kind,
                    ObjectType=roof_type if kind == ROOF else None,
                    ObjectPlacement=self.place(),
                    Representation=self.make_surfaces(
                        [self.make_face(face, points) for face in faces],
                        choose_look(faces[0], model.part_types),
                    ),
                    PredefinedType=predefined,
                )
            )
        return elements

    def make_surfaces(self, faces: list[Any], look: Look) -> Any:
        """Make the shape of an element."""
        surfaces = self.make("IfcConnectedFaceSet", CfsFaces=faces)
        item = self.make("IfcFaceBasedSurfaceModel", FbsmFaces=[surfaces])
        self.make("IfcStyledItem", Item=item, Styles=[self.style(look)])
        shape = self.make(
            "IfcShapeRepresentation",
            ContextOfItems=self.body,
            RepresentationIdentifier="Body",
            RepresentationType="SurfaceModel",
            Items=[item],
        )
        return self.make("IfcProductDefinitionShape", Representations=[shape])

    def make_face(self, face: Face, points: list[Any]) -> Any:
        bounds = [
            self.make(
                "IfcFaceBound" if number else "IfcFaceOuterBound",
                Bound=self.make("IfcPolyLoop", Polygon=[points[vertex] for vertex in ring]),
                Orientation=True,
            )
            for number, ring in enumerate(face.rings)
        ]
        return self.make("IfcFace", Bounds=bounds)

    def style(self, look: Look) -> Any:
        """Return the surface style of a look, made once."""
        if look not in self.styles:
            red, green, blue = srgb(look.colour)
            colour = self.make("IfcColourRgb", Red=red, Green=green, Blue=blue)
            shading = self.make("IfcSurfaceStyleShading", SurfaceColour=colour)
            self.styles[look] = self.make(
                "IfcSurfaceStyle", Name=look.name, Side="BOTH", Styles=[shading]
            )
        return self.styles[look]

    def add_properties(self, building: Any, key: str, model: ViewedModel) -> None:
        """Add the attributes of a building, those that are known."""
        properties = [
            self.make("IfcPropertySingleValue", Name=name, NominalValue=self.make_value(value))
            for name, value in model.values.items()
            if value is not None
        ]
        related = self.make_rooted(
            "IfcPropertySet", key, Name=PROPERTY_SET, HasProperties=properties
        )
        self.make_rooted(
            "IfcRelDefinesByProperties",
            key,
            RelatedObjects=[building],
            RelatingPropertyDefinition=related,
        )

    def make_value(self, value: Any) -> Any:
        kind = IFC_VALUES.get(type(value), "IfcText")
        return self.make(kind, value if type(value) in IFC_VALUES else json.dumps(value))

    def finish(self) -> None:
        """Add what holds the buildings: project, site, units and the place of the origin."""
        metre, square, cube, radian = (
            self.make("IfcSIUnit", UnitType=kind, Name=name)
            for kind, name in (
                ("LENGTHUNIT", "METRE"),
                ("AREAUNIT", "SQUARE_METRE"),
                ("VOLUMEUNIT", "CUBIC_METRE"),
                ("PLANEANGLEUNIT", "RADIAN"),
            )
        )
        units = self.make("IfcUnitAssignment", Units=[metre, square, cube, radian])
        town = self.keys.name_square(self.origin)
        project = self.make_rooted(
            "IfcProject",
            town,
            Name="hiproof",
            RepresentationContexts=[self.context],
            UnitsInContext=units,
        )
        site = self.make_rooted("IfcSite", town, ObjectPlacement=self.placement)
        self.add_parts(project, [site], town)
        if self.buildings:
            self.add_parts(site, self.buildings, town)
        if self.crs is not None:
            self.place_in_crs(self.crs, metre)

    def add_parts(self, whole: Any, parts: list[Any], town: str) -> None:
        key = f"{whole.is_a()} {town}"
        self.make_rooted("IfcRelAggregates", key, RelatingObject=whole, RelatedObjects=parts)

    def place_in_crs(self, crs: str, metre: Any) -> None:
        """Say where the origin lies in the CRS, in its own units."""
        from pyproj import CRS

        from ...read.crs import find_units

        units = find_units(CRS(crs))
        origin = units.from_metres(self.origin)
        projected = self.make(
            "IfcProjectedCRS",
            Name=crs_name(crs),
            Description=CRS(crs).name,
            MapUnit=metre if units.are_metres else self.make_unit(units, metre),
        )
        kind, scales = scale_axes(units)
        self.make(
            kind,
            SourceCRS=self.context,
            TargetCRS=projected,
            Eastings=float(origin[0]),
            Northings=float(origin[1]),
            OrthogonalHeight=float(origin[2]),
            **scales,
        )

    def make_unit(self, units: Units, metre: Any) -> Any:
        """Make the unit of a plan that is not in metres."""
        length = self.make("IfcDimensionalExponents", 1, 0, 0, 0, 0, 0, 0)
        factor = self.make(
            "IfcMeasureWithUnit",
            ValueComponent=self.make("IfcLengthMeasure", units.plan),
            UnitComponent=metre,
        )
        return self.make(
            "IfcConversionBasedUnit",
            Dimensions=length,
            UnitType="LENGTHUNIT",
            Name=units.plan_name,
            ConversionFactor=factor,
        )


def scale_axes(units: Units) -> tuple[str, dict[str, float]]:
    """Return the entity that leads from metres to a CRS in these units, and its scales."""
    plan, height = 1 / units.plan, 1 / units.height
    if plan == height:
        return "IfcMapConversion", {"Scale": plan}
    return "IfcMapConversionScaled", {"FactorX": plan, "FactorY": plan, "FactorZ": height}
