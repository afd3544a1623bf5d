"""Small scenes surveyed twice, to test registration and lost parts.

usage: python -m benchmarks.changes --scenes [--seeds 100] [--verbose]

Single roofs of random shape stand on a slope, one in a square of 34 m. Houses that rise do so by
0.4 to 3.2 m; houses that lose a side keep 45 to 80 % of their length, and the ground lies bare
there. The second survey is shifted as a whole. A scene has 24 houses, or one.

Of lost sides, it prints the median of the reported area over the true one. A model is left whole if
it still covers half of the lost side, and silent if it is graded good all the same.
"""

from __future__ import annotations

import csv
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyogrio
import shapely

from hiproof.city.request import Request
from hiproof.city.run import reconstruct_area
from hiproof.parametric.building import build
from hiproof.parametric.file import read_parameters
from hiproof.simulate import random_building
from hiproof.simulate.roofs import SimBuilding
from hiproof.simulate.scanner import Scan
from hiproof.simulate.scene import SOURCES
from hiproof.simulate.survey import write_laz
from hiproof.status import Grade
from hiproof.update.request import UpdateRequest
from hiproof.update.run import UpdateSummary, update_area

PITCH_M, CORNER, SLOPE = 34.0, np.array([85000.0, 446000.0]), np.array([0.01, -0.015])
NOISE_M, HORIZONTAL_NOISE_M = 0.03, 0.05
RISES_M, KEPT = (0.4, 3.2), (0.45, 0.8)
LEFT_WHOLE = 0.5  # of a lost side, above which its model did not follow
GROUND, ROOF = SOURCES.index("ground"), SOURCES.index("roof")


@dataclass(frozen=True)
class ChangeScene:
    """Shares of houses that rise or lose a side, and how the surveys lie."""

    name: str
    raised: float = 0.0
    cut: float = 0.0
    shift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    densities: tuple[float, float] = (8.0, 8.0)
    houses: int = 24


SHIFTED = (0.16, -0.12, 0.4)
SCENES = (
    ChangeScene("nothing changes"),
    ChangeScene("nothing changes, shifted", shift_m=SHIFTED),
    ChangeScene("one house, nothing changes, shifted", shift_m=SHIFTED, houses=1),
    ChangeScene("one house, raised", raised=1.0, houses=1),
    ChangeScene("one house, a side lost, shifted", cut=1.0, shift_m=SHIFTED, houses=1),
    ChangeScene("60 % raised", raised=0.6),
    ChangeScene("60 % raised, shifted", raised=0.6, shift_m=SHIFTED),
    ChangeScene("60 % raised, shifted down", raised=0.6, shift_m=(0.0, 0.1, -0.7)),
    ChangeScene("all raised", raised=1.0),
    ChangeScene("60 % lose a side, shifted", cut=0.6, shift_m=SHIFTED),
    ChangeScene("30 % raised, 30 % lose a side", raised=0.3, cut=0.3),
    *(
        ChangeScene(f"30 % lose a side, {a:g} then {b:g} points/m2", cut=0.3, densities=(a, b))
        for a, b in ((2, 2), (4, 4), (8, 8), (12, 12), (24, 24), (4, 24), (24, 2))
    ),
)


@dataclass(frozen=True)
class House:
    """A building at its place, its rise, and what of its plan lies bare."""

    id: str
    place: np.ndarray
    building: SimBuilding
    rise_m: float
    bare: shapely.Geometry

    @property
    def kind(self) -> str:
        return "part_removed" if not self.bare.is_empty else "roof_raised" if self.rise_m else ""


def draw_houses(scene: ChangeScene, seed: int) -> list[House]:
    """Draw the houses of a scene, of which the first rise and the next lose a side."""
    rng, side = np.random.default_rng([seed, SCENES.index(scene)]), int(np.sqrt(scene.houses)) + 1
    raised, cut = round(scene.raised * scene.houses), round(scene.cut * scene.houses)
    result = []
    for k in range(scene.houses):
        place = CORNER + PITCH_M * (np.array(divmod(k, side)) + 0.5)
        building = random_building(rng)
        building = draw_small(rng, building)
        x0, y0, x1, y1 = building.roof.outline.bounds
        west = x0 + rng.uniform(*KEPT) * (x1 - x0)
        is_cut = raised <= k < raised + cut
        bare = shapely.box(west, y0, x1, y1) if is_cut else shapely.Polygon()
        rise = rng.uniform(*RISES_M) if k < raised else 0.0
        result.append(House(f"house-{k}", place, building, rise, bare))
    return result


def draw_small(rng: np.random.Generator, building: SimBuilding) -> SimBuilding:
    """Return the building, or another that fits a square of the scene."""
    while max(np.ptp(np.reshape(building.roof.outline.bounds, (2, 2)), axis=0)) > PITCH_M - 8:
        building = random_building(rng)
    return building


def scan_houses(
    houses: list[House], density: float, rng: np.random.Generator, is_later: bool
) -> Scan:
    """Scan all houses and the ground between them."""
    low = np.min([house.place for house in houses], axis=0) - PITCH_M / 2
    high = np.max([house.place for house in houses], axis=0) + PITCH_M / 2
    xy = rng.uniform(low, high, (rng.poisson(density * float(np.prod(high - low))), 2))
    z, source = (xy - CORNER) @ SLOPE, np.full(len(xy), GROUND)
    for house in houses:
        near = np.flatnonzero((np.abs(xy - house.place) < PITCH_M / 2).all(axis=1))
        local = xy[near] - house.place
        heights = house.building.roof.height_at(local)
        is_roof = np.isfinite(heights)
        if is_later:
            is_roof &= ~shapely.intersects_xy(house.bare, *local.T)
            heights = heights + house.rise_m
        base = (house.place - CORNER) @ SLOPE
        z[near[is_roof]], source[near[is_roof]] = base + heights[is_roof], ROOF
    noise = rng.normal(0, [HORIZONTAL_NOISE_M, HORIZONTAL_NOISE_M, NOISE_M], (len(xy), 3))
    return Scan(np.column_stack([xy, z]) + noise, np.zeros(len(xy), int), source)


