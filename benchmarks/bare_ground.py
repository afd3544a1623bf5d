"""Bare ground inside footprints, and footprints without a building.

usage: python -m benchmarks.bare_ground [--parity even|odd] [--count 200] [--densities 2 5 15]

Houses are scanned by simulation over sloping ground. Those with a yard of 10 to 60 m2 that is no
hole in the footprint (in the middle, at a side, at a corner where a wing was pulled down) should
have it cut out; sound ones of many kinds should not: glass roofs, passages, canopies, trees,
dormers, lost points, footprints half a metre off, low sheds. Footprints over bare ground with
rubble, bushes and trees should be found to have no building; houses, sheds and carports from 2 m
on, green roofs, houses on slopes, and decks of garages below ground should not (the last are level
with the ground, and are). Each kind is printed by density, with the classes of real clouds (3 % of
them wrong) and without classes. Constants are chosen on even seeds and reported on odd
ones. The four figures of a way are the shares (%) of sites without a building and with bare ground
cut, and the median and the 90th percentile of the error of the area left (%).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import shapely

from hiproof.city.work.found import found_roof
from hiproof.fit import site as fit_site
from hiproof.frames import LocalFrame
from hiproof.geometry.thin import thin_to_grid
from hiproof.settings import Settings
from hiproof.simulate.relief import Plane
from hiproof.simulate.roofs import box
from hiproof.simulate.scanner import Scan, ScanSettings, scan_scene
from hiproof.simulate.scene import (
    SOURCE_GROUND,
    SOURCE_ROOF,
    SOURCE_TREE,
    SOURCE_WALL,
    Body,
    Defects,
    make_scene,
)

from .tables import FigureTable, make_parser

AROUND_M = 9.0  # of ground that is scanned around a footprint
GROUND_NOISE_M = 0.03  # of ground seen inside a footprint
WRONG_CLASS = 0.03  # share of roof and ground points that have another class
LOST = replace(Defects.none(), missing_strip=0.7, partial=0.7, swath_edge=0.3, outliers=0.01)


@dataclass
class Site:
    """A footprint, what stands on and around it, and the part that is truly built on."""

    footprint: shapely.Polygon
    true: shapely.Geometry
    bodies: list[Body]
    crowns: np.ndarray = field(default_factory=lambda: np.empty((0, 5)))
    slope: Plane = field(default_factory=Plane)
    change: Callable[[np.random.Generator, Scan], Scan] | None = None
    defects: Defects = field(default_factory=Defects.none)


def make_house_body(
    rect: tuple[float, float, float, float], eave: float, rise: float, ground: Plane
) -> Body:
    """Make a house of a plan (xmin, ymin, xmax, ymax), flat or a gable along it."""
    x0, y0, x1, y1 = rect
    centre, size = np.array([(x0 + x1) / 2, (y0 + y1) / 2]), (x1 - x0, y1 - y0)
    kappa = 0.0 if size[0] >= size[1] else math.pi / 2
    z = float(ground.height_at(centre)) + eave
    return Body(box(centre, (max(size), min(size)), z + rise, kappa, rise))


def draw_slope(rng: np.random.Generator, steepest: float = 0.06) -> Plane:
    return Plane(*rng.uniform(-steepest, steepest, 2))


def draw_house(
    rng: np.random.Generator, eave: tuple[float, float] = (2.8, 9.0)
) -> tuple[np.ndarray, float, float]:
    """Draw size (2,), eave and rise of a house."""
    size = np.array([rng.uniform(10.0, 20.0), rng.uniform(9.0, 16.0)])
    return size, rng.uniform(*eave), rng.choice([0.0, rng.uniform(1.0, 3.5)])


def make_yard_site(rng: np.random.Generator, place: str) -> Site:
    """Make a house around a yard of 10 to 60 m2. `place` is court, side or corner."""
    size, eave, rise = draw_house(rng, (2.8, 7.0))
    area, ratio = rng.uniform(10.0, 60.0), rng.uniform(0.6, 1.7)
    yard = np.minimum(
        [math.sqrt(area * ratio), math.sqrt(area / ratio)],
        size - (4.5 if place == "court" else 3.0),
    )
    inner = rng.uniform(2.0, np.maximum(size - yard - 2.0, 2.0))
    corner = inner * {"court": (1.0, 1.0), "side": (1.0, 0.0), "corner": (0.0, 0.0)}[place]
    (a, b), (c, d), (w, h) = corner, corner + yard, size
    blocks = [(0, d, w, h), (0, 0, a, d), (c, 0, w, d), (a, 0, c, b)]
    ground = draw_slope(rng)
    bodies = [
        make_house_body(
            r,
            eave + rng.uniform(-0.5, 0.5),
            rise if min(r[2] - r[0], r[3] - r[1]) > 4 else 0.0,
            ground,
        )
        for r in blocks
        if r[2] - r[0] > 0.05 and r[3] - r[1] > 0.05
    ]
    footprint = shapely.box(0, 0, w, h)
    return Site(footprint, footprint - shapely.box(a, b, c, d), bodies, slope=ground)


def make_plain_site(
    rng: np.random.Generator, eave: tuple[float, float] = (2.8, 9.0), steep: float = 0.06, **more
) -> Site:
    size, eave_m, rise = draw_house(rng, eave)
    footprint, ground = shapely.box(0, 0, *size), draw_slope(rng, steep)
    body = make_house_body((0, 0, *size), eave_m, rise, ground)
    return Site(footprint, footprint, [body], slope=ground, **more)


def make_dormer_site(rng: np.random.Generator) -> Site:
    """Make a site with boxes on a roof."""
    site = make_plain_site(rng)
    x0, y0, x1, y1 = site.footprint.bounds
    for _ in range(rng.integers(1, 4)):
        corner = rng.uniform((x0 + 2, y0 + 2), (x1 - 2, y1 - 2))
        top = float(site.bodies[0].piece.height_at(corner[None])[0]) + rng.uniform(0.5, 1.8)
        site.bodies.append(Body(box(corner, tuple(rng.uniform(1.0, 3.0, 2)), top, 0.0)))
    return site


def sink_points(site: Site, area: shapely.Geometry, share: float) -> Site:
    """Let a `share` of the roof points over `area` go through the roof to the ground."""

    def change(rng: np.random.Generator, scan: Scan) -> Scan:
        inside = shapely.intersects_xy(area, *scan.points[:, :2].T) & (scan.source == SOURCE_ROOF)
        is_through = inside & (rng.random(len(scan)) < share)
        points = scan.points.copy()
        noise = rng.normal(0, GROUND_NOISE_M, is_through.sum())
        points[is_through, 2] = site.slope.height_at(points[is_through, :2]) + noise
        source = np.where(is_through, SOURCE_GROUND, scan.source)
        return replace(scan, points=points, source=source)

    site.change = change
    return site


def make_glass_site(rng: np.random.Generator) -> Site:
    """Make a glass roof over a court, of which frames and some panes return."""
    site = make_plain_site(rng)
    x0, y0, x1, y1 = site.footprint.bounds
    size = rng.uniform(3.0, 7.0, 2)
    corner = rng.uniform((x0 + 1, y0 + 1), np.maximum((x1, y1) - size - 1, (x0 + 1.1, y0 + 1.1)))
    return sink_points(site, shapely.box(*corner, *(corner + size)), rng.uniform(0.3, 0.85))


def make_passage_site(rng: np.random.Generator) -> Site:
    """Make a way through a house, whose ground is seen at either end."""
    site = make_plain_site(rng)
    x0, y0, x1, y1 = site.footprint.bounds
    start, width, deep = rng.uniform(x0 + 2, x1 - 5), rng.uniform(2.5, 4.0), rng.uniform(1.0, 2.5)
    ends = shapely.union(
        shapely.box(start, y0, start + width, y0 + deep),
        shapely.box(start, y1 - deep, start + width, y1),
    )
    return add_ground(site, ends, rng.uniform(0.3, 0.8))


def make_canopy_site(rng: np.random.Generator) -> Site:
    """Make a roof over a yard without walls, with ground seen along its open side."""
    site = make_plain_site(rng, (2.3, 4.0))
    x0, y0, x1, _ = site.footprint.bounds
    return add_ground(
        site, shapely.box(x0, y0, x1, y0 + rng.uniform(1.0, 3.0)), rng.uniform(0.2, 0.7)
    )


def add_ground(site: Site, area: shapely.Geometry, share: float) -> Site:
    """Add ground points under a roof over `area`, a `share` of the roof's density."""

    def change(rng: np.random.Generator, scan: Scan) -> Scan:
        is_above = shapely.intersects_xy(area, *scan.points[:, :2].T) & (scan.source == SOURCE_ROOF)
        ground = scan.select(is_above & (rng.random(len(scan)) < share))
        xy = ground.points[:, :2] + rng.normal(0, 0.3, (len(ground), 2))
        z = site.slope.height_at(xy) + rng.normal(0, GROUND_NOISE_M, len(xy))
        points = np.concatenate([scan.points, np.column_stack([xy, z])])
        source = np.concatenate([scan.source, np.full(len(ground), SOURCE_GROUND, np.int8)])
        return Scan(points, np.concatenate([scan.label, ground.label]), source)

    site.change = change
    return site


