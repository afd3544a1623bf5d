"""Changes that are found and named in simulated cities surveyed twice.

usage: python -m benchmarks.changes [--seeds 100 101] [--count 100] [--densities 8 3]
                                    [--share 0.2] [--keep FOLDER] [--verbose]
       python -m benchmarks.changes --refine [--seeds 100 101] [--count 100]
       python -m benchmarks.changes --cost --count 500 [--seeds 100]
       python -m benchmarks.changes --scenes [--seeds 100] [--verbose]

One building in five (--share) changes, by each kind in turn, and the same number of others get
something that is no change: leaves over the roof in class 6, a crane, scaffolding, or no points on
a side. Both surveys have their own noise; the second lies 5 cm higher and 20 cm aside. `hiproof
reconstruct` runs on the first survey and `hiproof update` on the second. Changes count from 0.5 m
over 4 m2 on. Flight lines have errors of their own: how much higher the second survey lies on the
whole is measured on its ground.

With --refine, it prints how large the errors of the parameters of unchanged buildings are over
their standard deviations (RMS), before and after they are estimated by both surveys. Both are about
the first survey: flight lines have a common error in height, which is measured on the ground.

With --cost, 2 % of the buildings change, and three rounds print the CPU time of an update over that
of a run, both in this process.

With --scenes, small scenes of change_scenes.py: more than half of the houses change, one house
stands alone, sides are lost at 2 to 24 points/m2, surveys are shifted with and without change.

Seeds 0 to 9 are for choosing constants, 100 to 109 for reporting.
"""

from __future__ import annotations

import dataclasses
import json
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
import shapely

from hiproof.model import Building
from hiproof.parametric.building import build
from hiproof.parametric.file import read_parameters
from hiproof.read.points.pointcloud import read_points
from hiproof.simulate.city import City, Stock
from hiproof.simulate.scanner import Scan, ScanSettings
from hiproof.simulate.scene import building_bodies
from hiproof.simulate.survey import survey, write_footprints, write_laz
from hiproof.simulate.town import Lot
from hiproof.update.places import move_to_frame
from hiproof.update.refine import REFINED

from .building_changes import CHANGES, change_building
from .change_scenes import read_changes, reconstruct_city, run_scenes, update_city
from .compounds import compare_parts
from .kept_parts import count_kept, describe_kept
from .tables import FigureTable, make_parser

USUAL_SHARE = 0.2  # of the buildings that change; as many others are disturbed
SHIFT_M = np.array([0.16, -0.12, 0.05])
KINDS = (*CHANGES, "demolished", "built")
DISTURBANCES = ("leaves", "crane", "scaffolding", "occlusion")
LEAST_M, LEAST_M2 = 0.5, 4.0
NOTHING = "unchanged"
HELD = ("length", "width", "t_x", "t_y", "kappa")  # what no update estimates anew
COST_SHARE, COST_ROUNDS = 0.02, 3


def draw_truth(
    seed: int, lots: list[Lot], share: float
) -> tuple[dict[str, str], dict[str, Lot], dict[str, str]]:
    """Return kinds of change by id, the lots that change, and disturbances."""
    rng = np.random.default_rng([seed, 77])
    order = rng.permutation(len(lots)).tolist()
    count = max(1, round(share * len(lots)))
    kinds: dict[str, str] = {}
    after: dict[str, Lot] = {}
    number = 0
    while order and len(kinds) < count:
        lot = lots[order.pop()]
        for step in range(len(KINDS)):
            kind = KINDS[(number + step) % len(KINDS)]
            if kind in ("demolished", "built"):
                kinds[lot.id] = kind
                break
            building = change_building(rng, lot.building, kind)
            if building is not None and is_large_change(lot, building):
                bodies = tuple(building_bodies(building))
                kinds[lot.id] = kind
                after[lot.id] = dataclasses.replace(lot, building=building, bodies=bodies)
                break
        number += 1
    disturbed = {
        lots[k].id: DISTURBANCES[i % len(DISTURBANCES)] for i, k in enumerate(order[:count])
    }
    return kinds, after, disturbed


def is_large_change(lot: Lot, building) -> bool:
    """Return whether a roof changes by LEAST_M over LEAST_M2 or more."""
    outline = lot.building.outline
    west, south, east, north = outline.bounds
    axes = np.meshgrid(np.arange(west, east, 0.25), np.arange(south, north, 0.25))
    xy = np.stack(axes, axis=-1).reshape(-1, 2)
    heights = [np.nan_to_num(roof.height_at(xy)) for roof in (lot.building.roof, building.roof)]
    return float((np.abs(heights[1] - heights[0]) > LEAST_M).sum()) / 16 >= LEAST_M2


