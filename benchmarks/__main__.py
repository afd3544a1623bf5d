"""Run every benchmark one after the other: `python -m benchmarks [--quick]`."""

import subprocess
import sys
from pathlib import Path

for path in sorted(Path(__file__).parent.glob("*.py")):
    if not path.name.startswith("_") and "def main(" in path.read_text():
        print(f"\n== python -m benchmarks.{path.stem} {' '.join(sys.argv[1:])}", flush=True)
        subprocess.run([sys.executable, "-m", f"benchmarks.{path.stem}", *sys.argv[1:]], check=False)
