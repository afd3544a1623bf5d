"""The geometry of a building beside its own solid, as requested: LoD0, blocks, parts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..data_files import Values
from ..errors import CompositionError
from ..model import GROUND, Building, Face, Solid
from ..model.roof_figures import RoofFigures, roof_figures
from ..settings import WriteSettings
from .attribute_list import OF_PARTS, OWN, PREFIX
from .building_attributes import part_values, shape_attributes
from .values import metres, plain

if TYPE_CHECKING:
    from ..compose.building_parts import BuildingPart


@dataclass(frozen=True)
class PartShape:
    """A building part with what is drawn of it.

    It has its `solid` with `figures`, its LoD1.3 `block` if requested, the roof types of its roof
    parts, the largest first, and its attributes.
    """

    solid: Solid
    figures: RoofFigures
    block: Solid | None
    types: tuple[str, ...]
    attributes: Values


@dataclass(frozen=True)
class Shapes:
    """A building's further geometry, None or empty where there is none.

    There is none where it is not requested. `outline` is the solid's ground, which at the height of
    the eaves, `z_edge`, is the roof's edge of LoD0; `lod12` and `lod13` are blocks; `parts` are two
    or more, and have blocks of their own in place of `lod13`.
    """

    outline: Face | None = None
    z_edge: float = float("nan")
    lod12: Solid | None = None
    lod13: Solid | None = None
    parts: tuple[PartShape, ...] = ()

    def edge_vertices(self, solid: Solid) -> np.ndarray:
        """Return the vertices (n, 3) of `solid` at the height of the roof's edge."""
        return np.column_stack([solid.vertices[:, :2], np.full(len(solid.vertices), self.z_edge)])


def make_shapes(
    building: Building, figures: RoofFigures | None, write: WriteSettings, prefix: str = PREFIX
) -> Shapes:
    """Return the shapes that `write` asks for; `figures` are the solid's, None without."""
    lods = set(write.lods)
    if (
        building.built is None
        or figures is None
        or (lods <= {"2.2", "2.3"} and write.parts_as == "one")
    ):
        return Shapes()
    from ..compose.blocks import block, blocks

    solid = building.model.on_one_level
    ground = solid.select_faces(GROUND)[0]
    cut = cut_into_parts(building) if write.parts_as == "buildingparts" or "1.3" in lods else ()
    parts = part_shapes(building, cut, lods, prefix) if write.parts_as == "buildingparts" else ()
    lod12 = None
    if lods & {"1.2", "1.3"}:  # as high as 7/10 of the roof lie below, as in 3DBAG
        lod12 = block(solid.project_face(ground), figures.h_base, metres(figures.h_70p))
    lod13 = None
    if "1.3" in lods and not parts:  # as high as 7/10 of the roof of each part lie below
        heights = [metres(roof_figures(part.solid).h_70p) for part in cut]
        outlines = [part.outline for part in cut]
        lod13 = (blocks(outlines, heights, figures.h_base) if cut else None) or lod12
    return Shapes(
        outline=ground if "0" in lods else None,
        z_edge=metres(figures.h_eave),
        lod12=lod12 if "1.2" in lods else None,
        lod13=lod13,
        parts=parts,
    )


def cut_into_parts(building: Building) -> tuple[BuildingPart, ...]:
    """Return the parts, with the whole's underside, none where one would be invalid."""
    from ..compose.building_parts import building_parts
    from ..compose.underside import finish_solid

    model = building.model
    parts = building_parts(model.on_one_level)
    if model.underside.is_level:
        return parts
    origin = model.roof.frame.origin
    try:
        return tuple(
            replace(part, solid=finish_solid(part.solid, model.underside, origin, model.compose))
            for part in parts
        )
    except CompositionError:
        return ()


def part_shapes(
    building: Building, cut: tuple[BuildingPart, ...], requested: set[str], prefix: str
) -> tuple[PartShape, ...]:
    """Return the building parts with what their roof parts are."""
    from ..compose.blocks import block

    primitives = [
        {name: plain(value) for name, value in part_values(building, number, visible).items()}
        for number, visible in enumerate(building.compute_visible_areas())
    ]
    shapes = []
    for part in cut:
        figures = roof_figures(part.solid)
        height = metres(figures.h_70p)
        lod13 = block(part.outline, figures.h_base, height) if "1.3" in requested else None
        own = [primitives[member] for member in part.members if member < len(primitives)]
        types = tuple(values["type"] for values in own)
        values = {
            **shape_attributes(figures),
            "roof_type": figures.roofer_type,
            "roof_n_surfaces": figures.roof_faces,
        }
        attributes = {
            **{prefix + name: plain(values[name]) for name in OF_PARTS},
            f"{OWN}h_eave": plain(metres(figures.h_eave)),
            f"{OWN}roof_type": next(iter(types), None),
            f"{OWN}primitives": own,
        }
        shapes.append(PartShape(part.solid, figures, lod13, types, attributes))
    return tuple(shapes)
