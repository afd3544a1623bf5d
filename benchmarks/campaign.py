"""Internal errors, invalid solids and records that do not rebuild.

usage: python -m benchmarks.campaign [--count 20000] [--first-seed 0] [--processes 1]
                                     [--only simulated real roofs] [--work FOLDER]
                                     [--data ../shared/data]

`--count` simulated buildings are reconstructed in scenes of 100 (campaign_scenes.py), scene after
scene from the seed `--first-seed` on: all roof types, compounds and city blocks, with and without
footprints, 0.5 to 30 points/m2, with clutter, holes, and damaged footprints. Then follow every
cloud of the data folder, with and without its footprints, whole and thinned to 1/2, 1/4 and 1/8;
real roofs without ground; and towns of known solids, scanned at 2 and 8 points/m2.

Each is a whole run through files. The counts are

    internal error     with its traceback; `--count 100 --first-seed SEED` repeats a scene, and
                       `hiproof repro` a building of FOLDER/failures/seed-SEED
    invalid solid      by our check after `hiproof.build`, and by `hiproof check` of the files
    not rebuilt alike  `hiproof build` refuses a record, or gives other bytes in any file
    run that ended     with an exception, before it wrote its files
    flat fall-backs    buildings with the status flat_fallback or simplified

The exit code is 0 if the first four are none.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import shutil
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from unittest.mock import patch

import laspy
import numpy as np

from hiproof.city.run import Request, reconstruct_area
from hiproof.city.work import solve
from hiproof.cli.check import check_file, count_bad
from hiproof.compose import check_solid
from hiproof.parametric.building import build
from hiproof.parametric.file import opened_parameters, read_parameters
from hiproof.parametric.run import build_file
from hiproof.settings import Settings
from hiproof.status import Status

from .campaign_scenes import BUILDINGS_A_SCENE, write_cloud, write_scene
from .judging import SHARED
from .tables import FigureTable, make_parser
from .towns import TOWNS, read_town

SHARES = (1.0, 0.5, 0.25, 0.125)  # Shares of the points of real clouds.
TOWN_DENSITIES = (2.0, 8.0)  # points/m2
CORNER = np.array([100000.0, 450000.0, 10.0])  # of roofs that are laid out
MOST_TOLD = 5  # Tracebacks and other findings printed a run.


@dataclass
class Findings:
    """What came of one or several runs: counts by kind, and a text for each finding."""

    counts: Counter[str] = field(default_factory=Counter)
    texts: list[str] = field(default_factory=list)

    def add(self, kind: str, text: str) -> None:
        self.counts[kind] += 1
        self.texts.append(f"{kind}: {text}")

    @property
    def is_clean(self) -> bool:
        """Whether all counts are zero that must be."""
        return not any(self.counts[kind] for kind in MUST_BE_NONE)


INTERNAL = "internal error"
INVALID = "invalid solid"
INVALID_WRITTEN = "invalid solid in a written file"
NOT_ALIKE, ENDED = "not rebuilt alike", "run that ended"
CHECKED = "solids in files"
MUST_BE_NONE = (INTERNAL, INVALID, INVALID_WRITTEN, NOT_ALIKE, ENDED)
FLAT = (Status.FLAT_FALLBACK.code, Status.SIMPLIFIED.code)
COUNTED = ("buildings", CHECKED, *MUST_BE_NONE, *FLAT)


def judge_run(name: str, request: Request) -> Findings:
    """Run `request`, rebuild its parameters and count what is wrong."""
    findings = Findings()
    shutil.rmtree(request.out, ignore_errors=True)
    try:
        with warnings.catch_warnings(), collect_tracebacks() as errors:
            warnings.simplefilter("ignore")
            summary = reconstruct_area(request)
    except Exception:
        findings.add(ENDED, f"{name}\n{traceback.format_exc()}")
        return findings
    for id, text in errors.items():
        findings.add(INTERNAL, f"{name}, building {id}\n{text}")
    findings.counts.update({"buildings": summary.buildings, **summary.by_status})
    missed = summary.by_status.get(Status.INTERNAL_ERROR.code, 0) - len(errors)
    if missed:
        findings.counts[INTERNAL] += missed
    try:
        judge_files(name, request.out, findings)
    except Exception:
        findings.add(NOT_ALIKE, f"{name}: the run's own file is refused\n{traceback.format_exc()}")
    return findings


@contextlib.contextmanager
def collect_tracebacks() -> Iterator[dict[str, str]]:
    """Collect the tracebacks of internal errors inside the block, by building."""
    record, errors = solve.record_failure, {}

    def record_failure(plan, job, detail):
        errors[job.id] = job.error.trace if job.error else traceback.format_exc()
        return record(plan, job, detail)

    with patch.object(solve, "record_failure", record_failure):
        yield errors


def judge_files(name: str, out: Path, findings: Findings) -> None:
    """Count invalid solids and buildings whose parameters give other bytes."""
    second_folder = out.with_name(f"{out.name}-again")
    shutil.rmtree(second_folder, ignore_errors=True)
    build_file(out / "parameters.jsonl", second_folder)
    for id in find_refused(second_folder / "parameters.jsonl"):
        findings.add(NOT_ALIKE, f"{name}, building {id}: its own record is refused")
    for file in ("parameters.jsonl", "buildings.city.jsonl"):
        for id in compare_lines(out / file, second_folder / file):
            findings.add(NOT_ALIKE, f"{name}, building {id}: {file} differs")
    for path in sorted([*out.glob("buildings*.gml"), out / "buildings.gpkg"]):
        if path.read_bytes() != (second_folder / path.name).read_bytes():
            findings.add(NOT_ALIKE, f"{name}: {path.name} differs")
    with opened_parameters(out / "parameters.jsonl") as (head, records):
        for record in records:
            judge_solid(name, record, head.compose, findings)
    for path in (*sorted(out.glob("buildings*.gml")), out / "buildings.city.jsonl"):
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            invalid = count_bad([check_file(path, planarity_m=0.01)])
        findings.counts[CHECKED] += int(re.findall(r": (\d+) solids?,", printed.getvalue())[-1])
        if invalid:
            findings.counts[INVALID_WRITTEN] += invalid - 1
            findings.add(INVALID_WRITTEN, f"{name}\n{printed.getvalue()}")
    shutil.rmtree(second_folder)


def find_refused(path: Path) -> list[str]:
    """List the ids of buildings that `hiproof build` refused."""
    return [row["id"] for row in read_parameters(path) if row["status"] == Status.NOT_BUILT.code]


def judge_solid(name: str, record: dict, compose, result: Findings) -> None:
    """Build one record and check its solid."""
    if not record["parts"]:
        return
    try:
        building = build(record, compose)
    except Exception as error:
        result.add(NOT_ALIKE, f"{name}, building {record['id']}: {error}")
        return
    findings = check_solid(building.solid, planarity_m=compose.planarity_m)
    if findings:
        result.add(INVALID, f"{name}, building {record['id']}: {findings[0].message}")


def compare_lines(first_path: Path, other: Path) -> list[str]:
    """List the ids of buildings whose lines differ between two files."""
    differing = []
    with first_path.open(encoding="utf-8") as first, other.open(encoding="utf-8") as second:
        for number, (line, second_line) in enumerate(zip(first, second, strict=True)):
            if line != second_line:
                differing.append(str(json.loads(line).get("id", f"on line {number + 1}")))
    return differing


def judge_scene(task: tuple[int, int, Path]) -> Findings:
    """Write and judge the first `count` buildings of the scene `seed`."""
    seed, count, work = task
    folder = work / f"scene-{seed}"
    try:
        findings = judge_run(f"seed {seed}", write_scene(seed, count, folder))
        failures = folder / "run" / "failures"
        if failures.exists():  # `hiproof repro` runs them again
            shutil.copytree(failures, work / "failures" / f"seed-{seed}", dirs_exist_ok=True)
        return findings
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def judge_real(task: tuple[str, Callable[[], Request]]) -> Findings:
    """Judge one run over real data."""
    name, make = task
    return judge_run(name, make())


def list_real_runs(data: Path, work: Path) -> Iterator[tuple[str, Callable[[], Request]]]:
    """Yield runs over every cloud of the data folder; files are thinned when called."""
    french = Settings.from_dict({"read": {"building_classes": [6, 67]}})
    unnamed = Settings.from_dict({"read": {"crs": "EPSG:5490"}})
    sets = (
        ("delft", "delft/footprints.gpkg", Settings()),
        ("amsterdam_west", "amsterdam_west/footprints_bag.gpkg", Settings()),
        ("two_epochs/2010", "two_epochs/footprints.gpkg", Settings()),
        ("two_epochs/2014", "two_epochs/footprints.gpkg", Settings()),
        ("ctview", None, french),
        ("stbarth", None, unnamed),
    )
    for folder, footprints, settings in sets:
        for share in SHARES if any((data / folder).glob("*.laz")) else ():
            for outlines in dict.fromkeys([footprints and str(data / footprints), None]):
                suffix = "with" if outlines else "without"
                name = f"{folder}, {share:g} of the points, {suffix} footprints"
                given = (data / folder, share, outlines, settings, work / folder)
                yield name, partial(request_thinned_run, *given)


def request_thinned_run(
    folder: Path, share: float, footprints: str | None, settings: Settings, work: Path
) -> Request:
    """Return the run over a share of the points of all files in `folder`."""
    thinned = work / "thinned"
    clouds = [str(thin_file(path, share, thinned)) for path in sorted(folder.glob("*.laz"))]
    out = work / f"{share:g}-{'with' if footprints else 'without'}-footprints"
    return Request(tuple(clouds), out, footprints, settings=settings, restart=True)


def thin_file(path: Path, share: float, folder: Path) -> Path:
    """Copy a random share of the points of a file; return the path of the copy."""
    if share == 1.0:
        return path
    thinned = folder / f"{share:g}" / path.name
    thinned.parent.mkdir(parents=True, exist_ok=True)
    cloud = laspy.read(path)
    cloud.points = cloud.points[np.random.default_rng(0).random(len(cloud.points)) < share]
    cloud.write(thinned)
    return thinned


def list_roof_runs(data: Path, work: Path) -> Iterator[tuple[str, Callable[[], Request]]]:
    """Yield runs over real roofs and scanned towns without ground, made when called."""
    if (data / "roofn3d").exists() or (data / "hand_drawn").exists():
        yield "real roofs", partial(request_roofs_run, data, work / "real-roofs")
    for town, path in TOWNS.items():
        for density in TOWN_DENSITIES if path.exists() else ():
            make = partial(request_town_run, path, density, work / f"{town}-{density:g}")
            yield f"{town} at {density:g} points/m2", make


def request_roofs_run(data: Path, folder: Path) -> Request:
    """Return the run over all real roofs."""
    return lay_out(read_roofs(data), folder)


def request_town_run(path: Path, density: float, folder: Path) -> Request:
    """Return the run over all buildings of a town. It is scanned at `density` (points/m2)."""
    return lay_out([building.scan_points(density) for building in read_town(path)], folder)


def read_roofs(data: Path) -> list[np.ndarray]:
    """Read the points (n, 3) of each roof of RoofN3D and of the hand-drawn wireframes."""
    roofs = []
    if (data / "roofn3d/nyc_roofs.npz").exists():
        with np.load(data / "roofn3d/nyc_roofs.npz") as file:
            roofs += np.split(file["points"].astype(float), file["offset"][1:-1])
    if (data / "hand_drawn/points.npz").exists():
        with np.load(data / "hand_drawn/points.npz") as file:
            roofs += [file[name].astype(float) for name in file.files]
    return [roof for roof in roofs if roof.ndim == 2 and roof.shape[1] == 3]


def lay_out(clouds: list[np.ndarray], folder: Path) -> Request:
    """Write clouds (n, 3) side by side as building points; return the run over them."""
    folder.mkdir(parents=True, exist_ok=True)
    extent = max(float(np.ptp(cloud[:, :2], axis=0).max()) for cloud in clouds) + 30.0
    columns = int(np.ceil(np.sqrt(len(clouds))))
    moved = []
    for number, cloud in enumerate(clouds):
        place = CORNER + [*np.multiply(divmod(number, columns), extent), 0.0]
        moved.append(cloud - cloud.min(axis=0) + place)
    points = np.concatenate(moved)
    write_cloud(folder / "cloud.laz", points, np.full(len(points), 6, np.uint8))
    return Request((str(folder / "cloud.laz"),), folder / "run", restart=True)


def main() -> int:
    parser = make_parser(__doc__, count=20000, first_seed=0, processes=1)
    kinds = ("simulated", "real", "roofs")
    parser.add_argument("--only", nargs="*", choices=kinds, default=kinds, help="[default: all]")
    parser.add_argument("--work", type=Path)
    parser.add_argument("--data", type=Path, default=SHARED / "data")
    a = parser.parse_args()
    work = a.work or Path(tempfile.mkdtemp(prefix="hiproof-campaign-"))
    full, remainder = divmod(a.count, BUILDINGS_A_SCENE)
    sizes = [BUILDINGS_A_SCENE] * full + [remainder] * (remainder > 0)
    tasks = {
        "simulated": (judge_scene, [(a.first_seed + k, n, work) for k, n in enumerate(sizes)]),
        "real": (judge_real, list_real_runs(a.data, work)),
        "roofs": (judge_real, list_roof_runs(a.data, work)),
    }
    is_clean = True
    with (
        ProcessPoolExecutor(a.processes, mp_context=get_context("spawn")) as pool,
        FigureTable(a.record, "data", *COUNTED) as table,
    ):
        for name in a.only:
            judge, inputs = tasks[name]
            findings = print_findings(pool.map(judge, inputs))
            table.add(name, *(findings.counts[kind] for kind in COUNTED))
            is_clean &= findings.is_clean
    return 0 if is_clean else 1


def print_findings(all_findings: Iterable[Findings]) -> Findings:
    """Print findings as they come; return all of their counts."""
    total = Findings()
    for findings in all_findings:
        for text in findings.texts[:MOST_TOLD]:
            print(text, flush=True)
        total.counts.update(findings.counts)
    return total


if __name__ == "__main__":
    sys.exit(main())
