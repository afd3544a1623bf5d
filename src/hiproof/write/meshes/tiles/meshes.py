"""One building as triangles of one draw call.

Places, normals and colours by corner wait in a file until its tile is known.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from ...colours import linear_rgb
from ..gltf import flat_triangles
from ..viewed import ViewedModel


@dataclass(frozen=True)
class TileMesh:
    """Corners (3 t, 3), y up, with normals and colours.

    Their face's `normals` are (3 t, 3), `colours` (3 t, 4) linear bytes.
    """

    corners: np.ndarray
    normals: np.ndarray
    colours: np.ndarray

    @property
    def triangles(self) -> int:
        return len(self.corners) // 3

    def save(self, file: BinaryIO) -> None:
        for array in (self.corners, self.normals, self.colours):
            np.save(file, array, allow_pickle=False)

    @classmethod
    def load(cls, file: BinaryIO) -> TileMesh:
        """Load the mesh that `save` wrote where `file` stands now."""
        return cls(*(np.load(file, allow_pickle=False) for _ in range(3)))


def make_mesh(model: ViewedModel, vertices: np.ndarray) -> TileMesh:
    """Return the mesh of a model.

    Its solid's `vertices` (n, 3) are east, north, up of the tileset's frame.
    """
    corners, normals, colours = [], [], []
    for look, faces in model.faces_by_look().items():
        places, facing = flat_triangles(vertices, faces)
        corners.append(places)
        normals.append(facing)
        colours.append(
            np.tile(np.round(np.multiply([*linear_rgb(look.colour), 1.0], 255)), (len(places), 1))
        )
    return TileMesh(
        np.concatenate(corners),
        np.concatenate(normals).astype("<f4"),
        np.concatenate(colours).astype(np.uint8),
    )
