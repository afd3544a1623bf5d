"""The waiting times of a user, in fresh processes, compiled before.

They are `import hiproof`, `hiproof --help`, a town of one building and a whole Delft run.

    python -m benchmarks.startup [--quick]

Each line is the median of several fresh processes: CPU and wall time, and the ratio of the wall
time to starting Python with NumPy in between. The Delft run needs `../shared/data/delft` and is
left out where that is missing.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from hiproof.simulate.city import City, write_city

ROOT = Path(__file__).parents[1]
DELFT = ROOT.parent / "shared" / "data" / "delft"
REFERENCE = ["-c", "import numpy"]


def measure_cost(arguments: list[str]) -> tuple[float, float]:
    """Return CPU and wall seconds of a process and those that it starts."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT / "src"),
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
    }
    # a user's Python compiles its modules once, not in every process
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    start, start_usage = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, *arguments], check=True, env=environment, stdout=subprocess.DEVNULL
    )
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = usage.ru_utime + usage.ru_stime - start_usage.ru_utime - start_usage.ru_stime
    return cpu, time.perf_counter() - start


def compare(name: str, arguments: list[str], runs: int) -> None:
    """Print the median of `runs` fresh processes after one warm-up.

    They run in turn with the reference.
    """
    measure_cost(arguments)
    pairs = [(measure_cost(arguments), measure_cost(REFERENCE)) for _ in range(runs)]
    cpu, wall = (statistics.median(own_cost[k] for own_cost, _ in pairs) for k in (0, 1))
    ratio = statistics.median(own_cost[1] / reference[1] for own_cost, reference in pairs)
    print(
        f"{name:42s} CPU {cpu:6.2f} s, wall {wall:6.2f} s   {ratio:6.1f} times starting Python "
        "with NumPy"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer runs")
    runs = 3 if parser.parse_args().quick else 7
    compare("import hiproof", ["-c", "import hiproof"], runs)
    compare("hiproof --help", ["-m", "hiproof", "--help"], runs)
    with tempfile.TemporaryDirectory() as work:
        list(write_city(Path(work), City(1)))
        files = [
            *map(str, Path(work).glob("tiles/*.laz")),
            "--footprints",
            f"{work}/footprints.gpkg",
        ]
        run = ["-m", "hiproof", "reconstruct", *files, "--out", f"{work}/models", "--restart"]
        compare("a town of one building", run, runs)
    if not DELFT.is_dir():
        print(f"whole Delft run: left out, {DELFT} is missing")
        return
    clouds = [str(path) for path in sorted(DELFT.glob("*.laz"))]
    with tempfile.TemporaryDirectory() as out:
        run = [
            "-m",
            "hiproof",
            "reconstruct",
            *clouds,
            "--footprints",
            str(DELFT / "footprints.gpkg"),
            "--restart",
        ]
        for name, options in (
            ("", []),
            (", no network", ["--network", "never"]),
            (", one primitive a building", ["--parts", "one"]),
        ):
            compare(f"whole Delft run{name}", [*run, "--out", out, *options], 3)


if __name__ == "__main__":
    main()
