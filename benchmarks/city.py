"""Speed, workers, size and memory of runs over a simulated city.

usage: python -m benchmarks.city [--work FOLDER] [--count 300] [--large N]

Cities are made once in the folder and used again. Rates are buildings a CPU second of one core,
everything from reading to the written files included, in a process that has run once before
(imports and compiled code loaded); wall times tell little on a machine that has other work.
`--large` adds a larger city.
"""

from __future__ import annotations

import resource
import shutil
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from hiproof.city.run import Request, reconstruct_area
from hiproof.settings import Settings
from hiproof.simulate import demo_files
from hiproof.simulate.city import City, write_city

from .tables import FigureTable, make_parser

DEFAULTS = Settings()
FLAT = Settings.from_dict(
    {"fit": {"parts": "one", "types": ["flat"]}, "segment": {"network": "never"}}
)
RECORDS = ("buildings.gml", "buildings.city.jsonl", "parameters.jsonl")


@dataclass(frozen=True)
class Cost:
    """CPU and wall seconds of one run, and the peak memory of any of its processes."""

    buildings: int
    cpu_s: float
    wall_s: float
    peak_mb: float

    def list_cells(self) -> list[str]:
        """Return rate, time a building, wall time and memory as text."""
        rate, ms = self.buildings / self.cpu_s, 1000 * self.cpu_s / self.buildings
        return [f"{rate:.1f}", f"{ms:.1f}", f"{self.wall_s:.1f}", f"{self.peak_mb:.0f}"]


def make_city(work: Path, buildings: int) -> tuple[list[str], str]:
    """Return clouds and footprints of a simulated city, made where they do not exist yet."""
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
    """Measure a run in a fresh process. It has done the demo's neighbourhood before."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(run_warm, clouds, footprints, out, jobs, settings).result()


def run_warm(clouds: list[str], footprints: str, out: Path, jobs: int, settings: Settings) -> Cost:
    demo = demo_files()
    warm_up = out.with_name("warm-up")
    ask = partial(Request, settings=settings, restart=True)
    reconstruct_area(ask((str(demo["cloud"]),), warm_up, str(demo["footprints"])))
    cpu_start, started = measure_cpu(), time.perf_counter()
    summary = reconstruct_area(ask(tuple(clouds), out, footprints, processes=jobs))
    wall, cpu = time.perf_counter() - started, measure_cpu() - cpu_start
    return Cost(summary.buildings, cpu, wall, max(usage.ru_maxrss for usage in get_usages()) / 1024)


def get_usages() -> list[resource.struct_rusage]:
    """Return what this process and its ended children used."""
    return [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]


def measure_cpu() -> float:
    """Return CPU seconds of this process and of its ended children."""
    return sum(usage.ru_utime + usage.ru_stime for usage in get_usages())


def main() -> None:
    parser = make_parser(__doc__, count=300)
    parser.add_argument("--work", type=Path, default=Path("/tmp/hiproof-city"), help="folder")
    parser.add_argument("--large", type=int, default=0, help="buildings of the large city, 0: none")
    a = parser.parse_args()
    a.work.mkdir(parents=True, exist_ok=True)
    small = make_city(a.work, a.count)
    columns = ("run", "buildings a CPU s", "ms a building", "wall, s", "MB", "same bytes")
    with FigureTable(a.record, *columns) as table:
        one, two = a.work / "out-one", a.work / "out-two"
        table.add("one process", *measure_run(*small, one).list_cells(), "")
        cells = measure_run(*small, two, jobs=2).list_cells()
        same = [(one / name).read_bytes() == (two / name).read_bytes() for name in RECORDS]
        table.add("two workers", *cells, "yes" if all(same) else "no")
        flat = measure_run(*small, a.work / "out-flat", settings=FLAT)
        table.add("all but fitting and recognising", *flat.list_cells(), "")
        if a.large:
            large = measure_run(*make_city(a.work, a.large), a.work / "out-large")
            table.add(f"{a.large} buildings", *large.list_cells(), "")


if __name__ == "__main__":
    main()
