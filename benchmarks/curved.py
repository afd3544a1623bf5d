"""Cones, half cones, spires, domes, barrel vaults, slim towers and drums that are found.

usage: python -m benchmarks.curved [--count 16] [--first-seed 100] [--densities 8 2]

The last rows count slim towers of 3 by 3 m, 3 to 15 m above the ridge of such a house, that the
roof has within 0.3 m of their height, and drums of which 97 % of the plan are within 0.3 m. Drums
are level discs in the corner of such a house, in its middle, and higher or lower in the middle of
another, of which they leave a ring.

Each kind stands alone over its own outline, on a square or rectangular base that is a little larger
(a tower), and as a turret in the corner of a house with a gable. Half cones roof apses at the gable
end of such a house. Sizes are those that are built (`draw` of the catalogue): spires of 55 to 78
degrees, cones of 25 to 72, arcs of a third to a whole half circle, 3 to 10 m wide, and turrets and
apses of at most 6 m. Outlines follow the plans, so turrets and apses show in them. A scene counts
as right if the roof has a part of its kind. The last column is 1.48 times the median error of that
part's height over its standard deviation: 1 where this is true. Heights are those of the highest
point, and volumes those under the shape.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from hiproof.fit.roof import fit_building
from hiproof.model import Part
from hiproof.model.heights import find_highest
from hiproof.primitives import CATALOGUE
from hiproof.primitives.catalogue import ROUND

from .tables import FigureTable, make_parser

KINDS = {
    "alone": (*ROUND, "barrel"),
    "tower": (*ROUND, "barrel"),
    "turret": ROUND,
    "apse": ("half_cone",),
}
HOUSE_LENGTH_M, HOUSE_WIDTH_M = 14.0, 9.0  # Of the house with a turret.
HOUSE_EAVE_M, HOUSE_SLOPE = 6.0, 0.9
SHAPE_EAVE_M, APSE_EAVE_M = 10.0, 5.0  # Height of the curved shape's eave.
BASE_WIDER = 1.02  # A tower is so much wider than its spire.
NOISE_M, PLAN_NOISE_M = 0.03, 0.05
TOWER_M = 3.0  # Side of a slim tower.
DRUM_SETTINGS = ("turret", "in a gable", "ring")
RING_M = 10.0  # Height of the ring around a drum.
RIGHT_PLAN = 0.97  # Share of the plan of a drum, and of half a metre around it, that is right.
SIGMA = "error/sigma of height"
GRID_M = 0.1  # Distance between the places at which heights are compared.


@dataclass(frozen=True)
class CurvedScene:
    """Points (n, 3), outline, plan of the curved shape and true roof of a building."""

    kind: str
    points: np.ndarray
    outline: shapely.Polygon
    plan: shapely.Polygon
    theta: np.ndarray
    has_house: bool

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        """Return the true heights (n,) at places (n, 2) of the outline."""
        z = np.full(len(xy), SHAPE_EAVE_M)
        if self.has_house:
            z = measure_gable(xy)
            z[~shapely.contains_xy(make_house(), *xy.T)] = -np.inf
        inside = shapely.contains_xy(self.plan, *xy.T)
        shape = CATALOGUE[self.kind]
        theta_p, _, _ = shape.from_theta(self.theta)
        curved = shape.variant(theta_p).height_at(self.theta, xy[inside])
        z[inside] = np.maximum(z[inside], curved)
        return z


def make_house() -> shapely.Polygon:
    return shapely.box(0.0, 0.0, HOUSE_LENGTH_M, HOUSE_WIDTH_M)


def measure_gable(xy: np.ndarray) -> np.ndarray:
    """Return the heights (n,) of the gable of the house at places (n, 2)."""
    return HOUSE_EAVE_M + HOUSE_SLOPE * (HOUSE_WIDTH_M / 2 - np.abs(xy[:, 1] - HOUSE_WIDTH_M / 2))


def scan_roof(
    rng: np.random.Generator,
    outline: shapely.Polygon,
    density: float,
    height_at: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """Scan points (n, 3) of a roof over `outline`, with noise."""
    x0, y0, x1, y1 = outline.bounds
    xy = rng.uniform((x0, y0), (x1, y1), (rng.poisson(density * (x1 - x0) * (y1 - y0)), 2))
    xy = xy[shapely.contains_xy(outline, *xy.T)]
    z = height_at(xy) + rng.normal(0.0, NOISE_M, len(xy))
    return np.column_stack([xy + rng.normal(0.0, PLAN_NOISE_M, xy.shape), z])


def make_grid(area: shapely.Polygon, part: shapely.Polygon) -> np.ndarray:
    """Return the places (n, 2) in a part of an area at which heights are compared."""
    x0, y0, x1, y1 = area.bounds
    grid = np.stack(np.meshgrid(np.arange(x0, x1, GRID_M), np.arange(y0, y1, GRID_M)), axis=-1)
    xy = grid.reshape(-1, 2)
    return xy[shapely.contains_xy(part, *xy.T)]


def draw_scene(kind: str, setting: str, seed: int, density: float) -> CurvedScene:
    """Draw the scene of a `seed`, scanned at `density` (points/m2)."""
    rng = np.random.default_rng(seed)
    has_house = setting in ("turret", "apse")
    width = rng.uniform(3.0, 6.0 if has_house else 10.0)
    theta_p = CATALOGUE[kind].draw_parameters(rng, width)
    shape, kappa = CATALOGUE[kind].variant(theta_p), rng.uniform(0.0, 0.5 * math.pi)
    theta = shape.to_theta(theta_p, kappa, (0.0, 0.0, SHAPE_EAVE_M))
    if setting == "apse":
        place = HOUSE_LENGTH_M + 0.5 * theta_p["length"], 0.5 * HOUSE_WIDTH_M, APSE_EAVE_M
        theta = shape.to_theta(theta_p, 0.0, place)
    plan = outline = shape.part(theta).pieces[0].outline
    if setting == "tower":
        u, v = (BASE_WIDER * 0.5 * theta_p[name] for name in ("length", "width"))
        c, s = math.cos(kappa), math.sin(kappa)
        ring = np.array([(-u, -v), (u, -v), (u, v), (-u, v)]) @ np.array([[c, s], [-s, c]])
        outline = shapely.union(shapely.Polygon(ring), plan)
    elif has_house:
        outline = shapely.union(make_house(), plan)
    scene = CurvedScene(kind, np.zeros((0, 3)), outline, plan, theta, has_house)
    return replace(scene, points=scan_roof(rng, outline, density, scene.height_at))


@dataclass(frozen=True)
class CurvedOutcome:
    """Whether the kind is right, and the errors of height (m) and volume (share).

    The error of the part's own height is in its standard deviations, NaN without one such part.
    """

    is_right: bool
    height_error_m: float
    volume_error: float
    height_sigmas: float


def judge_scene(scene: CurvedScene) -> CurvedOutcome:
    """Fit the building of a scene, and compare it with the truth."""
    return judge_parts(scene, fit_building(scene.points, scene.outline).roof_parts)


def judge_parts(scene: CurvedScene, parts: Sequence[Part]) -> CurvedOutcome:
    """Compare the parts found in a scene with the truth."""
    xy = make_grid(scene.plan, scene.plan.intersection(scene.outline))
    true, found = scene.height_at(xy), find_highest(parts, xy)[0]
    of_kind = [part for part in parts if part.type == scene.kind]
    height = CATALOGUE[scene.kind].from_theta(scene.theta)[0]["height"]
    scores = [(part.parameters["height"] - height) / part.sigma["height"] for part in of_kind]
    return CurvedOutcome(
        bool(of_kind),
        float(found.max() - true.max()),
        float(found.sum() / true.sum() - 1.0),
        scores[0] if len(scores) == 1 else math.nan,
    )


def is_slim_tower_found(seed: int, density: float) -> bool:
    """Return whether the fitted roof of a house has its tower of 3 by 3 m."""
    rng = np.random.default_rng(seed)
    house, ridge = make_house(), HOUSE_EAVE_M + HOUSE_SLOPE * HOUSE_WIDTH_M / 2
    x, y = rng.uniform((0.0, 0.0), (HOUSE_LENGTH_M - TOWER_M, HOUSE_WIDTH_M - TOWER_M))
    tower, top = shapely.box(x, y, x + TOWER_M, y + TOWER_M), ridge + rng.uniform(3.0, 15.0)

    def height_at(xy: np.ndarray) -> np.ndarray:
        return np.where(shapely.contains_xy(tower, *xy.T), top, measure_gable(xy))

    parts = fit_building(scan_roof(rng, house, density, height_at), house).roof_parts
    middle = shapely.get_coordinates(tower.centroid)
    return bool(abs(find_highest(parts, middle)[0][0] - top) <= 0.3)


def draw_drum(setting: str, rng: np.random.Generator) -> tuple[shapely.Polygon, float]:
    """Draw the plan and the height of a drum on a house or in another drum."""
    if setting == "ring":
        step = float(rng.choice([-1.0, 1.0]) * rng.uniform(1.0, 4.0))
        return make_disc(0.0, 0.0, rng.uniform(2.0, 7.0)), RING_M + step
    middle = (0.0, 0.0) if setting == "turret" else (rng.uniform(4.0, 10.0), 0.5 * HOUSE_WIDTH_M)
    return make_disc(*middle, rng.uniform(1.5, 3.0)), rng.uniform(11.0, 16.0)


def make_disc(x: float, y: float, radius: float) -> shapely.Polygon:
    return shapely.buffer(shapely.Point(x, y), radius, quad_segs=8)


def is_drum_found(setting: str, seed: int, density: float) -> bool:
    """Return whether a fitted roof has its drum."""
    rng = np.random.default_rng(seed)
    plan, top = draw_drum(setting, rng)
    around = shapely.buffer(plan, rng.uniform(2.0, 5.0)) if setting == "ring" else make_house()
    outline = shapely.union(around, plan)

    def height_at(xy: np.ndarray) -> np.ndarray:
        z = RING_M if setting == "ring" else measure_gable(xy)
        return np.where(shapely.contains_xy(plan, *xy.T), top, z)

    parts = fit_building(scan_roof(rng, outline, density, height_at), outline).roof_parts
    places = make_grid(outline, shapely.intersection(shapely.buffer(plan, 0.5), outline))
    right = np.abs(find_highest(parts, places)[0] - height_at(places)) <= 0.3
    return bool(right.mean() >= RIGHT_PLAN)


def main() -> None:
    parser = make_parser(__doc__, count=16, first_seed=100, densities=[8.0, 2.0])
    parser.add_argument("--kinds", nargs="*", help="only these")
    a = parser.parse_args()
    seeds = range(a.first_seed, a.first_seed + a.count)
    columns = ("points/m2", "setting", "kind", "right, %", "in height, %", "in volume, %", SIGMA)
    with FigureTable(a.record, *columns) as table:
        for density in a.densities:
            for setting, kinds in KINDS.items():
                for kind in kinds if not a.kinds else set(kinds) & set(a.kinds):
                    outcomes = [judge_scene(draw_scene(kind, setting, s, density)) for s in seeds]
                    right = [
                        (o.is_right, abs(o.height_error_m) <= 0.2, abs(o.volume_error) <= 0.03)
                        for o in outcomes
                    ]
                    ratio = 1.48 * np.nanmedian([abs(o.height_sigmas) for o in outcomes])
                    table.add(density, setting, kind, *(100.0 * np.mean(right, axis=0)), ratio)
            found = [is_slim_tower_found(seed, density) for seed in seeds]
            table.add(density, "slim tower", "", 100.0 * np.mean(found), "", "", "")
            for setting in DRUM_SETTINGS:
                found = [is_drum_found(setting, seed, density) for seed in seeds]
                table.add(density, setting, "drum", 100.0 * np.mean(found), "", "", "")


if __name__ == "__main__":
    main()
