"""What a user waits for: `import hiproof`, `hiproof --help`, and a whole Delft run in a fresh process, compiled before.

    python -m benchmarks.startup [--quick]

Each line is the median wall time of several fresh processes, and its ratio to starting Python with NumPy in between. The
Delft run needs `../shared/data/delft` and is left out where that is missing.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
DELFT = ROOT.parent / "shared" / "data" / "delft"
REFERENCE = ["-c", "import numpy"]


def wall(arguments: list[str]) -> float:
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    start = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, env=environment, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


def compare(name: str, arguments: list[str], runs: int) -> None:
    """Print the median of `runs` fresh processes after one warm-up, in turn with the reference."""
    wall(arguments)
    pairs = [(wall(arguments), wall(REFERENCE)) for _ in range(runs)]
    mine = statistics.median(a for a, _ in pairs)
    ratio = statistics.median(a / b for a, b in pairs)
    print(f"{name:42s} {mine:7.2f} s   {ratio:6.1f} times starting Python with NumPy")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer runs")
    runs = 3 if parser.parse_args().quick else 7
    compare("import hiproof", ["-c", "import hiproof"], runs)
    compare("hiproof --help", ["-m", "hiproof", "--help"], runs)
    if not DELFT.is_dir():
        print(f"whole Delft run: left out, {DELFT} is missing")
        return
    clouds = [str(path) for path in sorted(DELFT.glob("*.laz"))]
    with tempfile.TemporaryDirectory() as out:
        run = ["-m", "hiproof", "reconstruct", *clouds, "--footprints", str(DELFT / "footprints.gpkg"), "--restart"]
        for name, options in (
            ("", []),
            (", no network", ["--no-network"]),
            (", one primitive a building", ["--parts", "one"]),
        ):
            compare(f"whole Delft run{name}", [*run, "--out", out, *options], 3)


if __name__ == "__main__":
    main()
