"""Verdicts on models against their truth.

usage: python -m benchmarks.verdict [--sources compounds essen ...] [--most 40] [--parity even|odd]
           [--densities 1 2 5 15] [--with-footprints | --without-footprints] [--wrong N]
           [--keep FOLDER] [--processes 1]

Cases (benchmarks/verdict_cases.py) are reconstructed and compared with their truth on a raster. A
model is sound if

    the RMSE of the distance between the true surface and the model's, walls included, both ways, is
    under 0.2 m, and
    no level is missing or invented: nowhere does a patch lie 0.5 m or more above, below or beside
    the truth that is 2 m2 and 2 % of the outline large and 1 m wide.

Without a footprint nothing tells that a building goes on where it has no points. There the model
may end; what it draws there is compared with the truth. Printed by density, area, source and
defect: cases; the share of sound models; how many are called good, fair and poor, and the share of
sound ones among each; and how many of the sound ones are called good. `--wrong` names cases that
are called good and are not sound. `--keep` keeps models and points in a folder; with these a
changed rule of evaluate/verdict.py is judged in seconds. Its limits were chosen on even buildings.
"""

from __future__ import annotations

import pickle
from collections import defaultdict
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
import shapely
from scipy import ndimage

from hiproof import reconstruct
from hiproof.evaluate import verdict
from hiproof.evaluate.distance import point_surface_distances
from hiproof.geometry.rings import ring_normal
from hiproof.model import ROOF, WALL, Building, Model, Solid
from hiproof.status import Grade

from .tables import FigureTable, make_parser
from .verdict_cases import PLACES, Case, iterate_cases

SOUND_RMSE_M = 0.2
STEEPEST = 0.1  # cosine of the slope: 84 degrees
LEVEL_M, LEVEL_M2, LEVEL_SHARE, LEVEL_WIDTH_M = 0.5, 2.0, 0.02, 1.0
RASTER_M, MOST_PLACES = 0.25, 6000
AREAS_M2 = (0.0, 80.0, 200.0, np.inf)

Polygons = list[list[np.ndarray]]


class Block(NamedTuple):
    """The cases of one source at one density that are reconstructed together."""

    source: str
    most: int
    density: float
    with_footprints: bool
    parity: str

    @property
    def file_name(self) -> str:
        suffix = "with" if self.with_footprints else "without"
        return f"{self.source}-{self.most}-{self.density:g}-{suffix}-{self.parity}.pickle"


@dataclass(frozen=True)
class CaseOutcome:
    """A case, what its verdict is found by, its RMSE (m) and number of wrong levels."""

    block: Block
    id: str
    defect: str
    area_m2: float
    evidence: tuple[Model, np.ndarray, np.ndarray]
    rmse: float
    wrong_levels: int

    @cached_property
    def grade(self) -> Grade:
        return verdict.judge_model(*self.evidence).grade

    @property
    def is_sound(self) -> bool:
        return self.rmse < SOUND_RMSE_M and self.wrong_levels == 0


def list_polygons(solids: Iterable[Solid], kinds: tuple[str, ...]) -> Polygons:
    """Return faces of `kinds` as lists of rings (m, 3)."""
    return [
        [solid.vertices[list(r)] for r in f.rings]
        for solid in solids
        for f in solid.faces
        if f.kind in kinds
    ]


def plan_of(rings: list[np.ndarray]) -> shapely.Geometry:
    outer, *holes = (ring[:, :2] for ring in rings)
    return shapely.make_valid(shapely.Polygon(outer, holes))


def compute_heights(polygons: Polygons, xy: np.ndarray) -> np.ndarray:
    """Return the height (n,) of the highest sloping polygon at `xy` (n, 2), or NaN."""
    z = np.full(len(xy), -np.inf)
    for rings in polygons:
        normal, centre = ring_normal(rings[0]), rings[0].mean(axis=0)
        if abs(normal[2]) <= STEEPEST * np.linalg.norm(normal):
            continue
        plan = plan_of(rings)
        shapely.prepare(plan)
        inside = shapely.contains_xy(plan, xy[:, 0], xy[:, 1])
        plane_heights = centre[2] - (xy[inside] - centre[:2]) @ normal[:2] / normal[2]
        z[inside] = np.maximum(z[inside], plane_heights)
    return np.where(np.isfinite(z), z, np.nan)


def compare_surfaces(case: Case, building: Building) -> tuple[float, int]:
    """Return the RMSE (m) between two surfaces, and the number of wrong levels."""
    origin = np.append(np.floor(shapely.get_coordinates(case.truth_area.centroid)[0]), 0.0)
    true, model = [solid.move(-origin) for solid in case.solids], [building.solid.move(-origin)]
    area, seen_area = shapely.transform(
        [case.truth_area, case.seen_area], lambda xy: xy - origin[:2]
    )
    everywhere = shapely.union_all([area, *map(plan_of, list_polygons(model, (ROOF,)))])
    step = max(RASTER_M, float(np.sqrt(everywhere.area / MOST_PLACES)))
    west, south, east, north = everywhere.bounds
    x, y = np.meshgrid(
        np.arange(west + step / 2, east, step),
        np.arange(south + step / 2, north, step),
        indexing="ij",
    )
    xy = np.column_stack([x.ravel(), y.ravel()])
    z_true = compute_heights(list_polygons(true, (ROOF,)), xy)
    z_model = compute_heights(list_polygons(model, (ROOF,)), xy)
    may_end = np.isnan(z_model) & ~shapely.contains_xy(seen_area, xy[:, 0], xy[:, 1])
    z_true[may_end | ~shapely.contains_xy(area, xy[:, 0], xy[:, 1])] = np.nan
    gaps = [
        point_surface_distances(
            np.column_stack([xy, z])[np.isfinite(z)], list_polygons(other, (ROOF, WALL))
        )
        for z, other in ((z_true, model), (z_model, true))
    ]
    is_off = (np.isfinite(z_true) != np.isfinite(z_model)) | (np.abs(z_true - z_model) >= LEVEL_M)
    wrong = find_patches(
        is_off.reshape(x.shape), step, max(LEVEL_M2, LEVEL_SHARE * case.truth_area.area)
    )
    return float(np.sqrt(np.mean(np.concatenate(gaps) ** 2))), wrong