def disturb(rng: np.random.Generator, lot: Lot, kind: str, cloud: Scan) -> Scan:
    """Return the cloud with something over or before a roof that is no change of it."""
    outline = lot.building.footprint
    x0, y0, x1, y1 = outline.bounds
    inside = shapely.intersects_xy(outline, cloud.points[:, 0], cloud.points[:, 1])
    if not inside.any():
        return cloud
    top = float(cloud.points[inside, 2].max())
    if kind == "occlusion":
        middle = (x0 + x1) / 2
        return cloud.select(~(inside & (cloud.points[:, 0] < middle)))
    points = cloud.points.copy()
    chosen = np.flatnonzero(inside)
    if kind == "leaves":  # a crown over a half lets a third of the pulses through
        centre = np.array([x1, (y0 + y1) / 2])
        near = np.hypot(*(points[chosen, :2] - centre).T) < 0.35 * (x1 - x0)
        hit = chosen[near & (rng.random(len(chosen)) < 0.67)]
        points[hit, 2] = top + rng.uniform(-0.5, 3.0, len(hit))
    elif kind == "crane":  # a jib of a metre across the roof
        hit = chosen[np.abs(points[chosen, 1] - (y0 + y1) / 2) < 0.5]
        points[hit, 2] = top + 8.0 + rng.uniform(0.0, 1.5, len(hit))
    else:  # scaffolding: tubes over the strip along the walls
        strip = outline.difference(outline.buffer(-0.9))
        on = shapely.intersects_xy(strip, points[chosen, 0], points[chosen, 1])
        hit = chosen[on & (rng.random(len(chosen)) < 0.6)]
        points[hit, 2] = points[hit, 2] + rng.uniform(0.3, 2.0, len(hit))
    return dataclasses.replace(cloud, points=points)


def find_bounds(stock: Stock) -> tuple[float, float, float, float]:
    """Return the bounds of all lots of a city."""
    return (*stock.low.min(axis=0), *stock.high.max(axis=0))


def find_lots(stock: Stock) -> dict[str, Lot]:
    """Return all lots of a city by id."""
    return {lot.id: lot for lot in stock.near(find_bounds(stock))}


def write_city(
    folder: Path, seed: int, count: int, densities: tuple[float, float], share: float
) -> dict:
    """Write both surveys and footprints of a city; return its truth."""
    city = City(count, seed, densities[0])
    stock = Stock(city)
    bounds, by_id = find_bounds(stock), find_lots(stock)
    lots = list(by_id.values())
    kinds, after, disturbed = draw_truth(seed, lots, share)
    folder.mkdir(parents=True, exist_ok=True)
    write_footprints(folder / "footprints.gpkg", lots)
    first = [lot for lot in lots if kinds.get(lot.id) != "built"]
    second = [after.get(lot.id, lot) for lot in lots if kinds.get(lot.id) != "demolished"]
    rng = np.random.default_rng([seed, 78])
    for name, some, density, own in (
        ("first", first, densities[0], seed),
        ("second", second, densities[1], seed + 5000),
    ):
        scans, settings = [], ScanSettings(density=density)
        patches = stock.patches(bounds)
        for cloud in survey(patches, some, stock.terrain, city.flight, own, settings):
            if name == "second":
                for id, kind in disturbed.items():
                    cloud = disturb(rng, by_id[id], kind, cloud)
                cloud = cloud.move(SHIFT_M)
            scans.append(cloud)
        write_laz(folder / f"{name}.laz", iter(scans), np.array([*bounds[:2], 0.0]))
    heights = [measure_height(folder / f"{name}.laz", stock) for name in ("first", "second")]
    truth = {
        "height": heights[1] - heights[0],
        "kinds": kinds,
        "disturbed": disturbed,
        "ids": [lot.id for lot in lots],
        "raised": {
            id: float(lot.building.roof.parts[0].translation[2])
            - float(by_id[id].building.roof.parts[0].translation[2])
            for id, lot in after.items()
            if kinds[id] == "roof_raised"
        },
    }
    (folder / "truth.json").write_text(json.dumps(truth))
    return truth