def draw_crowns(
    rng: np.random.Generator, footprint: shapely.Polygon, count: int, inside: bool
) -> np.ndarray:
    x0, y0, x1, y1 = footprint.bounds
    rows = []
    for _ in range(count):
        places = (
            rng.uniform((x0, y0), (x1, y1))
            if inside
            else rng.choice([(x0, y0), (x1, y1), (x0, y1), (x1, y0)])
        )
        radius, half = rng.uniform(1.0, 3.5), rng.uniform(1.0, 4.0)
        rows.append((*(places + rng.normal(0, 1, 2)), rng.uniform(0.5, 4.0) + half, radius, half))
    return np.array(rows).reshape(-1, 5)


def make_tree_site(rng: np.random.Generator) -> Site:
    """Make a house with a footprint up to 1.2 m too wide, and trees over its corners."""
    site = make_plain_site(rng)
    x0, y0, x1, y1 = site.footprint.bounds
    wide = shapely.box(x0, y0, x1 + rng.uniform(0.3, 1.2), y1)
    return Site(wide, site.footprint, site.bodies, draw_crowns(rng, wide, 3, False), site.slope)


def shift_footprint(rng: np.random.Generator) -> Site:
    """Make a footprint that lies 0.3 to 0.9 m beside its house."""
    site = make_plain_site(rng)
    shift = rng.choice([-1, 1], 2) * rng.uniform(0.2, 0.65, 2)
    moved = shapely.transform(site.footprint, lambda xy: xy + shift)
    return Site(moved, moved & site.footprint, site.bodies, slope=site.slope)


