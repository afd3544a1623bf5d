"""Edges of real towns' roofs, scanned by simulation and modelled again.

usage: python -m benchmarks.towns [--town essen nrw_5657 denhaag vienna rotterdam delft_5907]
           [--density 5] [--without-footprints] [--every K] [--parity even|odd] [--most N]
           [--worst N] [--save DIR]

A building is the solids of one CityJSON building whose grounds touch. Those of 30 m2 or more are
scanned one by one, by the id and without gaps, and reconstructed under their true ground outline or
without it. `wireframe.py` compares corners, edges and faces of the written models with the true
ones. `--every` takes each k-th building, `--parity` those at even or odd places, `--most` draws so
many by chance, always the same ones. Figures come pooled and as the mean over buildings, also by
footprint area. Without `--town` the first three towns are taken. Vienna's are perimeter blocks,
Rotterdam's rows with surfaces that are not closed, Delft's machine-made with many short edges.
`--save` keeps what a run would leave and `truth.city.json`, to be drawn by docs/draw_roofs.py.
Milliseconds are the CPU time of `reconstruct`, recognition and quality included.
"""

from __future__ import annotations

import json
import tempfile
import time
import traceback
import zlib
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from hiproof import reconstruct
from hiproof.formats import list_requested_files
from hiproof.model import GROUND, Building, Solid
from hiproof.read.models.solids import read_solids
from hiproof.settings import Settings
from hiproof.simulate import SOURCES, Defects, ScanSettings, scan_solids
from hiproof.status import Status
from hiproof.write import FileHead, fragments, join_fragments

from .judging import SHARED, describe_parts
from .tables import FigureTable, make_parser
from .wireframes import (
    COLUMNS,
    Score,
    count_wireframes,
    list_worst,
    make_cells,
    make_size_rows,
    summarise,
)

TOWNS = {
    "essen": SHARED / "data/towns/essen.city.json",
    "nrw_5657": SHARED / "data/towns/nrw_5657.city.json",
    "denhaag": SHARED / "data/denhaag/DenHaag_01.city.json",
    "vienna": SHARED / "data/towns/vienna.city.json",
    "rotterdam": SHARED / "data/towns/rotterdam.city.json",
    "delft_5907": SHARED / "data/towns/delft_5907.city.json",
}
USUAL = ("essen", "nrw_5657", "denhaag")
SMALLEST_M2 = 30.0
TOUCH_M = 0.01


@dataclass(frozen=True)
class TrueBuilding:
    """Solids that touch, by the ids of their city objects, and the union of their grounds."""

    id: str
    solids: dict[str, Solid]
    footprint: shapely.Polygon

    def scan_points(self, density: float) -> np.ndarray:
        """Scan points (n, 3) of the building without ground, always the same for one id."""
        rng = np.random.default_rng(zlib.crc32(self.id.encode()))
        cloud = scan_solids(
            list(self.solids.values()), rng, ScanSettings(density=density, defects=Defects.none())
        )
        return cloud.points[cloud.source != SOURCES.index("ground")]


def read_town(path: Path, smallest_m2: float = SMALLEST_M2) -> list[TrueBuilding]:
    """Read the buildings of a CityJSON file with a ground of `smallest_m2` or more."""
    objects = json.loads(path.read_text(encoding="utf-8"))["CityObjects"]
    solids = defaultdict(dict)
    for name, solid in read_solids(path):
        solids[objects[name].get("parents", [name])[0]][name] = solid
    buildings = [building for id in sorted(solids) for building in group_touching(id, solids[id])]
    return [building for building in buildings if building.footprint.area >= smallest_m2]


def group_touching(id: str, solids: dict[str, Solid]) -> list[TrueBuilding]:
    """Group the solids of one building whose grounds touch."""
    grounds = {name: find_ground(solid) for name, solid in solids.items()}
    joined = shapely.union_all(
        [ground.buffer(TOUCH_M, join_style="mitre") for ground in grounds.values()]
    )
    outlines = shapely.get_parts(joined.buffer(-TOUCH_M, join_style="mitre"))
    outlines = sorted((o for o in outlines if o.area > 0), key=lambda outline: -outline.area)
    groups = []
    for k, outline in enumerate(outlines):
        touching = [n for n, ground in grounds.items() if find_nearest(ground, outlines) == k]
        members, name = {n: solids[n] for n in touching}, id if k == 0 else f"{id}~{k + 1}"
        groups.append(TrueBuilding(name, members, outline.simplify(TOUCH_M)))
    return groups


def find_nearest(ground: shapely.Geometry, outlines: list[shapely.Polygon]) -> int:
    """Index of the outline that covers most of `ground`."""
    return int(np.argmax(shapely.area(shapely.intersection(ground, outlines))))


def find_ground(solid: Solid) -> shapely.Geometry:
    rings = [
        [solid.vertices[list(ring), :2] for ring in face.rings]
        for face in solid.select_faces(GROUND)
    ]
    return shapely.union_all(
        [shapely.make_valid(shapely.Polygon(outer, holes)) for outer, *holes in rings]
    )