def measure_height(path: Path, stock: Stock) -> float:
    """Return how much higher (m) than the terrain a survey shows the ground."""
    cloud = read_points(str(path))
    ground = cloud.xyz[cloud.classes == 2]
    return float(np.median(ground[:, 2] - stock.terrain.height_at(ground[:, :2])))


def run_city(
    folder: Path, seed: int, count: int, densities: tuple[float, float], share: float
) -> dict:
    """Return the truth and the answer of a city, with the seconds of run and update."""
    file = folder / "truth.json"
    is_written = file.exists()
    city = (folder, seed, count, densities, share)
    truth = json.loads(file.read_text()) if is_written else write_city(*city)
    start = time.process_time()
    if not (folder / "models" / "run.json").exists():
        reconstruct_city(folder)
    middle = time.process_time()
    summary = update_city(folder)
    end = time.process_time()
    by_id = find_lots(Stock(City(count, seed, densities[0])))
    after = draw_truth(seed, list(by_id.values()), share)[1]
    return {
        "truth": truth,
        "rows": read_changes(folder),
        "seconds": (middle - start, end - middle),
        "shift": summary.surveys.shift,
        "kept": count_kept(
            folder, {id: (by_id[id].building.roof, lot.building.roof) for id, lot in after.items()}
        ),
    }


def measure_cost(
    folder: Path, seed: int, count: int, densities: tuple[float, float]
) -> dict[str, float]:
    """Return the CPU time of an update over that of a run, round by round and the median."""
    write_city(folder, seed, count, densities, COST_SHARE)
    shares = []
    for _ in range(COST_ROUNDS):
        times = [time.process_time()]
        for work in (reconstruct_city, update_city):
            work(folder)
            times.append(time.process_time())
        run, update = np.diff(times).tolist()
        shares.append(update / run)
        print(f"CPU: run {run:.1f} s, update {update:.1f} s: {shares[-1]:.3f}", flush=True)
    rounds = {f"update over run, round {k + 1}": share for k, share in enumerate(shares)}
    return rounds | {"median": float(np.median(shares))}


def measure_refined(
    folder: Path, seed: int, count: int, densities: tuple[float, float]
) -> dict[str, list[dict[str, float]]]:
    """Return errors over sigma of refined buildings, before and after."""
    truth = run_city(folder, seed, count, densities, USUAL_SHARE)["truth"]
    update_city(folder, "refined", refine=True)
    stock = Stock(City(count, seed, densities[0]))
    roofs = {id: lot.building.roof for id, lot in find_lots(stock).items()}
    offset = np.array([0.0, 0.0, measure_height(folder / "first.laz", stock)])
    models = {name: read_models(folder / name) for name in ("models", "refined")}
    changed = truth["kinds"].keys() | truth["disturbed"].keys()
    chosen = [
        id for id, b in models["refined"].items() if REFINED in b.detail and id not in changed
    ]
    result: dict[str, list[dict[str, float]]] = {"models": [], "refined": []}
    for id in chosen:
        for name, found in models.items():
            target = dataclasses.replace(roofs[id].frame, origin=roofs[id].frame.origin + offset)
            moved = move_to_frame(dataclasses.replace(roofs[id], frame=target), found[id].roof)
            result[name].append(dict(compare_parts(moved, found[id].roof.parts)[2]))
    return result


def read_models(folder: Path) -> dict[str, Building]:
    """Return the buildings with a model in the folder of a run by id."""
    buildings = map(build, read_parameters(folder / "parameters.jsonl"))
    return {building.id: building for building in buildings if building.built is not None}


def report_refined(results: list[dict[str, list[dict[str, float]]]]) -> dict[str, float]:
    """Return the RMS of errors over sigma, and print that of each parameter."""
    figures: dict[str, float] = {}
    for name in ("models", "refined"):
        found = [errors for result in results for errors in result[name]]
        by_name: dict[str, list[float]] = {}
        for errors in found:
            for parameter, value in errors.items():
                by_name.setdefault(parameter, []).append(value)
        every = [value for values in by_name.values() for value in values]
        estimated = [value for n, values in by_name.items() if n not in HELD for value in values]
        rms, rms_all = (np.sqrt(np.mean(np.square(values))) for values in (estimated, every))
        each = ", ".join(
            f"{parameter} {np.sqrt(np.mean(np.square(values))):.2f} ({len(values)})"
            for parameter, values in sorted(by_name.items())
        )
        print(f"  {name}: {len(found)} buildings, {each}")
        figures[f"{name}: RMS of estimated parameters"] = float(rms)
        figures[f"{name}: RMS with held ones"] = float(rms_all)
    return figures


