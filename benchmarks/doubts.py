"""Are doubts raised where points lie on two surfaces, or on a part alone?

Sound buildings must have none.

usage: python -m benchmarks.doubts [--parity even|odd] [--share 1] [--density 5]

Delft's footprints of that parity, from a `--share` of their points, and the true roofs of three
towns, scanned by simulation, are modelled as they are, then with half their points put 0.25, 0.4
and 1 m higher, and without what lies in the eastern half of the outline. Printed for each: how many
of the buildings of 30 points or more a sentence tells of two surfaces, of a part without points,
and how far apart the surfaces are said to be in the median.
"""

from __future__ import annotations

import argparse
import zlib
from collections.abc import Callable, Iterable

import numpy as np
import shapely

from hiproof import reconstruct
from hiproof.evaluate.layers import FEWEST_LAYER_POINTS, find_second_surface, unseen_share
from hiproof.evaluate.verdict import MOST_UNSEEN
from hiproof.settings import Settings

from .delft import read_set
from .towns import TOWNS, read_town

# no footprint is off, and half a roof moves none
SETTINGS = Settings.from_dict({"reconstruct": {"align": "off"}})
EACH = {"denhaag": 12}  # of that town's 1,990 buildings one in so many

Case = tuple[str, np.ndarray, shapely.Polygon]


def make_raise(by_m: float) -> Callable[[Case], np.ndarray]:
    """Make a change that raises half of a case's points (n, 3).

    They are drawn by chance.
    """

    def raise_points(case: Case) -> np.ndarray:
        id, points, _ = case
        is_raised = np.random.default_rng(zlib.crc32(id.encode())).random(len(points)) < 0.5
        return points + np.outer(is_raised, (0.0, 0.0, by_m))

    return raise_points


def keep_western_points(case: Case) -> np.ndarray:
    """Return points (n, 3) of a case west of the middle of its outline."""
    _, points, outline = case
    return points[points[:, 0] < outline.centroid.x]


CHANGES: dict[str, Callable[[Case], np.ndarray]] = {
    "as they are": lambda case: case[1],
    **{f"half {by_m:g} m higher": make_raise(by_m) for by_m in (0.25, 0.4, 1.0)},
    "western half alone": keep_western_points,
}


def describe_doubts(cases: Iterable[Case], change: Callable[[Case], np.ndarray]) -> str:
    """Describe the doubts about all changed cases."""
    surfaces, distances, unseen, count = 0, [], 0, 0
    for case in cases:
        points = change(case)
        building = reconstruct(points, case[2], settings=SETTINGS)
        inside = points[shapely.intersects_xy(case[2], *points[:, :2].T)]
        if building.built is None or len(inside) < FEWEST_LAYER_POINTS:
            continue
        local = building.roof.frame.to_local(inside)
        share, apart_m = find_second_surface(local, building.roof)
        count, surfaces = count + 1, surfaces + (share > 0)
        distances += [apart_m] if share else []
        unseen += unseen_share(local, building.roof.outline) > MOST_UNSEEN
    distance_text = f", {np.median(distances):.2f} m apart" if distances else ""
    return f"{count} buildings, two surfaces {surfaces}{distance_text}, without points {unseen}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--parity", choices=("even", "odd"), default="odd")
    parser.add_argument("--share", type=float, default=1.0, help="of Delft's points")
    parser.add_argument(
        "--density", type=float, default=5.0, help="points a square metre in the towns"
    )
    a = parser.parse_args()
    delft = [
        (f.id, points, f.polygon) for points, f in read_set("delft", a.share, a.parity).own_points
    ]
    towns = [
        (building.id, building.scan_points(a.density), building.footprint)
        for name, path in TOWNS.items()
        for building in read_town(path)[:: EACH.get(name, 1)]
    ]
    for name, cases in (
        (f"Delft {a.parity}, {a.share:g} of the points", delft),
        (f"towns, {a.density:g}/m2", towns),
    ):
        for words, change in CHANGES.items():
            print(f"{name}, {words}: {describe_doubts(cases, change)}", flush=True)


if __name__ == "__main__":
    main()
