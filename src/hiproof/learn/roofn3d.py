"""RoofN3D as training data: gables, hips and pyramids, split 80/20 by id."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..read.roofn3d import read_roofn3d, read_roofn3d_labels
from ..segment.inference import NOT_ROOF
from ..simulate import ROOF_TYPES
from .sample import TRAINING, Sample

BUILDINGS_FILE, SURFACES_FILE = "roofn3d_buildings.csv", "roofn3d_surfacegrowing.csv"
TRAINING_TYPES = tuple(name for name in ROOF_TYPES if name in ("gable", "hip", "pyramid"))
HELD_OUT_PERCENT = 20  # of the ids, which training never sees: the usual fifth
FEWEST_CLOUD_POINTS = 10  # points; the least the network takes


@dataclass(frozen=True)
class RoofN3D:
    """All usable buildings.

    `xyz` (n, 3) float32 and `on_surface` (n,) lie end to end, cut at `starts` (b + 1), each with
    its `type_of` (b,) and `held_out` (b,). Training draws types evenly; held-out buildings come in
    the file's order.
    """

    types: tuple[str, ...]
    seed: int
    xyz: np.ndarray
    on_surface: np.ndarray
    starts: np.ndarray
    type_of: np.ndarray
    held_out: np.ndarray

    @property
    def description(self) -> str:
        return (
            f"RoofN3D, {(~self.held_out).sum()} buildings to train on and {self.held_out.sum()} "
            "held out by id"
        )

    @classmethod
    def open(cls, folder: Path, types: tuple[str, ...] = (), seed: int = 1) -> RoofN3D:
        """Read both csv files of `folder`; InputError where missing, too few, or otherwise laid."""
        for name in (BUILDINGS_FILE, SURFACES_FILE):
            if not (folder / name).is_file():
                raise InputError(
                    f"expected RoofN3D's {name} in {folder}, found none; download it from "
                    "roofn3d.gis.tu-berlin.de"
                )
        types = types or TRAINING_TYPES
        clouds, surfaces, kinds, ids = [], [], [], []
        for record, labels in read_roofn3d_labels(
            folder / SURFACES_FILE, read_roofn3d(folder / BUILDINGS_FILE)
        ):
            if record.type in types and len(record.points) >= FEWEST_CLOUD_POINTS:
                clouds.append((record.points - record.points.mean(axis=0)).astype(np.float32))
                surfaces.append(labels >= 0)
                kinds.append(types.index(record.type))
                ids.append(record.id)
        held_out = np.array([is_held_out(id) for id in ids], bool)
        if held_out.all() or not held_out.any():
            raise InputError(
                f"expected enough RoofN3D buildings in {folder} to train and validate on, got "
                f"{len(ids)}"
            )
        starts = np.cumsum([0] + [len(cloud) for cloud in clouds])
        return cls(
            types,
            seed,
            np.concatenate(clouds),
            np.concatenate(surfaces),
            starts,
            np.array(kinds),
            held_out,
        )

    def sample(self, role: int, index: int) -> Sample:
        """Return a training cloud by number, or held-out cloud number `index`."""
        if role == TRAINING:
            rng = np.random.default_rng([self.seed, 17, index])
            present = np.unique(self.type_of[~self.held_out])
            of_type = np.flatnonzero(
                ~self.held_out & (self.type_of == present[rng.integers(len(present))])
            )
            building = of_type[rng.integers(len(of_type))]
        else:
            held_out = np.flatnonzero(self.held_out)
            building = held_out[index % len(held_out)]
        rows = slice(self.starts[building], self.starts[building + 1])
        type = int(self.type_of[building])
        return Sample(
            self.xyz[rows].astype(float), np.where(self.on_surface[rows], type, NOT_ROOF), type
        )


def is_held_out(id: str) -> bool:
    """Return whether `id` is among the 20 % that training never sees.

    The file's order does not matter.

    >>> round(sum(is_held_out(str(i)) for i in range(10_000)) / 10_000, 1)
    0.2
    """
    return zlib.crc32(id.encode()) % 100 < HELD_OUT_PERCENT
