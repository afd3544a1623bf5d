"""Finished models, building by building, of runs, parameters.jsonl, CityJSON and CityGML."""

from __future__ import annotations

import dataclasses
import os
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from pyproj import CRS

from ..data_files import Values
from ..errors import HiproofError, InputError, warn
from ..evaluate.metrics import plan_outline
from ..evaluate.models import BuildingModel, read_models, run_models
from ..evaluate.run import run_crs, run_record
from ..formats import FORMATS
from ..frames import LocalFrame
from ..geometry.rings import repair_polygons, ring_normal, ring_normals
from ..log import count_things
from ..masking import mask
from ..model import GROUND, ROOF, WALL, Building, Face, Model, Part, Piece, Roof, Solid
from ..read.crs import describe_crs, find_units, parse_crs, read_named_crs, same_horizontal
from ..read.models.cityjson import documents, reference_system
from ..read.models.damage import Damaged, refuse
from ..read.models.solids import CITYGML_SUFFIXES, find_citygml_crs, read_building_solids
from ..settings import ComposeSettings
from ..status import Status
from ..write.building_attributes import measure_figures
from ..write.fragments import Sheet, describe
from ..write.head import FileHead
from ..write.run_files import measure_or_drop_solid
from ..write.values import plain, plain_text
from .building import build
from .file import DAMAGED, HEAD_KEY, opened_parameters

# Share of a face's area that plan shows. A face that shows less is upright: rounded coordinates
# tilt a wall by some 1e-4.
PLAN_SHARE_UPRIGHT = 0.001
MOST_SRID = 998_999  # of a reference system of PostGIS


@dataclass(frozen=True)
class Run:
    """Finished models, read one by one while you iterate: `for building in run`.

    `path` is the file that they come from. `head` tells their CRS, units and settings. `record` is
    the content of run.json, empty where there is none.
    """

    path: Path
    head: FileHead
    record: Values

    @property
    def crs(self) -> Any:
        """The CRS (pyproj) of the models, None where it is unknown."""
        return self.head.crs

    def __iter__(self) -> Iterator[Building]:
        return (sheet.building for sheet in self.describe())

    def describe(self, damaged: Damaged = refuse) -> Iterator[Sheet]:
        """Yield every building with all that files need; `damaged` gets, or refuses, others."""
        if is_parameters(self.path):
            return describe_parametric(self.path, self.head, damaged)
        return describe_solids(self.path, self.head, damaged)


def open_run(path: str | os.PathLike[str], crs: Any = None) -> Run:
    """Open the models of a run's folder, or of a file.

    A file is parameters.jsonl, CityJSON, CityJSONSeq or CityGML. `crs` (anything pyproj
    understands) replaces the CRS that they name. Buildings are read when you iterate over the run,
    so that one is in memory at a time. Those of a parameters.jsonl, which every run has, are
    composed again and have parts with parameters; others have a solid alone. Raises InputError for
    what holds no models.
    """
    path = Path(path)
    record = run_record(path) if path.is_dir() else {}
    file = path / FORMATS["parameters"].file
    if not path.is_dir():
        file = path
    elif not file.is_file():
        file = run_models(path)
    return Run(file, read_file_head(file, record, parse_crs(crs)), record)


def read_file_head(file: Path, record: Values, crs: Any = None) -> FileHead:
    """Read the head of models; their CRS is `crs`, else that of the file, else of `record`."""
    if is_parameters(file):
        with opened_parameters(file) as (head, _):
            return (
                head
                if crs is None
                else dataclasses.replace(head, crs=replace_crs(crs, head.crs, file))
            )
    if file.suffix.lower() in CITYGML_SUFFIXES:
        name = find_citygml_crs(file)
    else:
        name = reference_system(next(documents(file))[0])
    if crs is None:
        return FileHead(read_named_crs(name, file) if name else run_crs(record))
    with suppress(InputError):  # of a name that PROJ does not know
        replace_crs(crs, parse_crs(name), file)
    return FileHead(crs)


def replace_crs(crs: CRS, named: CRS | None, file: Path) -> CRS:
    """Return the CRS given by hand; warns where `file` names one of other places."""
    if named is not None and not same_horizontal(named, crs):
        warn(
            mask(str(file)),
            f"names {describe_crs(named)}; its coordinates are taken as ones of "
            f"{describe_crs(crs)}, as given, and are not transformed",
        )
    return crs


def is_parameters(file: Path) -> bool:
    """Return whether a file begins as a parameters.jsonl does."""
    try:
        with file.open(encoding="utf-8-sig") as lines:
            return HEAD_KEY in lines.readline(200)
    except (OSError, UnicodeDecodeError):
        return False


def describe_parametric(path: Path, head: FileHead, damaged: Damaged) -> Iterator[Sheet]:
    """Yield the buildings of a parameters.jsonl, each composed."""
    with opened_parameters(path, damaged) as (_, records):
        for record in records:
            if record is DAMAGED:
                continue
            try:
                measured = measure_or_drop_solid(build(record, head.compose))
            except HiproofError as error:
                damaged(InputError(f"building {record['id']:.80} in {path}: {error}"))
                continue
            yield describe(*measured, head)


