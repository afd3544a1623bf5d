"""`hiproof enrich`: answers about every building of a run, in parallel.

Blocks of buildings that follow one another in the file are tasks. Their texts wait in a hidden
folder until all are there, and are then joined into files in the run's order: an interrupted
command goes on with the blocks that are missing. No answer depends on the blocks.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .. import __version__
from ..city.plan.checks import refuse_missing_use
from ..city.work.cores import as_many_as_pay
from ..city.work.executors import make_executor
from ..errors import HiproofError, InputError, OutputError, report_error, warn
from ..evaluate.run import list_run_inputs, run_record
from ..formats import FORMATS, list_requested_files, requested_fragments
from ..log import LOGGER
from ..masking import masked_values
from ..model import Building
from ..settings import EnrichSettings, Settings
from ..status import Status
from ..write.attribute_list import OWN
from ..write.building_attributes import measure_figures
from ..write.cityjson.features import choose_offset
from ..write.files import atomic_file, refuse_overwriting, save_text
from ..write.fragments import Fragment, Fragments, describe, load_fragments, save_fragments
from ..write.head import FileHead
from ..write.run_files import join_fragments, make_texts
from ..write.values import plain_text
from .answer import Answers, answer, is_residential
from .cadastre import Cadastre, refuse_unfit, refuse_unusable
from .energy import refuse_other_citygml, write_energy
from .party import Town
from .records import Index, Records, index_records
from .weather import name_sky

# Modules of files that enriched folders do not have: parameters stay the run's.
NOT_MADE = ("parameters",)

FAILURE = "failure"  # where a building's fragments say why it has no answers, empty where it has


class EnrichFailure(NamedTuple):
    """A building without answers and why; `is_internal` is whether hiproof is to blame."""

    id: str
    reason: str
    is_internal: bool


def make_fragments(
    town: Town,
    number: int,
    head: FileHead,
    settings: EnrichSettings,
    cadastre: Cadastre | None = None,
) -> Fragments:
    """Return the texts and answers of building `number`, or its failure as an attribute."""
    result, failure = answer_or_fail(town, number, settings, cadastre)
    building = result.building
    names = plain_text(building.id), town.records.name_in_gml(number)
    plain = describe(building, measure_figures(building), head, *names)
    attributes = plain.attributes | result.attributes
    sheet = dataclasses.replace(plain, attributes=attributes, surfaces=result.surfaces)
    if settings.energy_ade:
        sheet = dataclasses.replace(sheet, extension=write_energy(sheet))
    kinds = (kind for kind in requested_fragments(head.write) if kind not in NOT_MADE)
    return {
        **make_texts(sheet, kinds),
        FAILURE: Fragment(json.dumps(failure).encode() if failure else b""),
    }


def answer_or_fail(
    town: Town, number: int, settings: EnrichSettings, cadastre: Cadastre | None
) -> tuple[Answers, EnrichFailure | None]:
    """Answer all questions about building `number`, or say why not."""
    building = town.read(number)
    if building.built is None and town.records.index.modelled[number]:
        is_internal = building.status is Status.INTERNAL_ERROR
        return leave(building, building.detail, is_internal)
    try:
        return answer(town, number, settings.use_attribute, cadastre), None
    except HiproofError as error:
        return leave(building, str(error), False)
    except Exception as error:
        report = report_error(error)
        LOGGER.debug("building %s was not enriched: %s", building.id, report.trace)
        return leave(building, report.detail, True)


def leave(building: Building, reason: str, is_internal: bool) -> tuple[Answers, EnrichFailure]:
    """Return a building as it was, with the reason why it has no answers."""
    failure = EnrichFailure(plain_text(building.id), reason, is_internal)
    return Answers(building, {f"{OWN}not_enriched": reason}, {}), failure


BLOCK_BUILDINGS = 64  # buildings of a task: a second of work
# The folder of a run that has its enriched files, and that of blocks until these are written.
FOLDER, WAITING = "enriched", ".enrich"


class Enriched(NamedTuple):
    """The files that were written, their number of buildings, and those without answers."""

    files: list[Path]
    buildings: int
    failures: list[EnrichFailure]

    @property
    def exit_code(self) -> int:
        """0 if every model has answers, 1 for an internal error, 2 for other failures."""
        if any(failure.is_internal for failure in self.failures):
            return 1
        return 2 if self.failures else 0


def enrich_run(
    run: Path,
    out: Path | None = None,
    settings: EnrichSettings | None = None,
    processes: int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Enriched:
    """Write the files of a finished run again, with answers added.

    `run` is its folder, or its parameters.jsonl. The files go to the folder `out`, or to `enriched`
    in the run's folder, each whole or not at all; they replace those of an earlier call. Nothing of
    the run itself changes. Raises InputError for what is no run, and OutputError for a folder that
    cannot be written.
    """
    settings = settings or EnrichSettings()
    refuse_unusable(settings)
    parameters = run / FORMATS["parameters"].file if run.is_dir() else run
    out = out or parameters.parent / FOLDER
    refuse_places(parameters, out)
    index = index_records(parameters, settings.use_attribute)
    if len(index.offsets):
        refuse_missing_use(index.attributes, settings.use_attribute)
        warn_without_residential(index.uses, settings.use_attribute)
    records = Records(parameters, index)
    refuse_unfit(records, settings)
    requested = Settings(write=records.head.write, enrich=settings)
    refuse_other_citygml(requested)
    inputs = [parameters, settings.weather, settings.horizon, settings.shading_terrain]
    outputs = list_requested_files(requested, out).values()
    refuse_overwriting(outputs, [*inputs, *list_run_inputs(parameters)])
    waiting = make_waiting_folder(out, parameters, settings)
    with atomic_file(waiting / "index.npz") as file:
        np.savez(file, **index._asdict())
    total = len(records)
    blocks = [
        (waiting / f"{first}.npz", first, min(first + BLOCK_BUILDINGS, total))
        for first in range(0, total, BLOCK_BUILDINGS)
    ]
    enrich_blocks(str(parameters), settings, blocks, processes, progress)
    files, failures = join_blocks(blocks, find_head(records, settings), out)
    result = Enriched(list(files.values()), len(records), failures)
    write_record(parameters.parent, out, settings, result)
    shutil.rmtree(waiting.parent, ignore_errors=True)
    return result


def refuse_places(parameters: Path, out: Path) -> None:
    """Raise OutputError where `out` holds a run, InputError without `parameters`."""
    if (out / FORMATS["parameters"].file).exists():
        raise OutputError(
            f"expected a folder for enriched files, got {out}, which holds a run; choose another "
            "--out"
        )
    if not parameters.is_file():
        raise InputError(
            f"expected the output folder of `hiproof reconstruct`, got no {parameters}; check the "
            "path"
        )


def enrich_blocks(
    parameters: str,
    settings: EnrichSettings,
    blocks: list[tuple[Path, int, int]],
    processes: int | None,
    progress: Callable[[int, int], None],
) -> None:
    """Make the missing blocks in parallel: files, and the numbers [first, last) of buildings."""
    missing = [block for block in blocks if not block[0].is_file()]
    total = blocks[-1][2] if blocks else 0
    done = total - sum(last - first for _, first, last in missing)
    executor = make_executor(processes or as_many_as_pay(total, len(missing)))
    try:
        tasks = ((parameters, settings, str(file), first, last) for file, first, last in missing)
        for task, _, error in executor.run(enrich_block, tasks):
            if error is not None:
                raise error
            done += task[4] - task[3]
            progress(done, total)
    finally:
        executor.close()


def warn_without_residential(uses: np.ndarray, name: str) -> None:
    """Warn where none of the `uses` (n,) is a dwelling's, as where they are codes."""
    named = [str(use) for use in uses if use]
    if named and not any(map(is_residential, named)):
        warn(
            name,
            f"expected words such as residential, Wohnhaus or woonfunctie, got none, but "
            f"{named[0]:.40}; buildings with a use get no house type, and storeys as in offices",
        )


