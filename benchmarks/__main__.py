"""Run every benchmark: `python -m benchmarks [--quick]`.

They run one after the other; --quick goes to those that know it.
"""

import subprocess
import sys
from pathlib import Path

for path in sorted(Path(__file__).parent.glob("*.py")):
    text = path.read_text()
    if not path.name.startswith("_") and "def main(" in text:
        words = [word for word in sys.argv[1:] if f'"{word}"' in text]
        print(f"\n== python -m benchmarks.{path.stem} {' '.join(words)}", flush=True)
        subprocess.run([sys.executable, "-m", f"benchmarks.{path.stem}", *words], check=False)
