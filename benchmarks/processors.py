"""Does Delft get the same models on other processors?

usage: python -m benchmarks.processors [--data ../shared/data/delft]

Whole runs in processes of their own: as on this machine, with the code that numba compiles for any
processor of 64 bits, and without the vector instructions by which NumPy's loops differ. Printed:
how many buildings have the same parameters as on this machine, byte by byte, and which have not.
Compiling for another processor takes a minute.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from .judging import DELFT, list_files
from .tables import FigureTable, make_parser

VECTORS = "AVX512_ICL AVX512_CLX AVX512_SKX X86_V4"
PROCESSORS = {
    "any of 64 bits, by numba": {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""},
    "with AVX2 alone, by NumPy": {"NPY_DISABLE_CPU_FEATURES": VECTORS},
    "without AVX2, by NumPy": {"NPY_DISABLE_CPU_FEATURES": f"{VECTORS} AVX2 FMA3 X86_V3"},
}


def reconstruct_buildings(data: Path, environment: dict[str, str]) -> dict[str, str]:
    """Reconstruct a data set in a process of its own, and read the records."""
    clouds, footprints = list_files(data)
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-W", "ignore", "-m", "hiproof", "reconstruct", *clouds]
        command += ["--footprints", footprints, "--out", folder, "--quiet"]
        subprocess.run(command, check=True, env={**os.environ, **environment})
        _, *lines = Path(folder, "parameters.jsonl").read_text(encoding="utf-8").splitlines()
    return {json.loads(line)["id"]: line for line in lines}


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--data", type=Path, default=DELFT)
    a = parser.parse_args()
    here = reconstruct_buildings(a.data, {})
    with FigureTable(a.record, "processor", "the same", "of", "other ones") as table:
        for name, environment in PROCESSORS.items():
            other = reconstruct_buildings(a.data, environment)
            unlike = [id for id, record in here.items() if other.get(id) != record]
            table.add(name, len(here) - len(unlike), len(here), ", ".join(unlike))


if __name__ == "__main__":
    main()