def reconstruct_city(folder: Path) -> None:
    """Reconstruct the first survey of a city from the beginning."""
    footprints = str(folder / "footprints.gpkg")
    clouds, out = (str(folder / "first.laz"),), folder / "models"
    request = Request(clouds, out, footprints, id_attribute="id", restart=True)
    reconstruct_area(request, lambda *_: None)


def update_city(folder: Path, out: str = "updated", refine: bool = False) -> UpdateSummary:
    """Update the models of a city with its second survey, from the beginning."""
    request = UpdateRequest(
        (str(folder / "second.laz"),),
        folder / out,
        run=folder / "models",
        run_parameters=str(folder / "models" / "parameters.jsonl"),
        restart=True,
        date="2024-05-01",
        refine=refine,
    )
    return update_area(request)


def read_changes(folder: Path) -> dict[str, dict[str, str]]:
    """Return the rows of an update's table of changes by id."""
    with (folder / "updated" / "changes.csv").open(encoding="utf-8") as table:
        return {row["id"]: row for row in csv.DictReader(table)}


def run_scene(scene: ChangeScene, folder: Path, seed: int, is_verbose: bool) -> Counter[str]:
    """Run and update a scene; return counts of changes, hits, right kinds and alarms."""
    folder.mkdir(parents=True, exist_ok=True)
    houses, rng = draw_houses(scene, seed), np.random.default_rng(seed + 1)
    outlines = [
        shapely.transform(house.building.roof.outline, lambda xy, p=house.place: xy + p)
        for house in houses
    ]
    ids = np.array([house.id for house in houses], object)
    wkb = shapely.to_wkb(np.array(outlines, object))
    pyogrio.raw.write(
        folder / "footprints.gpkg", wkb, [ids], ["id"], geometry_type="Polygon", crs="EPSG:28992"
    )
    for name, density in zip(("first", "second"), scene.densities, strict=True):
        cloud = scan_houses(houses, density, rng, name == "second")
        cloud = cloud.move(np.array(scene.shift_m)) if name == "second" else cloud
        write_laz(folder / f"{name}.laz", iter([cloud]), np.array([*CORNER, 0.0]))
    reconstruct_city(folder)
    summary, rows = update_city(folder), read_changes(folder)
    counts = Counter(houses=len(houses))
    for house in houses:
        row = rows.get(house.id, {"class": "unchanged", "kind": ""})
        is_found = row["class"] in ("changed", "gone", "new")
        counts["changed" if house.kind else "alarms"] += bool(house.kind) or is_found
        counts["hits"] += bool(house.kind) and is_found
        counts["right"] += bool(house.kind) and row["kind"] == house.kind
        if is_verbose and (is_found or house.kind) and house.kind != row["kind"]:
            print(f"    {house.id} {house.building.type}: {house.kind or 'nothing'} -> {row}")
    lost = measure_lost(folder / "updated", houses, is_verbose)
    counts += Counter(whole=sum(share > LEFT_WHOLE for _, share, _ in lost))
    counts += Counter(silent=sum(share > LEFT_WHOLE and good for _, share, good in lost))
    area = f", lost area {np.median([a for a, _, _ in lost]):.2f}" if lost else ""
    shift = summary.surveys.shift.clear_xyz.tolist()
    print(f"{scene.name}: {dict(counts)}{area}, taken off {shift}", flush=True)
    return counts


def measure_lost(
    folder: Path, houses: list[House], is_verbose: bool
) -> list[tuple[float, float, bool]]:
    """Return of each lost side its reported area over the true one, and what became of the model.

    That is the share of the side that the model still covers, and whether it is graded good.
    """
    records = {record["id"]: record for record in read_parameters(folder / "parameters.jsonl")}
    result = []
    for house in houses:
        outline = house.building.roof.outline
        lost = shapely.transform(outline.intersection(house.bare), lambda xy, h=house: xy + h.place)
        record = records[house.id]
        if lost.is_empty or not record["parts"]:
            continue
        model = build(record)
        area = shapely.transform(model.roof.outline, model.roof.frame.to_world)
        places = (record.get("change") or {}).get("places", [])
        reported = sum(place["area"] for place in places if place["kind"] == "part_removed")
        share = area.intersection(lost).area / lost.area
        result.append((reported / lost.area, share, model.grade is Grade.GOOD))
        if is_verbose and share > LEFT_WHOLE:
            print(f"    {house.id} {house.building.type} covers {share:.2f}: {record['detail']}")
    return result


def run_scenes(folder: Path, seeds: list[int], is_verbose: bool) -> dict[str, float]:
    """Run all scenes, and print a line each; return the figures of all."""
    total: Counter[str] = Counter()
    for seed in seeds:
        for number, scene in enumerate(SCENES):
            total += run_scene(scene, folder / f"scene_{seed}_{number}", seed, is_verbose)
    return {
        "houses": total["houses"],
        "changed": total["changed"],
        "recall": total["hits"] / total["changed"],
        "precision": total["hits"] / max(total["hits"] + total["alarms"], 1),
        "kind right": total["right"] / max(total["hits"], 1),
        "untouched houses reported": total["alarms"],
        "models left whole": total["whole"],
        "of them graded good": total["silent"],
    }
