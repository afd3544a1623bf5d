"""Wavefront OBJ with its material library: one object a building.

Groups name the roof type and kind of surface.

OBJ has no attributes: the building's id is the object's name, the roof types of its parts are those
of groups and materials. Coordinates are about an origin that the first lines name, because viewers
compute in float32. z points up.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ...model import Face, Solid
from ..colours import GROUND_COLOUR, WALL_COLOUR, srgb, type_colours
from .triangles import face_triangles
from .viewed import ViewedModel


def write_models(path: Path, buildings: Iterable[ViewedModel], crs: str | None = None) -> int:
    """Write `buildings` to `path` with its `.mtl`; returns how many.

    Attributes other than id and roof type have no place in OBJ. Raises OutputError when a file
    cannot be written.
    """
    from ..files import atomic_file

    path = Path(path)
    library = path.with_suffix(".mtl")
    count, first, origin = 0, 1, None
    with atomic_file(path) as file:
        for model in buildings:
            if origin is None:
                origin = model.corner
                file.write(header(library.name, origin, crs).encode())
            file.write(building_text(model, origin, first).encode())
            first += len(model.solid.vertices)
            count += 1
    with atomic_file(library) as file:
        file.write(material_library().encode())
    return count


def header(library: str, origin: np.ndarray, crs: str | None) -> str:
    text = " ".join(f"{value:.0f}" for value in origin)
    return (
        f"# hiproof; in metres; the origin {text} is to be added to every vertex\n"
        f"# crs: {crs}; its coordinates are metres divided by its unit\nmtllib {library}\n"
    )


def building_text(model: ViewedModel, origin: np.ndarray, first: int) -> str:
    """Return one building's lines; `first` is its first vertex's number in the file."""
    name, solid = "_".join(model.id.split()) or "_", model.solid
    lines = [f"o {name}"]
    lines += [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in solid.vertices - origin]
    for look, faces in model.faces_by_look().items():
        lines += [f"g {name} {look.name}", f"usemtl {look.name.replace(' ', '_')}"]
        for face in faces:
            lines += [
                "f " + " ".join(str(first + index) for index in polygon)
                for polygon in polygons(solid, face)
            ]
    return "\n".join(lines) + "\n"


def polygons(solid: Solid, face: Face) -> Iterable[Iterable[int]]:
    """Return the face, or its triangles where it has holes, which OBJ cannot write."""
    return face.rings if len(face.rings) == 1 else face_triangles(solid.vertices, face)


def material_library() -> str:
    """Return every material that a model may name."""
    colours = {f"roof_{name}": colour for name, colour in type_colours().items()}
    colours |= {"WallSurface": WALL_COLOUR, "GroundSurface": GROUND_COLOUR}
    entries = [
        "newmtl {}\nKd {:.3f} {:.3f} {:.3f}\n".format(name, *srgb(colour))
        for name, colour in colours.items()
    ]
    return "\n".join(entries)
