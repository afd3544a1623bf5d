"""An airborne laser scanner over simulated buildings and solids, with real clouds' faults."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import shapely

from ..errors import InputError
from ..model import Solid
from .flight import Beams, join_beams, make_beams, random_swaths
from .raycast import cast_convex, cast_crowns, cast_triangles
from .roofs import NOT_ROOF, SimBuilding, find_label
from .scene import (
    SOURCE_CLUTTER,
    SOURCE_GROUND,
    SOURCE_TREE,
    Defects,
    Scene,
    random_scene,
    solids_scene,
)

MERGED_RETURNS_M = 0.6  # m; a pulse of some nanoseconds cannot tell surfaces nearer to each other
LEAF_PATH_M = 1.8  # m that a beam goes through leaves on average before it meets one


@dataclass(frozen=True)
class ScanSettings:
    """The scanner.

    `density` (points/m2 in plan, all swaths together), one-sigma noises (m) along the beam and in
    plan, the beam's radius on the ground (m), the largest scan angle (deg), the registration error
    between swaths (m), how far around the outline points are kept (m), and the defects'
    probabilities.
    """

    density: float = 5.0
    range_noise_m: float = 0.025
    horizontal_noise_m: float = 0.05
    beam_radius_m: float = 0.12
    max_scan_angle_deg: float = 20.0
    registration_m: float = 0.03
    margin_m: float = 1.0
    defects: Defects = field(default_factory=Defects)


@dataclass(frozen=True)
class Scan:
    """Scanned `points` (n, 3), world metres, with labels and sources.

    `label` (n,) index into the catalogue, NOT_ROOF for all else; `source` (n,) index into SOURCES
    (roof, wall, ground, tree, clutter).
    """

    points: np.ndarray
    label: np.ndarray
    source: np.ndarray

    def __len__(self) -> int:
        return len(self.points)

    def select(self, keep: np.ndarray) -> Scan:
        return Scan(self.points[keep], self.label[keep], self.source[keep])

    def move(self, shift: np.ndarray) -> Scan:
        return Scan(self.points + shift, self.label, self.source)


def scan(
    building: SimBuilding, rng: np.random.Generator, settings: ScanSettings | None = None
) -> Scan:
    """Scan one building with what stands around it.

    >>> from hiproof.simulate import random_building, scan
    >>> rng = np.random.default_rng(0)
    >>> cloud = scan(random_building(rng, "gable"), rng)
    >>> cloud.points.shape[1], int(cloud.label.max())
    (3, 2)
    """
    settings = check_settings(settings or ScanSettings())
    scene = random_scene(rng, building, settings.defects)
    outline = (
        building.outline
        if settings.margin_m == 0
        else building.outline.buffer(settings.margin_m, quad_segs=2)
    )
    z_roof = building.roof.parts[0].translation[2]
    return scan_scene(scene, outline, z_roof, rng, settings).move(building.roof.frame.origin)


def scan_solids(
    solids: list[Solid],
    rng: np.random.Generator,
    settings: ScanSettings | None = None,
    types: list[str | None] | None = None,
) -> Scan:
    """Scan solids of any origin, all in one frame.

    Their RoofSurfaces are labelled with `types` (names of the catalogue; None or an unknown name
    gives NOT_ROOF but still the source "roof"). The terrain is level at the solids' lowest height.
    Of the defects only the scanner's own happen (missing strips, swath edges, partial roofs,
    outliers). Raises InputError without solids.
    """
    settings = check_settings(settings or ScanSettings())
    if not solids:
        raise InputError(
            "expected at least one solid to scan, got none; check the file that was read"
        )
    types = [None] * len(solids) if types is None else types
    labels = [find_label(type) for type in types]
    vertices = np.concatenate([solid.vertices for solid in solids])
    origin = np.append(np.round(vertices[:, :2].mean(axis=0)), vertices[:, 2].min())
    scene = solids_scene([solid.move(-origin) for solid in solids], labels)
    cells = shapely.polygons(scene.triangles[:, :, :2])
    plan = shapely.union_all(cells[shapely.area(cells) > 1e-6])
    height = float(vertices[:, 2].max() - origin[2])
    return scan_scene(
        scene, plan.buffer(settings.margin_m, quad_segs=2), height / 2, rng, settings
    ).move(origin)


def scan_scene(
    scene: Scene,
    area: shapely.Geometry,
    z_ref: float,
    rng: np.random.Generator,
    settings: ScanSettings,
) -> Scan:
    """Scan `area`, in plan of the scene's frame, with noise and the cloud's defects."""
    x_low, y_low, x_high, y_high = area.bounds
    centre = np.array([(x_low + x_high) / 2, (y_low + y_high) / 2])
    reach = math.hypot(x_high - x_low, y_high - y_low) / 2
    tan_max = math.tan(math.radians(settings.max_scan_angle_deg))
    defects = settings.defects
    swaths = random_swaths(
        rng, settings.density, tan_max, settings.registration_m, defects.swath_edge, reach / 2
    )
    radius = reach + tan_max * z_ref
    beams = [make_beams(rng, swath, centre, radius, z_ref) for swath in swaths]
    if rng.random() < defects.missing_strip:
        beams[0] = without_strip(rng, beams[0], swaths[0].heading, centre, reach)
    cloud = returns(scene, join_beams(beams), rng, settings)
    cloud = cloud.select(shapely.contains_xy(area, cloud.points[:, :2]))
    if rng.random() < defects.partial and len(cloud):
        cloud = without_corner(rng, cloud, centre, reach)
    if defects.outliers > 0 and len(cloud):
        cloud = with_outliers(rng, cloud, defects.outliers)
    return cloud


class Hits(NamedTuple):
    """What beams meet: the height (n,), its source and its label (n,)."""

    z: np.ndarray
    source: np.ndarray
    label: np.ndarray

    def select(self, keep: np.ndarray) -> Hits:
        return Hits(*(values[keep] for values in self))


def returns(scene: Scene, beams: Beams, rng: np.random.Generator, settings: ScanSettings) -> Scan:
    """Return the points of all beams.

    A wide beam mixes the heights of two near surfaces and splits over two far ones; leaves catch
    some of the light and let the rest through.
    """
    hits = first_hits(scene, beams.xy0, beams.slope)
    if settings.beam_radius_m > 0:
        n = len(beams)
        perpendicular = rng.normal(0.0, settings.beam_radius_m / 2, (n, 2))
        aside = first_hits(scene, beams.xy0 + perpendicular, beams.slope)
        share = rng.uniform(0.5, 1.0, n)
        mask = np.abs(aside.z - hits.z) < MERGED_RETURNS_M
        split = np.flatnonzero(~mask & (rng.random(n) < 0.4))
        hits = hits._replace(z=np.where(mask, share * hits.z + (1 - share) * aside.z, hits.z))
        hits = Hits(*map(np.append, hits, aside.select(split)))
        beams = beams.select(np.append(np.arange(n), split))
    if len(scene.crowns):
        hits, beams = catch_by_leaves(scene, beams, hits, rng)
    noise = rng.standard_normal((len(beams), 3))
    points = np.empty((len(beams), 3))
    xy = beams.xy0 + beams.slope * hits.z[:, None]
    points[:, :2] = xy + settings.horizontal_noise_m * noise[:, :2]
    points[:, 2] = hits.z + settings.range_noise_m * noise[:, 2]
    return Scan(points + beams.shift, hits.label, hits.source)


def first_hits(scene: Scene, xy0: np.ndarray, slope: np.ndarray) -> Hits:
    """Return what beams meet first, else the terrain."""
    z_hit, face = scene.terrain.hit(xy0, slope), np.full(len(xy0), -1)
    cast_convex(xy0, slope, scene.halfspaces, scene.starts, scene.discs, z_hit, face)
    cast_triangles(xy0, slope, scene.triangles, z_hit, face, len(scene.halfspaces))
    # the last of the kinds is that of the terrain
    source, label = np.append(scene.source, SOURCE_GROUND), np.append(scene.label, NOT_ROOF)
    return Hits(z_hit, source[face].astype(np.int8), label[face].astype(np.int8))


def catch_by_leaves(
    scene: Scene, beams: Beams, hits: Hits, rng: np.random.Generator
) -> tuple[Hits, Beams]:
    """Add leaves' returns and their beams; a third return from below, too."""
    n = len(beams)
    z_crown = np.full(n, -np.inf)
    free_path = rng.exponential(LEAF_PATH_M, n)
    cast_crowns(beams.xy0, beams.slope, scene.crowns, free_path, z_crown)
    caught = z_crown > hits.z
    mask = ~caught | (rng.random(n) < 0.33)
    selection = np.concatenate([np.flatnonzero(caught), np.flatnonzero(mask)])
    leaves, result = int(caught.sum()), hits.select(selection)
    result.z[:leaves], result.source[:leaves] = z_crown[caught], SOURCE_TREE
    result.label[:leaves] = NOT_ROOF
    return result, beams.select(selection)