def make_waiting_folder(out: Path, parameters: Path, settings: EnrichSettings) -> Path:
    """Make the hidden folder of the blocks of a request; those of others are removed."""
    state = parameters.stat()
    request = [__version__, str(parameters), state.st_size, state.st_mtime_ns]
    values = list(dataclasses.astuple(settings))
    paths = [
        Path(getattr(settings, declared.name))
        for declared in dataclasses.fields(settings)
        if declared.metadata["names"] == "files"
    ]
    request += [values + [path.stat().st_mtime_ns for path in paths if path.is_file()]]
    key = hashlib.sha256(json.dumps(request).encode()).hexdigest()[:16]
    waiting = out / WAITING / key
    if waiting.parent.is_dir():
        for other in waiting.parent.iterdir():
            if other.name != key:
                shutil.rmtree(other, ignore_errors=True)
    try:
        waiting.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(
            f"expected to write into {out}, got: {error}; choose another --out"
        ) from error
    return waiting


def enrich_block(
    parameters: str, settings: EnrichSettings, block: str, first: int, last: int
) -> None:
    """Write the texts of the buildings [first, last) to the file `block`."""
    town, cadastre = open_town(parameters, settings, str(Path(block).with_name("index.npz")))
    head = find_head(town.records, settings)
    parts = [
        make_fragments(town, number, head, settings, cadastre) for number in range(first, last)
    ]
    with atomic_file(block) as file:
        save_fragments(file, parts)