def remove_house(rng: np.random.Generator, steep: float = 0.06) -> Site:
    """Make ground where a house stood, with heaps, bushes and up to two trees."""
    site = make_plain_site(rng, steep=steep)
    x0, y0, x1, y1 = site.footprint.bounds
    bodies = []
    for _ in range(rng.integers(0, 6)):
        corner, size = rng.uniform((x0, y0), (x1, y1)), rng.uniform(1.0, 4.0, 2)
        z = float(site.slope.height_at(corner)) + rng.uniform(0.3, 2.5)
        bodies.append(
            Body(box(corner, tuple(size), z, rng.uniform(0, 3)), SOURCE_WALL, SOURCE_WALL)
        )
    trees = draw_crowns(rng, site.footprint, int(rng.integers(0, 3)), True)
    return Site(site.footprint, shapely.Polygon(), bodies, trees, site.slope)


def make_shed_site(
    rng: np.random.Generator, height: tuple[float, float], share_below: float = 0.0
) -> Site:
    """Make a shed of 10 to 40 m2 or, with ground seen below it, a carport."""
    size, ground = rng.uniform((3.0, 3.3), (5.5, 7.0)), draw_slope(rng)
    footprint = shapely.box(0, 0, *size)
    body = make_house_body((0, 0, *size), rng.uniform(*height), rng.choice([0.0, 0.4]), ground)
    site = Site(footprint, footprint, [body], slope=ground)
    return add_ground(site, footprint, share_below * rng.random()) if share_below else site


