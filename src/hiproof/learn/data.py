"""Sources of training clouds: the simulator, The Hague's real shapes under it, RoofN3D."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from ..errors import InputError
from ..model import GROUND, ROOF, Solid
from ..primitives.catalogue import CATALOGUE, CURVED
from ..read.models.cityjson import features
from ..read.models.solids import read_solids
from ..read.roofn3d import read_roofn3d, read_roofn3d_labels
from ..segment.inference import NOT_ROOF
from ..simulate import ROOF_TYPES, Scan, scan, scan_solids
from ..simulate.roofs import find_label
from ..simulate.scene import SOURCE_ROOF
from ..simulate.training import random_settings
from .houses import training_house
from .sample import TRAINING, Sample, Source

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
        held_out = np.array([is_held_out(id, HELD_OUT_PERCENT) for id in ids], bool)
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


# Curved types of whole roofs: half cones are those of apses alone.
CURVED_TYPES = tuple(name for name in CURVED if name != "half_cone")
DENSITY = (1.0, 20.0)  # points/m2, from the sparsest to the densest of national surveys
# points of a training cloud: fewer show no roof, more are thinned away by the network anyway
POINTS = (60, 1500)
ANNEX_SHARE = 0.35  # of the simulated buildings have an annex
# of a mixture's clouds: the main source teaches most, the others what it lacks
FIRST_SOURCE_SHARE = 0.7


@dataclass(frozen=True)
class Simulated:
    """Buildings simulated without end, some with annexes, the scanner with all defects."""

    types: tuple[str, ...]
    seed: int
    annex_share: float = ANNEX_SHARE

    @property
    def description(self) -> str:
        return (
            f"simulated airborne scans, {DENSITY[0]:g}-{DENSITY[1]:g} points/m2, all defects, "
            f"{100 * self.annex_share:.0f} % of the buildings with annexes, seed {self.seed}"
        )

    def sample(self, role: int, index: int) -> Sample:
        rng = np.random.default_rng([self.seed, role, index])
        type = int(rng.integers(len(self.types)))
        while True:
            building = training_house(rng, self.types[type], self.annex_share)
            cloud = scan(
                building, rng, random_settings(rng, building.outline.area, DENSITY, POINTS, None)
            )
            if usable(cloud):
                return as_sample(cloud, self.types, type, rng)


@dataclass(frozen=True)
class Scanned:
    """Solids of a CityJSON file with a roofType, under the same scanner.

    Types are drawn evenly, then their shapes. Training never sees the buildings held out for
    validation and test (a share by the hash of the building's id).
    """

    types: tuple[str, ...]
    seed: int
    path: Path
    shapes: tuple[Shape, ...]

    @property
    def description(self) -> str:
        held_out = sum(shape.held_out for shape in self.shapes)
        return (
            f"{len(self.shapes) - held_out} real shapes of {self.path.name} under the simulated "
            f"scanner ({held_out} held out by building), seed {self.seed}"
        )

    def sample(self, role: int, index: int) -> Sample:
        rng = np.random.default_rng([self.seed, 11, role, index])
        shapes = [shape for shape in self.shapes if shape.held_out == (role != TRAINING)]
        present = sorted({shape.type for shape in shapes}, key=self.types.index)
        type = present[rng.integers(len(present))]
        while True:
            shapes_of_type = [shape for shape in shapes if shape.type == type]
            shape = shapes_of_type[rng.integers(len(shapes_of_type))]
            settings = random_settings(rng, shape.outline.area, DENSITY, POINTS, None)
            cloud = scan_solids([shape.solid], rng, settings, [shape.type])
            if usable(cloud):
                return as_sample(cloud, self.types, self.types.index(type), rng)


@dataclass(frozen=True)
class Mixture:
    """Several sources; validation and test come from the first, the main one."""

    sources: tuple[Source, ...]
    seed: int

    @property
    def types(self) -> tuple[str, ...]:
        return self.sources[0].types

    @property
    def description(self) -> str:
        share = 100 * FIRST_SOURCE_SHARE
        return f"{share:.0f} %: {self.sources[0].description}; else: " + "; ".join(
            source.description for source in self.sources[1:]
        )

    def sample(self, role: int, index: int) -> Sample:
        rng = np.random.default_rng([self.seed, 13, role, index])
        if role != TRAINING or rng.random() < FIRST_SOURCE_SHARE:
            return self.sources[0].sample(role, index)
        return self.sources[1 + rng.integers(len(self.sources) - 1)].sample(role, index)


def usable(cloud: Scan) -> bool:
    """Return whether enough of the roof was seen to name its type."""
    return len(cloud) >= POINTS[0] and (cloud.source == SOURCE_ROOF).sum() >= 0.3 * POINTS[0]


def as_sample(cloud: Scan, types: tuple[str, ...], type: int, rng: np.random.Generator) -> Sample:
    """Return a scan with labels in `types`, thinned to the most points of a training cloud."""
    if len(cloud) > POINTS[1]:
        cloud = cloud.select(np.sort(rng.choice(len(cloud), POINTS[1], replace=False)))
    index = np.full(len(CATALOGUE) + 1, NOT_ROOF)  # the last for what is no roof
    for position, name in enumerate(types):
        index[find_label(name)] = position
    return Sample(cloud.points - cloud.points.mean(axis=0), index[cloud.label], type)


def open_source(data: str | list[str], types: tuple[str, ...] = (), seed: int = 1) -> Source:
    """Open the source or sources that `data` names.

    Names are "simulated", "denhaag:FILE" or "roofn3d:DIR". `types` empty means all planar ones of
    whole roofs. Curved ones are simulated where they are named. Raises InputError for names, types
    or files that cannot be used.
    """
    known = (*ROOF_TYPES, *CURVED_TYPES)
    unknown = [name for name in types if name not in known]
    if unknown:
        raise InputError(f"expected roof types among {', '.join(known)}, got {', '.join(unknown)}")
    names = [data] if isinstance(data, str) else list(data)
    if not names:
        raise InputError(
            "expected training data, got none; give simulated, denhaag:FILE or roofn3d:DIR"
        )
    sources = tuple(open_data_set(name, tuple(types), seed) for name in names)
    if any(source.types != sources[0].types for source in sources):
        raise InputError(
            "expected data of the same roof types to be mixed; name the types with --types"
        )
    return sources[0] if len(sources) == 1 else Mixture(sources, seed)


def open_data_set(name: str, types: tuple[str, ...], seed: int) -> Source:
    kind, _, path = name.partition(":")
    if kind == "simulated" and not path:
        return Simulated(types or ROOF_TYPES, seed)
    if kind == "denhaag" and path:
        types = types or ROOF_TYPES
        shapes = tuple(shape for shape in read_shapes(Path(path)) if shape.type in types)
        if not {shape.type for shape in shapes if not shape.held_out} or all(
            not shape.held_out for shape in shapes
        ):
            raise InputError(
                f"expected solids with a known roofType in {path}, got too few to train and "
                "validate on"
            )
        return Scanned(types, seed, Path(path), shapes)
    if kind == "roofn3d" and path:
        return RoofN3D.open(Path(path), types, seed)
    raise InputError(
        f"expected training data as simulated, denhaag:FILE or roofn3d:DIR, got {name!r}"
    )


# Types that share a code (both gables) are read as the first, the commoner one; 1120 is a pyramidal
# broach.
TYPE_OF_CODE = {CATALOGUE[name].citygml_code: name for name in reversed(CATALOGUE)} | {
    "1120": "pyramid"
}
# of the buildings: shapes are few, and a test on a fifth would tell little
HELD_OUT_SHAPES_PERCENT = 40
SMALLEST_AREA_M2 = 12.0  # m2 of ground; smaller are sheds, whose type is often wrong in the file


@dataclass(frozen=True)
class Shape:
    """A solid in the world: its roof type, plan `outline`, and whether training may see it."""

    id: str
    type: str
    solid: Solid
    outline: shapely.Geometry
    held_out: bool


def read_shapes(path: Path) -> list[Shape]:
    """Read the solids of 12 m2 or more of a CityJSON file with a known roofType.

    All parts of a building are held out together. Raises InputError for a file that is no CityJSON.
    """
    solids = dict(read_solids(path))
    objects = {name: item for feature in features(path) for name, item in feature.objects.items()}
    shapes = []
    for name, solid in solids.items():
        item = objects.get(name, {})
        type = TYPE_OF_CODE.get(str(item.get("attributes", {}).get("roofType")))
        outline = ground_outline(solid)
        if type is not None and outline.area >= SMALLEST_AREA_M2:
            shapes.append(
                Shape(
                    name,
                    type,
                    solid,
                    outline,
                    is_held_out((item.get("parents") or [name])[0], HELD_OUT_SHAPES_PERCENT),
                )
            )
    if not shapes:
        raise InputError(
            f"expected solids with a known roofType attribute in {path}, got none among "
            f"{len(solids)} solids"
        )
    return shapes


def is_held_out(id: str, percent: int) -> bool:
    """Return whether `id` is among the share that training never sees, whatever the order.

    >>> round(sum(is_held_out(str(i), 20) for i in range(10_000)) / 10_000, 1)
    0.2
    """
    return zlib.crc32(id.encode()) % 100 < percent


def ground_outline(solid: Solid) -> shapely.Geometry:
    """Plan outline of the ground surfaces (of the roof's where there are none)."""
    faces = solid.select_faces(GROUND) or solid.select_faces(ROOF)
    rings = [solid.vertices[list(face.rings[0])][:, :2] for face in faces]
    return shapely.union_all(
        [
            shapely.make_valid(shapely.Polygon(ring))
            for ring in rings
            if len(np.unique(ring, axis=0)) > 2
        ]
    )