def without_strip(
    rng: np.random.Generator, beams: Beams, heading: float, centre: np.ndarray, reach: float
) -> Beams:
    """Drop some scan lines: a band of 0.8 to 3 m across the flight."""
    along = (beams.xy0 - centre) @ (math.cos(heading), math.sin(heading))
    start, width = rng.uniform(-0.7, 0.7) * reach, rng.uniform(0.8, 3.0)
    return beams.select((along < start) | (along > start + width))


def without_corner(rng: np.random.Generator, cloud: Scan, centre: np.ndarray, reach: float) -> Scan:
    """Drop the points of a disc near the roof's edge that is wet, dark or hidden."""
    angle, radius = rng.uniform(-math.pi, math.pi), reach * rng.uniform(0.25, 0.6)
    middle = centre + 0.8 * reach * np.array([math.cos(angle), math.sin(angle)])
    keep = ((cloud.points[:, :2] - middle) ** 2).sum(axis=1) > radius**2
    return cloud.select(keep) if keep.sum() > 0.4 * len(keep) else cloud


def with_outliers(rng: np.random.Generator, cloud: Scan, share: float) -> Scan:
    """Add a few returns from birds above and multiple reflections below."""
    count = rng.poisson(share * len(cloud))
    position = cloud.points[rng.integers(len(cloud), size=count)] + rng.normal(
        0.0, 1.0, (count, 3)
    ) * (0.3, 0.3, 3.0)
    points = np.concatenate([cloud.points, position])
    label = np.concatenate([cloud.label, np.full(count, NOT_ROOF, np.int8)])
    return Scan(
        points, label, np.concatenate([cloud.source, np.full(count, SOURCE_CLUTTER, np.int8)])
    )


