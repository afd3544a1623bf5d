"""Runs built again from their own parameters, and with overrides.

The parameters are the model.

usage: python -m benchmarks.rebuild [--work FOLDER] [--buildings 1000] [--flat] [--lines 1000000]
                                    [--data ../shared/data] [--only NAME ...]

Prints whether `hiproof build` gives the run's own bytes in every file, and how many buildings it
refuses: for the demo, for every cloud of the data folder, with its footprints and without, whole
and thinned to 1/2, 1/4 and 1/8, for real roofs without ground, for six towns scanned by simulation
and for a simulated city. Then how many buildings the city redoes for 50 overrides, how long that
takes, whether all others keep their bytes, and how long a file of a million overrides takes to be
read. `--only` takes the beginnings of names, such as "two_epochs". With --flat the city's roofs are
flat blocks, which are fitted in no time: what a run redoes costs the same, so that a large city can
be tried.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

from hiproof.city.plan.overrides import read_overrides
from hiproof.city.run import Request, reconstruct_area
from hiproof.city.work import solve
from hiproof.parametric.file import read_parameters
from hiproof.parametric.run import build_file
from hiproof.settings import Settings
from hiproof.simulate import demo_files

from .campaign import find_refused, list_real_runs, list_roof_runs
from .city import make_city

FILES = ("buildings.gml", "buildings.city.jsonl", "parameters.jsonl", "buildings.gpkg")
OVERRIDES = 50
FLAT = Settings.from_dict(
    {"fit": {"types": ["flat"], "parts": "one"}, "segment": {"network": "never"}}
)


def list_requests(
    work: Path, data: Path, buildings: int, settings: Settings
) -> Iterator[tuple[str, Callable[[], Request]]]:
    """Yield what is run, by name.

    Its input is made when called; real data come only where they exist.
    """
    demo = {name: str(path) for name, path in demo_files().items()}
    yield (
        "demo",
        lambda: Request((demo["cloud"],), work / "demo", demo["footprints"], demo["terrain"]),
    )
    yield from list_real_runs(data, work)
    yield from list_roof_runs(data, work)

    def city() -> Request:
        clouds, footprints = make_city(work, buildings)
        return Request(tuple(clouds), work / "city", footprints, settings=settings)

    yield f"city of {buildings}", city


def rebuild_run(name: str, request: Request) -> str:
    """Run, build again, compare byte by byte."""
    reconstruct_area(request)
    second_folder = request.out.with_name(f"{request.out.name}-again")
    built = build_file(request.out / "parameters.jsonl", second_folder)
    other = [
        file
        for file in FILES
        if (second_folder / file).read_bytes() != (request.out / file).read_bytes()
    ]
    refused = len(find_refused(second_folder / "parameters.jsonl"))
    verdict = f"DIFFERENT: {', '.join(other)}" if other else "byte-identical"
    return f"{name}: {built.buildings} buildings, {refused} refused, {verdict}"


def run_with_overrides(request: Request, work: Path) -> str:
    """Run the city again with overrides of every so-many-th building."""
    old_rows = {row["id"]: row for row in read_parameters(request.out / "parameters.jsonl")}
    ids = list(old_rows)[:: max(1, len(old_rows) // OVERRIDES)][:OVERRIDES]
    path = work / "known.jsonl"
    path.write_text("".join(json.dumps({"id": id, "block_height": 7.5}) + "\n" for id in ids))
    solved, solve_one = [], solve.solve_one

    def counting(plan, job, *rest):
        solved.append(job.id)
        return solve_one(plan, job, *rest)

    start, cpu = time.perf_counter(), time.process_time()
    with patch.object(solve, "solve_one", counting):
        reconstruct_area(replace(request, overrides=str(path)))
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    new_rows = {row["id"]: row for row in read_parameters(request.out / "parameters.jsonl")}
    n_same = sum(new_rows[id] == old_rows[id] for id in old_rows if id not in ids)
    obeyed = sum("overridden: block_height" in new_rows[id]["detail"] for id in ids)
    return (
        f"{len(ids)} overrides: {len(solved)} buildings solved in a run of {seconds:.1f} s "
        f"({cpu:.1f} s of CPU), {obeyed} obeyed, "
        f"{n_same} of {len(old_rows) - len(ids)} others unchanged"
    )


def read_many_lines(work: Path, lines: int) -> str:
    """Read and check a file of so many overrides."""
    path = work / "many.jsonl"
    with path.open("w") as file:
        file.writelines(
            f'{{"id": "building-{k}", "ridge_height": {8.0 + k % 7}}}\n' for k in range(lines)
        )
    start, cpu = time.perf_counter(), time.process_time()
    n_read = sum(1 for _ in read_overrides(str(path)))
    took, cpu = time.perf_counter() - start, time.process_time() - cpu
    return (
        f"{n_read} lines of overrides, {path.stat().st_size / 1e6:.0f} MB: read in {took:.1f} s "
        f"({cpu:.1f} s of CPU)"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--work", type=Path)
    parser.add_argument("--buildings", type=int, default=1000)
    parser.add_argument("--flat", action="store_true", help="flat blocks alone in the city")
    parser.add_argument("--lines", type=int, default=1_000_000)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument(
        "--only",
        nargs="*",
        help="beginnings of names, such as demo, delft, city, lines [default: all]",
    )
    requested = parser.parse_args()
    work = requested.work or Path(tempfile.mkdtemp(prefix="hiproof-rebuild-"))
    work.mkdir(parents=True, exist_ok=True)
    expected = tuple(requested.only or [""])
    settings = FLAT if requested.flat else Settings()
    for name, make in list_requests(work, requested.data, requested.buildings, settings):
        if name.startswith(expected):
            request = make()
            start, cpu = time.perf_counter(), time.process_time()
            message = rebuild_run(name, request)
            print(
                f"{message} ({time.perf_counter() - start:.0f} s, "
                f"{time.process_time() - cpu:.0f} s of CPU)",
                flush=True,
            )
            if name.startswith("city"):
                print(run_with_overrides(request, work), flush=True)
    if "lines".startswith(expected):
        print(read_many_lines(work, requested.lines), flush=True)


if __name__ == "__main__":
    main()
