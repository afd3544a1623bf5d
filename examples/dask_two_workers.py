"""A Dask cluster of two workers on this machine.

On a real cluster only the address changes.

usage: python examples/dask_two_workers.py OUT [CLOUD... FOOTPRINTS] (extra `city`; without files
the bundled town)

The same as `dask scheduler`, `dask worker ADDRESS --nworkers 2 --nthreads 1` and
`hiproof reconstruct ... --scheduler ADDRESS`.
"""

import sys
from pathlib import Path

from distributed import LocalCluster

from hiproof import Request, reconstruct_area
from hiproof.simulate import demo_files


def main(out: Path, clouds: list[str], footprints: str) -> None:
    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        cluster.adapt(minimum=2, maximum=2)  # workers that die are replaced
        request = Request(
            tuple(clouds), out, footprints, scheduler=cluster.scheduler_address, restart=True
        )
        summary = reconstruct_area(request)
    print(f"{summary.buildings} buildings by two Dask workers: {summary.by_status}")


if __name__ == "__main__":  # workers are processes that import this file
    demo = demo_files()
    files = sys.argv[2:] or [str(demo["cloud"]), str(demo["footprints"])]
    main(Path(sys.argv[1]), files[:-1], files[-1])
