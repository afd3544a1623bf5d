"""Cost of a whole process over Delft, in seconds and in decodings of its two LAZ files.

usage: python -m benchmarks.peer [--runs 3] [--data ../shared/data/delft]

Seconds do not travel between machines; decoding the same files (laspy, lazrs), measured between the
runs, does. Each line is the median of fresh processes, everything from reading to the written files
included, compiled before; "steady" is the second run in one process. Roofer's figures are not
measured here: version 1.1 on the same files, its whole process, against the same decoding on the
machine where both were measured.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from .judging import DELFT, list_files
from .tables import FigureTable, make_parser

ROOT = Path(__file__).parents[1]
ROOFER = {"cpu_s": 3.4, "peak_mb": 92.0, "decode_s": 0.30}
USED = """
import json, resource, time
def used():
    own = resource.getrusage(resource.RUSAGE_SELF)
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = own.ru_utime + own.ru_stime + ended.ru_utime + ended.ru_stime
    return [cpu, time.perf_counter(), own.ru_maxrss / 1024]
def tell(before):
    cpu, wall, peak = used()
    print(json.dumps([cpu - before[0], wall - before[1], peak]))
import sys
clouds, footprints, out = json.loads(sys.argv[1])
"""
DECODE = """
import laspy
def decode():
    for cloud in clouds:
        laspy.read(cloud)
decode()
before = used()
decode()
tell(before)
"""
WHOLE = """
from pathlib import Path
from hiproof.city.run import Request, reconstruct_area
def run():
    reconstruct_area(Request(tuple(clouds), Path(out), footprints, restart=True))
start = [0.0, time.perf_counter()]
run()
"""
ONCE = WHOLE + "tell(start)"
STEADY = WHOLE + "start = used(); run(); tell(start)"


def measure_process(script: str, inputs: tuple[list[str], str, str]) -> list[float]:
    """Measure CPU seconds, wall seconds and peak memory (MB) of a fresh process."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT / "src"),
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
    }
    command = [sys.executable, "-W", "ignore", "-c", USED + script, json.dumps(inputs)]
    output = subprocess.run(
        command, check=True, env=environment, capture_output=True, text=True
    ).stdout
    return json.loads(output.splitlines()[-1])


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--data", type=Path, default=DELFT)
    args = parser.parse_args()
    clouds, footprints = list_files(args.data)
    with tempfile.TemporaryDirectory() as out:
        inputs = (list(clouds), footprints, out)
        measure_process(ONCE, inputs)  # compiles, where nobody did
        runs = [
            [measure_process(script, inputs) for script in (DECODE, ONCE, STEADY)]
            for _ in range(args.runs)
        ]
    decode = statistics.median(run[0][0] for run in runs)
    print(f"decoding the LAZ files: {decode:.2f} s CPU, the unit\n")
    columns = ("Delft", "CPU, decodings", "CPU, s", "wall, s", "peak memory, MB")
    with FigureTable(args.record, *columns) as table:
        for place, name in ((1, "whole process, compiled before"), (2, "second run in a process")):
            units = statistics.median(run[place][0] / run[0][0] for run in runs)
            cpu, wall, peak = (statistics.median(run[place][k] for run in runs) for k in range(3))
            table.add(name, f"{units:.1f}", f"{cpu:.2f}", f"{wall:.2f}", f"{peak:.0f}")
        units = ROOFER["cpu_s"] / ROOFER["decode_s"]
        name = "roofer 1.1, on another machine"
        table.add(name, f"{units:.1f}", ROOFER["cpu_s"], "", f"{ROOFER['peak_mb']:.0f}")


if __name__ == "__main__":
    main()