def make_green_roof_site(rng: np.random.Generator) -> Site:
    """Make a low flat roof with plants, heights scattered by up to 0.3 m."""
    site = make_plain_site(rng, (2.2, 4.0))

    def change(rng: np.random.Generator, scan: Scan) -> Scan:
        roof = scan.source == SOURCE_ROOF
        plants = np.outer(roof * rng.exponential(0.15, len(scan)), (0, 0, 1))
        return replace(scan, points=scan.points + plants)

    site.change = change
    return site


def make_block_site(rng: np.random.Generator) -> Site:
    """Make a closed block of houses around a yard of 1/3 to 2/3 of its plan."""
    (w, h), deep = rng.uniform(24.0, 40.0, 2), rng.uniform(4.0, 9.0)
    ground, eave = draw_slope(rng), rng.uniform(4.0, 9.0)
    rows = [
        (0, 0, w, deep),
        (0, h - deep, w, h),
        (0, deep, deep, h - deep),
        (w - deep, deep, w, h - deep),
    ]
    footprint = shapely.box(0, 0, w, h)
    bodies = [make_house_body(rect, eave, rng.choice([0.0, 2.0]), ground) for rect in rows]
    yard = shapely.box(deep, deep, w - deep, h - deep)
    return Site(footprint, footprint - yard, bodies, slope=ground)


YARDS = {
    f"yard: {place}": (lambda rng, p=place: make_yard_site(rng, p))
    for place in ("court", "side", "corner")
}
YARDS["yard of a block"] = make_block_site
SOUND = {
    "plain": make_plain_site,
    "lost points": lambda rng: make_plain_site(rng, defects=LOST),
    "dormers": make_dormer_site,
    "glass roof": make_glass_site,
    "passage": make_passage_site,
    "canopy": make_canopy_site,
    "under trees": make_tree_site,
    "footprint beside": shift_footprint,
    "green roof": make_green_roof_site,
    "slope": lambda rng: make_plain_site(rng, (3.5, 6.0), 0.35),  # to 35 %, its eaves level
    "shed 1.8-2.5 m": lambda rng: make_shed_site(rng, (1.8, 2.5)),
    "carport": lambda rng: make_shed_site(rng, (2.0, 2.5), 0.5),
}
GONE = {
    "gone": remove_house,
    "gone, slope to 25 %": lambda rng: remove_house(rng, 0.25),
    "garage deck": lambda rng: make_plain_site(rng, (0.0, 1.2)),  # of one below ground
}


def scan_site(site: Site, density: float, rng: np.random.Generator) -> Scan:
    settings = ScanSettings(density=density, margin_m=0.0, defects=site.defects)
    scene = make_scene(site.bodies, site.crowns, site.slope)
    scan = scan_scene(scene, site.footprint.buffer(AROUND_M, quad_segs=2), 3.0, rng, settings)
    return site.change(rng, scan) if site.change else scan