@functools.lru_cache(1)
def open_town(
    parameters: str, settings: EnrichSettings, index_file: str
) -> tuple[Town, Cadastre | None]:
    """Open the run's buildings, and the sun on their roofs if asked, once in each process."""
    with np.load(index_file, allow_pickle=False) as arrays:
        index = Index(**{name: arrays[name] for name in Index._fields})
    town = Town(Records(Path(parameters), index), settings.touch_m)
    return town, Cadastre(town, settings) if settings.sun else None


def find_head(records: Records, settings: EnrichSettings) -> FileHead:
    """Return the head of the enriched files.

    Each building is one solid, whose walls are cut. Where the run names no offset of the CityJSON
    file, its first building sets it, as `hiproof build` has it.
    """
    head = dataclasses.replace(
        records.head,
        write=dataclasses.replace(records.head.write, parts_as="one"),
        sky=name_sky(settings.weather) if settings.sun else "",
    )
    if head.offset is not None or not len(records):
        return head
    corner = np.nan_to_num(records.index.boxes[0, :2])
    return dataclasses.replace(head, offset=choose_offset(head.units.cityjson.from_metres(corner)))


def join_blocks(
    blocks: list[tuple[Path, int, int]], head: FileHead, out: Path
) -> tuple[dict[str, Path], list[EnrichFailure]]:
    """Join the texts of all blocks into files by format; returns failures, too."""
    failures: list[EnrichFailure] = []
    files = list_requested_files(Settings(write=head.write), out)
    del files["parameters"]

    def read_blocks() -> Iterator[Fragments]:
        for path, _, _ in blocks:
            for fragments in load_fragments(path):
                text = fragments[FAILURE].text
                if text:
                    failures.append(EnrichFailure(*json.loads(text)))
                yield fragments

    join_fragments(files, read_blocks(), head)
    return files, failures


def write_record(folder: Path, out: Path, settings: EnrichSettings, result: Enriched) -> None:
    """Write the run's record for the enriched files, with what was asked."""
    asked: dict[str, Any] = {"hiproof": __version__, "buildings": result.buildings}
    asked |= {"not_enriched": len(result.failures), **dataclasses.asdict(settings)}
    record = masked_values({**run_record(folder), "enriched": asked})
    save_text(out / "run.json", json.dumps(record, indent=1) + "\n")