def choose_buildings(
    buildings: list, step: int = 1, parity: str | None = None, limit: int | None = None
) -> list:
    """Choose each k-th, even or odd places, and at most so many by a fixed chance."""
    buildings = buildings[::step]
    buildings = buildings if parity is None else buildings[("even", "odd").index(parity) :: 2]
    if limit is None or limit >= len(buildings):
        return buildings
    chosen = np.random.default_rng(0).choice(len(buildings), limit, replace=False)
    return [buildings[k] for k in sorted(chosen)]


def write_truth(path: Path, source: Path, buildings: list[TrueBuilding]) -> None:
    """Write the city objects of `buildings` from the CityJSON file `source`."""
    city = json.loads(source.read_text(encoding="utf-8"))
    objects, city["CityObjects"] = city["CityObjects"], {}
    for building in buildings:
        if list(building.solids) != [building.id]:
            city["CityObjects"][building.id] = {
                "type": "Building",
                "children": list(building.solids),
            }
        for name in building.solids:
            parents = (
                {} if name == building.id else {"type": "BuildingPart", "parents": [building.id]}
            )
            city["CityObjects"][name] = objects[name] | parents
    path.write_text(json.dumps(city), encoding="utf-8")


def write_run(folder: Path, models: list[Building], points: list[np.ndarray]) -> None:
    """Write models and points of a town as `hiproof reconstruct` does."""
    folder.mkdir(parents=True, exist_ok=True)
    head = FileHead()
    texts = (fragments(model, (model.id, model.id), head)[1] for model in models)
    join_fragments(list_requested_files(Settings(), folder), texts, head)
    cloud = folder / "points.xyz"
    np.savetxt(cloud, np.concatenate(points), fmt="%.3f")
    (folder / "run.json").write_text(json.dumps({"inputs": {"clouds": [str(cloud)]}}))


def model_all(
    buildings: list[TrueBuilding], points: list[np.ndarray], with_footprint: bool
) -> tuple[list[Building], list[float]]:
    """Reconstruct every building; return the CPU seconds of each. A bug costs one."""
    models, seconds = [], []
    for k in (0, *range(len(buildings))):  # the first one twice: it loads what is compiled
        outline = buildings[k].footprint if with_footprint else None
        started = time.process_time()
        try:
            models.append(reconstruct(points[k], outline, id=buildings[k].id))
        except Exception:
            print(f"{buildings[k].id} failed: {traceback.format_exc()}")
            models.append(Building(buildings[k].id, Status.INTERNAL_ERROR))
        seconds.append(time.process_time() - started)
    return models[1:], seconds[1:]


def judge_models(
    town: str,
    buildings: list[TrueBuilding],
    models: list[Building],
    seconds: list[float],
    folder: Path,
) -> list[Score]:
    """Score each model of `buildings` in `folder`. The truth is written there too."""
    truth = folder / "truth.city.json"
    write_truth(truth, TOWNS[town], buildings)
    counts = count_wireframes(folder / "buildings.city.jsonl", truth)
    return [
        Score(b.id, counts[b.id], b.footprint.area, spent, len(m.parts), read_share(m))
        for b, m, spent in zip(buildings, models, seconds, strict=True)
        if b.id in counts
    ]


def read_share(model: Building) -> float:
    """Return the share of points within 0.2 m of the roof, 0 without a model."""
    return float(np.nan_to_num(model.quality.share_within_20cm)) if model.solid is not None else 0.0


def main() -> None:
    parser = make_parser(__doc__, parity=None, most=None, worst=0)
    parser.add_argument("--town", nargs="+", choices=list(TOWNS), default=USUAL)
    parser.add_argument("--density", type=float, default=5.0, help="points a square metre")
    parser.add_argument("--without-footprints", action="store_true")
    parser.add_argument("--every", type=int, default=1, help="take each k-th building")
    parser.add_argument("--save", type=Path, help="keep a run and the truth of each town here")
    a = parser.parse_args()
    with (
        FigureTable(a.record, "town", *COLUMNS) as table,
        tempfile.TemporaryDirectory() as temporary,
    ):
        for town in a.town:
            buildings = choose_buildings(read_town(TOWNS[town]), a.every, a.parity, a.most)
            points = [building.scan_points(a.density) for building in buildings]
            models, seconds = model_all(buildings, points, not a.without_footprints)
            folder = (a.save or Path(temporary)) / town
            write_run(folder, models, points)
            scores = judge_models(town, buildings, models, seconds, folder)
            table.add(town, *make_cells(scores))
            print("\n".join([*summarise(scores), *make_size_rows(scores), describe_parts(models)]))
            print("".join(f"  worst {line}\n" for line in list_worst(scores, a.worst)), end="")


if __name__ == "__main__":
    main()