def describe_solids(path: Path, head: FileHead, damaged: Damaged) -> Iterator[Sheet]:
    """Yield the buildings of a file of solids, with the attributes that stand there.

    Those with the id of an earlier one are counted in a warning: a file may be joined of others.
    """
    known: Counter[str] = Counter()
    for model in read_solid_models(path, head, damaged):
        if model.is_damaged:
            continue
        known[model.id] += 1
        try:
            building = make_building(model)
            figures = measure_figures(building)
        except (ValueError, shapely.GEOSException) as error:
            damaged(InputError(f"expected a solid of {model.id:.80} in {path}, got: {error}"))
            continue
        yield Sheet(building, figures, building.attributes, head)
    if repeats := known.total() - len(known):
        warn(
            mask(str(path)),
            f"{count_things(repeats, 'building')} with an id given before; "
            "if it was joined of files that overlap, keep one of each",
        )


def read_solid_models(path: Path, head: FileHead, damaged: Damaged) -> Iterator[BuildingModel]:
    units = find_units(head.crs)
    if path.suffix.lower() in CITYGML_SUFFIXES:
        solids = read_building_solids(path, damaged, units)
        return (BuildingModel(id, {}, solid) for id, solid in solids)
    return read_models(path, units, damaged=damaged, must_be_valid=True)


def make_building(model: BuildingModel) -> Building:
    """Make the building of a model without parameters, a piece for each face of its roof."""
    attributes = {plain_text(name): plain(value) for name, value in model.attributes.items()}
    code = model.status.upper()
    status = Status[code] if code in Status.__members__ else Status.MODELLED
    if model.solid is None:
        return Building(model.id, status, attributes=attributes)
    named = name_faces(model.solid)
    parts = sorted({face.part for face in named.select_faces(ROOF)})
    types = [model.part_types.get(k, model.roof_type) for k in parts]
    number = {part: k for k, part in enumerate(parts)}
    faces = (
        dataclasses.replace(face, part=number[face.part] if face.kind == ROOF else -1)
        for face in named.faces
    )
    solid = dataclasses.replace(named, faces=tuple(faces))
    roof, z_ground = trace_roof(solid, types), float(solid.vertices[:, 2].min())
    built = Model(roof, solid, ComposeSettings())
    return Building(model.id, status, built=built, z_ground=z_ground, attributes=attributes)


def name_faces(solid: Solid) -> Solid:
    """Name faces that look up roof, where the file names none, and the others as they look."""
    if solid.select_faces(ROOF):
        return solid
    normals = ring_normals([solid.vertices[list(face.rings[0])] for face in solid.faces])
    up = normals[:, 2] / np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    sloping = np.where(up > 0, ROOF, GROUND)
    kinds = np.where(np.abs(up) > PLAN_SHARE_UPRIGHT, sloping, WALL).tolist()
    faces = (
        Face(face.rings, kind, 0 if kind == ROOF else -1)
        for face, kind in zip(solid.faces, kinds, strict=True)
    )
    return dataclasses.replace(solid, faces=tuple(faces))


def trace_roof(solid: Solid, types: list[str]) -> Roof:
    """Return the roof of a solid, traced from its faces, with parts of these `types`."""
    frame = LocalFrame(np.floor(solid.vertices.min(axis=0)))
    local = solid.move(-frame.origin)
    faces = local.select_faces(ROOF)
    pieces = [[trace_piece(local, f) for f in faces if f.part == k] for k in range(len(types))]
    parts = tuple(
        Part(kind, tuple(piece for piece in of_part if piece is not None))
        for kind, of_part in zip(types, pieces, strict=True)
    )
    return Roof(parts, plan_outline(local), frame)


def trace_piece(solid: Solid, face: Face) -> Piece | None:
    """Return the piece of a roof that a face is, None for an upright one."""
    ring = solid.vertices[list(face.rings[0])]
    normal = ring_normal(ring)
    if abs(normal[2]) <= PLAN_SHARE_UPRIGHT * np.linalg.norm(normal):
        return None
    a, b = -normal[:2] / normal[2]
    x, y, z = ring.mean(axis=0)
    outline = repair_polygons(solid.project_face(face))
    return Piece(outline, np.array([[a, b, z - a * x - b * y]]))


def load_postgis(
    folder: Path,
    dsn: str,
    prefix: str = "hiproof",
    damaged: Damaged = refuse,
    name: str | None = None,
    **how: bool,
) -> int:
    """Replace a prefix's tables in a database by the models of `folder`.

    They are PREFIX_buildings, PREFIX_roofs and PREFIX_parts of the database at `dsn`. `name` is
    that of the run in the tables, its folder's by default; `how` is `replace` or `append` (see
    Load). A damaged building is told to `damaged`, which refuses the run by default, and left out.
    Raises InputError for a folder without models, OutputError for a database that cannot be written
    or holds another run.
    """
    from ..write import naming
    from ..write.tables.postgis import Load, load_tables

    run, place = open_run(folder), Path(folder).resolve()
    code = (naming.reference_system(run.head.crs_of_files) or "").rpartition("/")[2]
    srid = int(code) if code.isdigit() and int(code) <= MOST_SRID else 0
    loaded = Load(name or place.name, str(place), prefix, srid, **how)
    return load_tables(dsn, run.describe(damaged), loaded, damaged)
