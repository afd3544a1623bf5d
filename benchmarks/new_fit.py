"""Run another benchmark with the roof fit that is to take the place of the one in use.

usage: python -m benchmarks.new_fit BENCHMARK [its arguments]

An example is `python -m benchmarks.new_fit towns --town nrw_5657`. It goes with the old fit.
"""

from __future__ import annotations

import importlib
import sys

from hiproof.fit import roof, union


def main() -> None:
    if len(sys.argv) < 2:
        sys.exit("expected the name of a benchmark, got none; say for example: towns")
    if "--record" in sys.argv:
        sys.exit("expected a benchmark without --record, since RESULTS.md is of the fit in use")
    union.fit_building = roof.fit_building
    name = sys.argv.pop(1)
    importlib.import_module(f"benchmarks.{name}").main()


if __name__ == "__main__":
    main()