def find_patches(is_off: np.ndarray, step: float, least_m2: float) -> int:
    """Count patches of a raster that are LEVEL_WIDTH_M wide and `least_m2` large."""
    width = max(2, round(LEVEL_WIDTH_M / step))
    wide = ndimage.binary_opening(np.pad(is_off, width), np.ones((width, width)))
    labels, count = ndimage.label(wide)
    sizes = ndimage.sum_labels(wide, labels, np.arange(1, count + 1)) * step**2
    return int(np.count_nonzero(sizes >= least_m2))


@contextmanager
def collect_evidence() -> Iterator[list[tuple[Model, np.ndarray, np.ndarray]]]:
    """Collect what verdicts are asked by inside the block."""
    judge, cases_judged = verdict.judge_model, []

    def judge_model(model: Model, points: np.ndarray, unused: np.ndarray) -> verdict.Verdict:
        cases_judged.append((model, points, unused))
        return judge(model, points, unused)

    with patch.object(verdict, "judge_model", judge_model):
        yield cases_judged


def judge_block(block: Block, folder: Path | None = None) -> list[CaseOutcome]:
    """Reconstruct and compare the cases of a block, or read them from `folder`."""
    path = folder / block.file_name if folder else None
    if path and path.exists():
        return pickle.loads(path.read_bytes())
    outcomes = []
    for case in iterate_cases(*block):
        with collect_evidence() as evidence:
            building = reconstruct(case.points, case.footprint, id=case.id)
        if building.built is not None:
            wrong = compare_surfaces(case, building)
            outcomes.append(
                CaseOutcome(block, case.id, case.defect, case.area_m2, evidence[-1], *wrong)
            )
    if path:
        path.write_bytes(pickle.dumps(outcomes))
    return outcomes


def make_cells(outcomes: list[CaseOutcome]) -> list[str]:
    """Return cases, the share of sound ones, and shares of each grade with their sound ones."""
    sound = [outcome for outcome in outcomes if outcome.is_sound]
    cells = [f"{len(outcomes)}", f"{len(sound) / len(outcomes):.3f}"]
    for grade in Grade:
        graded = [outcome.is_sound for outcome in outcomes if outcome.grade is grade]
        right = f"{np.mean(graded):.3f}" if graded else "-"
        cells.append(f"{len(graded) / len(outcomes):.3f}; {right}")
    good = [outcome.grade is Grade.GOOD for outcome in sound]
    return [*cells, f"{np.mean(good):.3f}" if good else "-"]


def group_outcomes(outcomes: list[CaseOutcome]) -> dict[str, list[CaseOutcome]]:
    """Group outcomes by density, area, source and defect; all of them come first."""
    groups = defaultdict(list, all=outcomes)
    for o in outcomes:
        lower, upper = next((a, b) for a, b in pairwise(AREAS_M2) if a <= o.area_m2 < b)
        for name in (
            f"{o.block.density:g} points/m2",
            f"{lower:g} to {upper:g} m2",
            o.block.source,
            f"defect: {o.defect}",
        ):
            groups[name].append(o)
    return groups


def main() -> None:
    parser = make_parser(
        __doc__, parity="odd", most=40, densities=[1.0, 2.0, 5.0, 15.0], processes=1
    )
    sources = ["compounds", *(name for name, path in PLACES.items() if path.is_file())]
    parser.add_argument("--sources", nargs="+", default=sources, choices=sources)
    parser.add_argument("--with-footprints", action="store_true", help="alone")
    parser.add_argument("--without-footprints", action="store_true", help="alone")
    parser.add_argument("--wrong", type=int, default=0, help="name good models that are not sound")
    parser.add_argument("--keep", type=Path, help="folder in which models and points are kept")
    a = parser.parse_args()
    footprints = (
        (True,) if a.with_footprints else (False,) if a.without_footprints else (True, False)
    )
    blocks = [
        Block(s, a.most, d, f, a.parity) for f in footprints for s in a.sources for d in a.densities
    ]
    if a.keep:
        a.keep.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(a.processes, mp_context=get_context("spawn")) as pool:
        found = [
            o for block in pool.map(judge_block, blocks, [a.keep] * len(blocks)) for o in block
        ]
    columns = (
        "footprints",
        "cases of",
        "n",
        "sound",
        *(f"{grade.name.lower()}; sound" for grade in Grade),
    )
    with FigureTable(a.record, *columns, "of sound ones good") as table:
        for with_footprints in footprints:
            reference = "with" if with_footprints else "without"
            outcomes = [o for o in found if o.block.with_footprints == with_footprints]
            for name, group in group_outcomes(outcomes).items():
                table.add(reference, name, *make_cells(group))
    wrong = [outcome for outcome in found if outcome.grade is Grade.GOOD and not outcome.is_sound]
    for o in wrong[: a.wrong]:
        reference = "with" if o.block.with_footprints else "without"
        case = f"{o.block.source} {o.id} {o.block.density:g}/m2 {reference} footprint, {o.defect}"
        print(f"{case}: RMSE {o.rmse:.2f} m, wrong levels {o.wrong_levels}")


if __name__ == "__main__":
    main()