def uniform_points(
    building: SimBuilding, rng: np.random.Generator, density: float = 4.72, noise: float = 0.12
):
    """Draw points (n, 3), world metres, as in the paper's Table 3.

    They lie evenly over the outline, on the roof, with vertical errors whose size is uniform within
    1 `noise` for 90 %, within 1-2 for 9 % and within 2-3 for 1 % of the points.
    """
    outline = building.outline
    x_low, y_low, x_high, y_high = outline.bounds
    count = rng.poisson(density * (x_high - x_low) * (y_high - y_low))
    xy = rng.uniform((x_low, y_low), (x_high, y_high), (count, 2))
    xy = xy[shapely.contains_xy(outline, xy[:, :2])]
    band = rng.choice(3, size=len(xy), p=(0.90, 0.09, 0.01))
    error = (band + rng.random(len(xy))) * noise * rng.choice((-1.0, 1.0), len(xy))
    return np.column_stack([xy, building.roof.height_at(xy) + error]) + building.roof.frame.origin


def check_settings(settings: ScanSettings) -> ScanSettings:
    """Return `settings`, or raise InputError where no scanner can have them."""
    if not 0.05 <= settings.density <= 1000:
        raise InputError(
            f"expected a density of 0.05 to 1000 points/m2, got {settings.density}; 1 to 20 is "
            "usual"
        )
    lengths = (
        settings.range_noise_m,
        settings.horizontal_noise_m,
        settings.beam_radius_m,
        settings.margin_m,
    )
    if not all(0 <= length < math.inf for length in lengths):
        raise InputError(
            f"expected noise, beam radius and margin of 0 m or more, got {settings}; 0 switches "
            "them off"
        )
    if not 0 <= settings.max_scan_angle_deg <= 45:
        raise InputError(
            f"expected a scan angle of 0 to 45 degrees, got {settings.max_scan_angle_deg}; 20 is "
            "usual"
        )
    return settings
