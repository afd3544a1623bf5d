"""A simulated city through the whole program; prints one table.

It covers speed, workers, size, memory, kills and damaged input.

usage: python -m benchmarks.city [--work FOLDER] [--buildings 300] [--large N] [--kills N]
[--kill-buildings 40]
                                 [--large-flat N] [--delft ../shared/data/delft]

Cities are made once in the folder and used again. Rates are buildings a CPU second of one core,
everything from reading to the written files included, in a process that has run once before
(imports and compiled code loaded); wall times stand beside them, and tell little on a machine that
has other work. `--large` adds the run whose cost a building is compared with the small one's,
`--kills` random kill -9 of the main process and its workers.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pyogrio
import shapely

from hiproof import read_parameters
from hiproof.city.run import Request, reconstruct_area
from hiproof.compose import check_solid
from hiproof.read import read_footprints, read_header
from hiproof.read.solids import read_solids
from hiproof.settings import Settings
from hiproof.simulate import demo_files
from hiproof.simulate.city import City, write_city

DEFAULTS = Settings()
FLAT = Settings.from_dict(
    {"fit": {"parts": "one", "types": ["flat"]}, "segment": {"network": "never"}}
)
RECORDS = ("buildings.gml", "buildings.city.jsonl", "parameters.jsonl")


@dataclass(frozen=True)
class Cost:
    """The cost of one run.

    It is CPU seconds of the main process and of its workers, wall seconds, and peak memory of any
    process in MB.
    """

    buildings: int
    main_s: float
    workers_s: float
    wall_s: float
    peak_mb: float

    @property
    def cpu_s(self) -> float:
        return self.main_s + self.workers_s

    def format_cost(self) -> str:
        return (
            f"{self.buildings / self.cpu_s:.1f} buildings/CPU s, "
            f"{1000 * self.cpu_s / self.buildings:.1f} ms a building "
            f"(main {self.main_s:.1f} s, workers {self.workers_s:.1f} s, wall {self.wall_s:.1f} s, "
            f"{self.peak_mb:.0f} MB)"
        )


def make_city(work: Path, buildings: int) -> tuple[list[str], str]:
    """Return clouds and footprints of a simulated city.

    They are made where they do not exist yet.
    """
    folder = work / f"city{buildings}"
    if not (folder / "complete").exists():
        shutil.rmtree(folder, ignore_errors=True)
        for tile in write_city(folder, City(buildings)):
            print(
                f"  simulated {tile.tile}: {tile.buildings} buildings, {tile.points} points",
                flush=True,
            )
        (folder / "complete").touch()
    return sorted(str(path) for path in (folder / "tiles").glob("*.laz")), str(
        folder / "footprints.gpkg"
    )


def measure_run(
    clouds: list[str], footprints: str, out: Path, jobs: int = 1, settings: Settings = DEFAULTS
) -> Cost:
    """Measure a run in a fresh process.

    It has done the demo's neighbourhood before.
    """
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(run_warm, clouds, footprints, out, jobs, settings).result()


def run_warm(clouds: list[str], footprints: str, out: Path, jobs: int, settings: Settings) -> Cost:
    demo = demo_files()
    warm_up = out.with_name("warm-up")
    reconstruct_area(
        Request(
            (str(demo["cloud"]),), warm_up, str(demo["footprints"]), settings=settings, restart=True
        )
    )
    cpu_start, started = measure_cpu(), time.perf_counter()
    summary = reconstruct_area(
        Request(tuple(clouds), out, footprints, settings=settings, processes=jobs, restart=True)
    )
    wall = time.perf_counter() - started
    cpu_end = measure_cpu()
    peak = (
        max(
            resource.getrusage(target).ru_maxrss
            for target in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
        )
        / 1024
    )
    return Cost(summary.buildings, cpu_end[0] - cpu_start[0], cpu_end[1] - cpu_start[1], wall, peak)


def measure_cpu() -> tuple[float, float]:
    """Return CPU seconds of this process and of its ended children."""
    usages = (
        resource.getrusage(process) for process in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return tuple(usage.ru_utime + usage.ru_stime for usage in usages)


def describe_outcomes(out: Path, n_requested: int) -> str:
    """Describe how many solids are valid, and how many buildings are lost.

    A lost building has no outcome.
    """
    rows = read_parameters(out / "parameters.jsonl")
    solids = [solid for _, solid in read_solids(out / "buildings.city.jsonl")]
    valid = sum(not check_solid(solid, planarity_m=0.01) for solid in solids)
    statuses = ", ".join(
        f"{sum(r['status'] == s for r in rows)} {s}" for s in sorted({r["status"] for r in rows})
    )
    lost = n_requested - len(rows)
    return f"{valid} of {len(solids)} solids valid; {lost} without outcome; {statuses}"


def run_with_kills(
    clouds: list[str], footprints: str, out: Path, whole: Path, kills: int, seed: int = 1
) -> str:
    """Run with two workers, killed at random moments and started again.

    Each run ends, and is compared with `whole`.
    """
    draw, n_kills, of_main, runs, different = random.Random(seed), 0, 0, 0, 0
    command = [
        sys.executable,
        "-m",
        "hiproof",
        "reconstruct",
        *clouds,
        "--footprints",
        footprints,
        "--out",
        str(out),
    ]
    while n_kills < kills:
        shutil.rmtree(out, ignore_errors=True)
        ended = False
        while not ended:
            main = subprocess.Popen(
                [*command, "--jobs", "2"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
            )
            while n_kills < kills and main.poll() is None:
                time.sleep(draw.uniform(0.3, 5.0))
                victim = draw.choice([main.pid, *list_workers(main.pid)])
                if main.poll() is None:
                    os.kill(victim, signal.SIGKILL)
                    n_kills, of_main = n_kills + 1, of_main + (victim == main.pid)
            ended = main.wait() >= 0
        runs += 1
        different += any(
            (out / name).read_bytes() != (whole / name).read_bytes() for name in RECORDS
        )
    return (
        f"{n_kills} kills ({of_main} of the main process) over {runs} runs, all gone on to the "
        f"end; {different} differ in a byte"
    )


def list_workers(pid: int) -> list[int]:
    """List the worker processes of a main process, from the process table."""
    workers = []
    for child in list_children(pid):
        with suppress(OSError):
            command = Path(f"/proc/{child}/cmdline").read_bytes()
            workers += [child] if b"spawn_main" in command else []
    return workers


def list_children(pid: int) -> list[int]:
    """List the processes that a process has started."""
    try:
        text = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8")
    except OSError:
        return []
    return list(map(int, text.split()))


def run_on_damage(clouds: list[str], footprints: str, work: Path, whole: Path) -> str:
    """Run on damaged input, and compare the rest.

    One tile is cut off, 1 % of the polygons cross themselves, and 1 % more lie away from all
    points.
    """
    folder, out = work / "damaged", work / "out-damaged"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    bad = Path(clouds[-1])
    cut = folder / bad.name
    cut.write_bytes(bad.read_bytes()[: bad.stat().st_size // 2])
    xmin, ymin, _, xmax, ymax, _ = read_header(bad).bounds
    lost = shapely.box(xmin - 15, ymin - 15, xmax + 15, ymax + 15)
    footprints_read = read_footprints(footprints)
    broken = set(range(0, len(footprints_read), 100))
    shapes = [
        cross_corners(f.polygon) if i in broken else f.polygon
        for i, f in enumerate(footprints_read)
    ]
    empty = [
        shapely.box(xmax + 1e4 + 20 * i, ymax, xmax + 1e4 + 20 * i + 10, ymax + 10)
        for i in range(len(broken))
    ]
    ids = [f.id for f in footprints_read] + [f"empty-{i}" for i in range(len(empty))]
    layer = folder / "footprints.gpkg"
    meta = pyogrio.read_info(footprints)
    pyogrio.raw.write(
        layer, shapely.to_wkb(np.array([*shapes, *empty], object)), [np.array(ids, object)], ["id"],
        geometry_type="Polygon", crs=meta["crs"], driver="GPKG",
    )  # fmt: skip
    summary = reconstruct_area(Request((*clouds[:-1], str(cut)), out, str(layer), restart=True))
    rows, old_rows = ({r["id"]: r for r in read_rows(folder)} for folder in (out, whole))
    unharmed = [
        f.id
        for i, f in enumerate(footprints_read)
        if i not in broken and not lost.intersects(f.polygon)
    ]
    different = sum(rows.get(id) != old_rows[id] for id in unharmed)
    broken_names = [Path(name).name for name, _ in summary.broken_inputs]
    return (
        f"exit code {summary.exit_code}, named {broken_names}; {len(unharmed)} buildings away from "
        f"the damage, {different} of them changed; "
        f"{len(empty)} planted without points, {summary.by_status.get('no_points', 0)} "
        "found (with those of the lost tile)"
    )


def cross_corners(polygon: shapely.Polygon) -> shapely.Polygon:
    """Exchange two neighbouring corners, so that the border crosses itself."""
    xy = shapely.get_coordinates(polygon.exterior)[:-1]
    xy[[1, 2]] = xy[[2, 1]]
    return shapely.Polygon(xy)


def read_rows(out: Path) -> list[dict]:
    return read_parameters(out / "parameters.jsonl")


def show(name: str, text: str) -> None:
    print(f"| {name} | {text} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--work", type=Path, default=Path("/tmp/hiproof-city"), help="folder for cities and results"
    )
    parser.add_argument("--buildings", type=int, default=300)
    parser.add_argument("--large", type=int, default=0, help="buildings of the large city, 0: none")
    parser.add_argument(
        "--large-flat", type=int, default=0, help="buildings of a city run without fitting, 0: none"
    )
    parser.add_argument("--kills", type=int, default=0, help="how many random kills")
    parser.add_argument("--kill-buildings", type=int, default=40)
    parser.add_argument("--delft", type=Path, default=Path("../shared/data/delft"))
    parser.add_argument("--quick", action="store_true", help="a city of 100 buildings")
    args = parser.parse_args()
    args.buildings = 100 if args.quick else args.buildings
    args.work.mkdir(parents=True, exist_ok=True)
    print("| measure | got |\n| --- | --- |", flush=True)
    if args.delft.is_dir():
        delft = sorted(map(str, args.delft.glob("*.laz"))), str(args.delft / "footprints.gpkg")
        show("Delft, one process", measure_run(*delft, args.work / "out-delft").format_cost())
    clouds, footprints = make_city(args.work, args.buildings)
    out = args.work / "out-one"
    one_process = measure_run(clouds, footprints, out)
    show("simulated city, one process", one_process.format_cost())
    show("outcomes", describe_outcomes(out, len(read_footprints(footprints))))
    two_processes = measure_run(clouds, footprints, args.work / "out-two", jobs=2)
    show("the same, two workers", two_processes.format_cost())
    is_same = all(
        (out / name).read_bytes() == (args.work / "out-two" / name).read_bytes() for name in RECORDS
    )
    bound = one_process.cpu_s / (two_processes.main_s + two_processes.workers_s / 2)
    show(
        "two workers against one",
        f"wall {one_process.wall_s / two_processes.wall_s:.2f}, by CPU time {bound:.2f}; "
        f"same bytes: {is_same}",
    )
    show("damaged input", run_on_damage(clouds, footprints, args.work, out))
    if args.large:
        large = measure_run(*make_city(args.work, args.large), args.work / "out-large")
        ratio = large.cpu_s / large.buildings / (one_process.cpu_s / one_process.buildings)
        show(
            f"{args.large} buildings",
            f"{large.format_cost()}; cost a building against {args.buildings}: {ratio:.2f}",
        )
    for buildings in filter(None, (args.buildings, args.large_flat)):
        flat = measure_run(*make_city(args.work, buildings), args.work / "out-flat", settings=FLAT)
        show(f"{buildings} buildings, all but fitting and recognising", flat.format_cost())
    if args.kills:
        files = make_city(args.work, args.kill_buildings)
        whole = args.work / "out-whole"
        reconstruct_area(Request(tuple(files[0]), whole, files[1], restart=True))
        show("random kills", run_with_kills(*files, args.work / "out-killed", whole, args.kills))


if __name__ == "__main__":
    main()