def score(results: list[dict], is_verbose: bool) -> dict[str, float]:
    """Return the figures of some cities."""
    counts: Counter[str] = Counter()
    errors: list[float] = []
    for k, result in enumerate(results):
        truth, rows = result["truth"], result["rows"]
        for id in truth["ids"]:
            kind, row = truth["kinds"].get(id, NOTHING), rows.get(id)
            found = row is not None and row["class"] in ("changed", "gone", "new")
            is_disturbed = id in truth["disturbed"]
            group = "changed" if kind != NOTHING else "disturbed" if is_disturbed else NOTHING
            counts[group] += 1
            counts[group + " found"] += found
            counts[group + " uncertain"] += row is not None and row["class"] == "uncertain"
            right = found and row["kind"] == kind
            counts["right"] += right
            if kind == "roof_raised" and found:
                errors.append(float(row["difference_m"] or "nan") - truth["raised"][id])
            if is_verbose and (found != (kind != NOTHING) or (found and not right)):
                names = ("class", "kind", "difference_m", "area_m2")
                told = row and tuple(row[name] for name in names)
                print(f"    city {k} {id}: {kind} {truth['disturbed'].get(id, '')} -> {told}")
    alarms = counts[NOTHING + " found"] + counts["disturbed found"]
    hits = counts["changed found"]
    return {
        "changed": counts["changed"],
        "recall": hits / max(counts["changed"], 1),
        "precision": hits / max(hits + alarms, 1),
        "kind right": counts["right"] / max(hits, 1),
        "alarms unchanged": counts[NOTHING + " found"] / max(counts[NOTHING], 1),
        "alarms disturbed": counts["disturbed found"] / max(counts["disturbed"], 1),
        "uncertain": sum(counts[g + " uncertain"] for g in ("changed", "disturbed", NOTHING)),
        "of them changed": counts["changed uncertain"],
        "raised: worst error m": float(np.nanmax(np.abs(errors))) if errors else float("nan"),
    }


def main() -> None:
    parser = make_parser(__doc__, seeds=[100], count=100)
    parser.add_argument("--densities", type=float, nargs=2, default=(8.0, 8.0))
    parser.add_argument("--share", type=float, default=USUAL_SHARE, help="of buildings that change")
    parser.add_argument("--keep", type=Path, help="folder in which cities and models stay")
    parser.add_argument("--cost", action="store_true", help="measure the cost of an update alone")
    parser.add_argument("--refine", action="store_true", help="measure refined buildings alone")
    parser.add_argument("--scenes", action="store_true", help="run small scenes alone")
    parser.add_argument("--verbose", action="store_true", help="list every building that is wrong")
    given = parser.parse_args()
    d = tuple(given.densities)
    columns = ("figure", "value")
    with tempfile.TemporaryDirectory() as scratch, FigureTable(given.record, *columns) as table:
        folder = given.keep or Path(scratch)
        if given.scenes:
            figures = run_scenes(folder, given.seeds, given.verbose)
        elif given.cost:
            figures = measure_cost(folder / "cost", given.seeds[0], given.count, d)
        elif given.refine:
            cities = [(folder / f"refine_{seed}", seed) for seed in given.seeds]
            figures = report_refined([measure_refined(*city, given.count, d) for city in cities])
        else:
            figures = run_cities(folder, given.seeds, given.count, d, given.share, given.verbose)
        for name, value in figures.items():
            table.add(name, value)


def run_cities(
    folder: Path,
    seeds: list[int],
    count: int,
    densities: tuple[float, float],
    share: float,
    is_verbose: bool,
) -> dict[str, float]:
    """Survey, run and update cities; return the figures of all."""
    results = []
    for seed in seeds:
        name = f"{seed}_{count}_{densities[0]:g}_{densities[1]:g}_{share:g}"
        results.append(run_city(folder / name, seed, count, densities, share))
    for result in results:
        shift, (run, update) = result["shift"], result["seconds"]
        error = shift.xyz[2] - result["truth"]["height"]
        print(
            f"  shift {shift.xyz}, sigma {shift.sigma}, height {error:+.4f} m beside that of the "
            f"ground; CPU: run {run:.1f} s, update {update:.1f} s"
        )
    kept = sum((result["kept"] for result in results), Counter())
    return score(results, is_verbose) | describe_kept(kept)


if __name__ == "__main__":
    main()