def judge_classified(site: Site, scan: Scan, rng: np.random.Generator) -> fit_site.Site:
    """Judge a cloud whose roofs, ground and trees have classes, few wrong."""
    right = rng.random(len(scan)) >= WRONG_CLASS
    roof, ground = (
        scan.points[(scan.source == source) & right] for source in (SOURCE_ROOF, SOURCE_GROUND)
    )
    leaves = np.unique(np.floor(scan.points[scan.source == SOURCE_TREE, :2]), axis=0)
    ground = thin_to_grid(ground, 1.0)
    bare = ~(np.floor(ground[:, None, :2]) == leaves[None]).all(axis=2).any(axis=1)
    return judge_roof(site, roof, ground[bare])


def judge_unclassified(site: Site, scan: Scan, rng: np.random.Generator) -> fit_site.Site:
    """Judge a cloud without classes, whose roofs are found by shape."""
    height = scan.points[:, 2] - site.slope.height_at(scan.points[:, :2])
    is_roof = found_roof(scan.points, site.footprint, height, True)
    if not is_roof.is_seen:
        return fit_site.Site(is_roof.points, site.footprint, is_roof.remark, is_roof.is_ground)
    return judge_roof(site, is_roof.points, is_roof.ground)


def judge_one_class(site: Site, scan: Scan, rng: np.random.Generator) -> fit_site.Site:
    """Judge a cloud whose only class is taken for the building class."""
    return judge_roof(site, scan.points, np.zeros((0, 3)))


def judge_roof(site: Site, roof: np.ndarray, ground: np.ndarray) -> fit_site.Site:
    inside = shapely.intersects_xy(site.footprint, roof[:, 0], roof[:, 1])
    if not inside.any():
        return fit_site.Site(roof[inside], site.footprint, "no points")
    return fit_site.look_at_ground(
        roof[inside], site.footprint, ground, LocalFrame(np.zeros(3)), Known(site.slope), Settings()
    )


@dataclass(frozen=True)
class Known:
    """The ground of a site as a terrain."""

    slope: Plane
    source: str = "the site's ground"

    def height_at(self, xy: np.ndarray) -> np.ndarray:
        return self.slope.height_at(xy[:, :2])


WAYS = {
    "with classes": judge_classified,
    "without classes": judge_unclassified,
    "one class": judge_one_class,
}


def make_cells(make: Callable, key: int, density: float, seeds: range) -> list[str]:
    """Return the four figures of each way in which a kind of site is judged."""
    outcomes: dict[str, list] = {way: [] for way in WAYS}
    for seed in seeds:
        rng = np.random.default_rng([seed, key, round(10 * density)])
        site = make(rng)
        scan = scan_site(site, density, rng)
        for way, look in WAYS.items():
            verdict = look(site, scan, rng)
            is_cut = not verdict.is_empty and verdict.outline.area < 0.999 * site.footprint.area
            is_known = not verdict.is_empty and not site.true.is_empty
            shifted = abs(verdict.outline.area / site.true.area - 1) if is_known else 0.0
            is_gone = verdict.is_empty or verdict.remark == "no points"
            outcomes[way].append((is_gone, is_cut, shifted))
    text = []
    for rows in outcomes.values():
        empty, cut, shifted = np.array(rows, float).T
        errors = f"{100 * np.median(shifted):.1f}; {100 * np.quantile(shifted, 0.9):.1f}"
        text.append(f"{100 * empty.mean():.1f}; {100 * cut.mean():.1f}; {errors}")
    return text


def main() -> None:
    parser = make_parser(__doc__, parity="odd", count=200, densities=[2.0, 5.0, 15.0])
    parser.add_argument("--kinds", default="", help="only kinds whose name holds this")
    a = parser.parse_args()
    seeds = range(int(a.parity == "odd"), 2 * a.count, 2)
    with FigureTable(a.record, "kind", "points/m2", *WAYS) as table:
        for key, (name, make) in enumerate((YARDS | SOUND | GONE).items()):
            for density in a.densities if a.kinds in name else ():
                table.add(name, density, *make_cells(make, key, density, seeds))


if __name__ == "__main__":
    main()
