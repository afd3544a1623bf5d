"""`python -m experiments NAME [--quick] [--data ...] [--out DIR]`.

Several names, or `all`, run one after the other.
"""

from __future__ import annotations

import argparse
import importlib
import os
import time
from pathlib import Path

from .output import Options, write_result

NAMES = ("table1", "table2", "fig6", "table3", "fig7", "fig8", "robust")


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m experiments", description=__doc__)
    parser.add_argument(
        "names",
        nargs="+",
        choices=(*NAMES, "all"),
        metavar="NAME",
        help=f"{', '.join(NAMES)} or all",
    )
    parser.add_argument("--quick", action="store_true", help="a few roofs only")
    parser.add_argument(
        "--data", type=Path, help="folder with roofn3d/nyc_roofs.npz, or a RoofN3D csv file"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("out/experiments"), help="folder for the files"
    )
    parser.add_argument("--seed", type=int, default=2020)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    parser.add_argument(
        "--paper-share",
        type=float,
        default=1.0,
        help="share of the fits made with the paper's objective",
    )
    values = parser.parse_args(arguments)
    options = Options(
        values.quick,
        values.data,
        values.seed,
        1 if values.quick else values.jobs,
        values.paper_share,
    )
    # One thread a process: the work is shared out by processes, and small matrices only lose by
    # more threads. NumPy reads this when it is first imported, with the experiment.
    for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    for name in NAMES if "all" in values.names else values.names:
        start = time.perf_counter()
        result = importlib.import_module(f"experiments.{name}").run(options)
        print(
            write_result(name, result, values.out, options, time.perf_counter() - start).read_text()
        )


if __name__ == "__main__":
    main()
