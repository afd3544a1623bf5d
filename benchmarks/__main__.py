"""Run every benchmark of the page of figures, one after the other.

usage: python -m benchmarks [--record]
"""

import subprocess
import sys

from .results import ORDER

for name in ORDER:
    if name != "roofer":  # measured by hand
        print(f"\n== python -m benchmarks.{name}", flush=True)
        subprocess.run([sys.executable, "-m", f"benchmarks.{name}", *sys.argv[1:]], check=False)
