"""`hiproof build`: a file of parameters becomes the files of a run, building by building."""

from __future__ import annotations

import dataclasses
import json
import os
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import numpy as np
import shapely

from .. import __version__
from ..data_files import Values
from ..errors import HiproofError, InputError, OutputError, report_error
from ..evaluate.run import list_run_inputs, run_record
from ..formats import list_model_paths, list_requested_files
from ..log import LOGGER
from ..masking import mask, masked_values
from ..model import Building
from ..read.models.damage import finite
from ..settings import Changes, Settings
from ..status import Status
from ..write.cityjson.features import choose_offset
from ..write.files import STATE_FOLDER, refuse_overwriting, save_text
from ..write.fragments import Fragment, Fragments
from ..write.head import FileHead
from ..write.naming import FileUnits, UniqueNames, gml_name
from ..write.run_files import fragments, join_fragments
from ..write.values import dump, plain_text
from .building import build
from .file import opened_parameters

# sentences kept of buildings that could not be built; a wrong file may have millions
MOST_REPORTED = 1000


@dataclass
class Built:
    """The result of building a file: models, counts by status, and what could not be built.

    `not_built` lists (id, sentence) of the first MOST_REPORTED.
    """

    models: list[Path] = field(default_factory=list)
    by_status: Counter[str] = field(default_factory=Counter)
    by_quality: Counter[str] = field(default_factory=Counter)
    by_type: Counter[str] = field(default_factory=Counter)
    not_built: list[tuple[str, str]] = field(default_factory=list)

    @property
    def buildings(self) -> int:
        return sum(self.by_status.values())

    @property
    def exit_code(self) -> int:
        """0 all built, 1 an internal error, 2 some parameters make no valid solid."""
        if self.by_status[Status.INTERNAL_ERROR.code]:
            return 1
        return 2 if self.by_status[Status.NOT_BUILT.code] else 0

    def count(self, building: Building) -> None:
        self.by_status[building.status.code] += 1
        if building.grade:
            self.by_quality[building.grade.code] += 1
        if building.type:
            self.by_type[building.type] += 1
        if (
            building.status in (Status.NOT_BUILT, Status.INTERNAL_ERROR)
            and len(self.not_built) < MOST_REPORTED
        ):
            self.not_built.append((building.id, building.detail))


def build_file(
    path: str | os.PathLike[str],
    out: str | os.PathLike[str],
    progress: Callable[[int], None] = lambda done: None,
    changes: Changes | None = None,
) -> Built:
    """Write a run's files into the folder `out` from a parameters.jsonl.

    That file is `path`; that of an update gives changes.csv and changes.gpkg, too. What is written
    is as the file's head says, but for `changes` of the settings [write]. A building that cannot be
    built is written without a model, with a sentence, and keeps its parameters. Raises InputError
    for a file that cannot be read and OutputError for a folder that cannot be written; then nothing
    is written.
    """
    path, out, built = Path(path), Path(out), Built()
    if (out / STATE_FOLDER).exists():  # that command would make all its files again
        raise OutputError(
            f"expected a folder for what is built, got {out}, which holds a run of `hiproof "
            "reconstruct`; choose another --out"
        )
    with opened_parameters(path) as (head, records):
        settings = Settings(write=head.write).replace(changes or {})
        outputs = list_requested_files(settings, out).values()
        refuse_overwriting(outputs, [path, *list_run_inputs(path)])
        offset = head.offset if settings.write.out_crs == head.write.out_crs else None
        built.models = list_model_paths(settings, out)
        head = dataclasses.replace(head, write=settings.write, offset=offset)
        first = next(records, None)
        if first is not None:
            records = chain([first], records)
        if offset is None:
            head = dataclasses.replace(head, offset=offset_by(first, head.units))
        files = list_requested_files(settings, out)
        join_fragments(files, make_fragments(records, head, built, progress), head)
    write_record(path, out, head, built)
    return built


def make_fragments(
    records: Iterator[Values],
    head: FileHead,
    built: Built,
    progress: Callable[[int], None],
) -> Iterator[Fragments]:
    """Yield the texts of every building, and count them."""
    taken = UniqueNames(), UniqueNames()
    for number, record in enumerate(records, 1):
        id = record["id"]
        names = taken[0].take(plain_text(id)), taken[1].take(gml_name(id))
        building, texts = build_texts(record, names, head)
        built.count(building)
        progress(number)
        yield texts


def build_texts(
    record: Values, names: tuple[str, str], head: FileHead
) -> tuple[Building, Fragments]:
    """Return an object's building and texts; without a model it keeps its parameters."""
    id = record["id"]
    try:
        if names[0] != plain_text(id):
            raise InputError(
                f"expected buildings of different ids, got {id!r} again; give this one another"
            )
        return fragments(build(record, head.compose), names, head)
    except HiproofError as error:
        reason, status = str(error), Status.NOT_BUILT
    except Exception as error:
        reason, status = report_error(error).detail, Status.INTERNAL_ERROR
    building, texts = fragments(Building(id, status, mask(reason)), names, head)
    selection = finite({**record, "status": status.code, "detail": building.detail})
    return building, texts | {"parameters": Fragment(dump(selection) + b"\n")}


def offset_by(record: Values | None, units: FileUnits) -> np.ndarray:
    """Return the offset (3,) of a CityJSON file whose first building is `record`."""
    from .record import read_building

    try:
        outline = read_building(record)[0].footprint if record is not None else None
    except HiproofError:
        outline = None
    if outline is None:
        return np.zeros(3)
    return choose_offset(units.cityjson.from_metres(np.array(shapely.bounds(outline)[:2])))


def write_record(path: Path, out: Path, head: FileHead, built: Built) -> None:
    """Write run.json: what was built from which file, with the clouds and footprints of its run."""
    record = {
        "hiproof": __version__,
        **earlier_record(path.parent, head),
        "parameters": str(path),
        "crs": None if head.crs is None else head.crs.to_wkt(),
        "buildings": built.buildings,
        "by_status": dict(built.by_status),
        "by_quality": dict(built.by_quality),
        "by_type": dict(built.by_type),
        "not_built": [list(pair) for pair in built.not_built],
    }
    save_text(out / "run.json", json.dumps(masked_values(record), indent=1) + "\n")


def earlier_record(folder: Path, head: FileHead) -> Values:
    """Return settings, inputs and surveys of the run in `folder`, if there is one.

    The way in which coordinates are written, and their units, are those of `head`, so that whoever
    reads the models finds their place.
    """
    try:
        record = run_record(folder)
    except InputError as error:
        LOGGER.warning("built without the settings and inputs of the run: %s", error)
        record = {}
    names = ("settings", "inputs", "epochs", "update")
    kept_values = {name: record[name] for name in names if record.get(name)}
    settings = {
        "read": {"unit": head.unit},
        **kept_values.get("settings", {}),
        "write": dataclasses.asdict(head.write),
    }
    return {**kept_values, "settings": settings, "units": head.units.describe()}
