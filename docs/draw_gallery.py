"""Draw the gallery: the points of six real data sets beside their models.

python docs/draw_gallery.py [NAME ...] [--runs FOLDER]

Reads ../shared/data. Runs are written to FOLDER (default: build/gallery) and used again; a table
of what became of the buildings is printed.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

from draw_town import draw

from hiproof import Request, reconstruct_area

HERE = Path(__file__).resolve().parent
DATA = HERE.parents[1] / "shared/data"
RUNS = HERE.parent / "build/gallery"


@dataclass(frozen=True)
class DataSet:
    """Point files of a folder, footprints if any, and the part shown.

    The part is one of the plan.
    """

    clouds: str
    footprints: str | None = None
    shown: tuple[float, float, float, float] = (0.0, 1.0, 0.0, 1.0)


DATA_SETS = {
    "delft": DataSet("delft/*.laz", "delft/footprints.gpkg", (0.1, 0.6, 0.3, 0.8)),
    "amsterdam_west": DataSet("amsterdam_west/*.laz", "amsterdam_west/footprints_bag.gpkg"),
    "amsterdam_2014": DataSet("two_epochs/2014/*.laz", "two_epochs/footprints.gpkg"),
    "amsterdam_2010": DataSet("two_epochs/2010/*.laz", "two_epochs/footprints.gpkg"),
    "ctview": DataSet("ctview/*.laz"),
    "stbarth": DataSet("stbarth/*.laz"),
}


def reconstruct(data_set: DataSet, run: Path) -> None:
    """Reconstruct a data set with default settings, unless the run exists."""
    if not (run / "run.json").exists():
        clouds = tuple(str(file) for file in sorted(DATA.glob(data_set.clouds)))
        footprints = data_set.footprints and str(DATA / data_set.footprints)
        print(run.name, reconstruct_area(Request(clouds, run, footprints)).by_status)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", choices=[*DATA_SETS, []], default=[])
    parser.add_argument("--runs", type=Path, default=RUNS)
    arguments = parser.parse_args()
    for name in arguments.names or DATA_SETS:
        data_set, run = DATA_SETS[name], arguments.runs / name
        reconstruct(data_set, run)
        (HERE / "gallery").mkdir(exist_ok=True)
        draw(run, HERE / f"gallery/{name}.png", DATA.glob(data_set.clouds), data_set.shown, 60)


if __name__ == "__main__":
    main()
