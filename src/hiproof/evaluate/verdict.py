"""The grade of a model: good, fair or poor, with reasons.

A point off the roof that lies on one of the model's walls is a facade return and counts neither
way. All other points are roof points. Five findings speak against a model:

    off the roof    many roof points lie more than 0.2 m above or below it
    unseen          no roof point inside the outline lies near a part of it
    above, below    in a place of several square metres most points lie off the roof, or a tower
                    stands over it, farther inside than the walls of taller neighbours
    tilted          over a large part of the roof the points rise another way
    unsupported     a part of the roof has hardly any point: the model may have invented a level

Places count by their area, so that a large building hides none. Any finding makes a model fair, and
one beyond its second limit makes it poor. People judged pictures of models to choose the limits;
benchmarks/verdict.py measures how often a good model is close to the truth.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ..geometry.components import label_components
from ..geometry.grid import number_cells
from ..geometry.point_in_polygon import find_inside
from ..log import count_things
from ..model import WALL, Model
from ..model.heights import find_highest
from ..status import Doubt, Grade
from .distance import point_surface_distances
from .layers import unseen_share
from .metrics import FACADE_M, NEAR_M, list_rings, well_inside

# Share of the roof points within NEAR_M of the roof, below which a model is fair, and poor. Roofs
# of old towns that look right have 0.75 to 0.9: gutters, parapets, chimneys.
LEAST_NEAR, POOR_NEAR = 0.75, 0.6

# Share and area of the outline without roof points, above either of which a model is fair, and the
# share above which it is poor.
MOST_UNSEEN, MOST_UNSEEN_M2, POOR_UNSEEN = 0.1, 15.0, 0.4

# Height off the roof and area of a place that a person sees: a dormer for two windows.
LEVEL_M, LEVEL_M2 = 0.5, 3.0

# Share of the points in a plan cell above which it lies off the roof: along steps fewer do.
MOSTLY_OFF_SHARE = 0.5

# Rise (m) of the points' distances across a part, the share of their variance that is a slope, and
# area of such parts, from which the roof slopes another way. Terraces for a slope have these.
TILT_M, TILTED_SHARE, TILT_M2 = 0.2, 0.5, 20.0

FEWEST_TILTED = 20  # points of a part from which a slope in their distances is told

# Height (m) above the roof from which a cluster counts whatever its area; chimneys are lower.
TALL_M = 3.0

# Height (m) of the roof over a cluster from which that counts wherever LEVEL_M2 of it lie together,
# though its plan cells hold as many points on the roof: a tall step that stands in a wrong place.
DEEP_M = 2.0

# Points of a cluster: birds, and echoes that come late, are fewer in one place.
FEWEST_IN_CLUSTER = 5

# Side of the plan cells of a cluster, which touch: distances between points, were they even, and
# metres at least.
LINK_SPACINGS, LINK_M = 1.5, 1.0

POOR_CLUSTER = 0.2  # share of the outline that a cluster covers, above which a model is poor

# Roof points near a part that shows more than so many m2; with fewer its height is a guess.
FEWEST_ON_PART, SMALL_PART_M2 = 3, 1.0

# Share of the outline under parts on fewer points, above which a model is poor.
POOR_UNSUPPORTED = 0.3


class Cluster(NamedTuple):
    """Points off the roof together: their number, farthest distance and area."""

    points: int = 0
    height_m: float = 0.0
    area_m2: float = 0.0


class Evidence(NamedTuple):
    """The points' evidence about a model.

    It has the number of roof points, shares of these and of the outline, clusters, and the area of
    parts on few points.
    """

    points: int
    near: float
    unseen: float
    above: Cluster
    below: Cluster
    tilted_m2: float
    unsupported_m2: float
    area_m2: float


class Verdict(NamedTuple):
    """The grade of a model and the reasons against it; a good one has none."""

    grade: Grade
    reasons: tuple[str, ...] = ()


def judge_model(model: Model, points: np.ndarray, unused: np.ndarray | None = None) -> Verdict:
    """Return the verdict on a model by its `points` (n, 3) inside the outline.

    They are in the frame of its roof. `unused` (m, 3) are further points that were thinned out or
    called noise. They count where they lie together off the roof.
    """
    return judge_evidence(
        collect_evidence(model, points, np.zeros((0, 3)) if unused is None else unused)
    )


def judge_evidence(evidence: Evidence) -> Verdict:
    """Return the verdict on evidence.

    >>> judge_evidence(Evidence(100, 0.99, 0.0, Cluster(41, 30.2, 6.0), Cluster(), 0.0,
    ...     0.0, 80.0)).reasons
    ('41 points up to 30 m above the model',)
    """
    findings = [*share_findings(evidence), *cluster_findings(evidence), *part_findings(evidence)]
    if not findings:
        return Verdict(Grade.GOOD)
    is_poor = any(poor for poor, _ in findings)
    return Verdict(Grade.POOR if is_poor else Grade.FAIR, tuple(reason for _, reason in findings))


Finding = tuple[bool, str]  # whether it makes a model poor, and the finding in words


def share_findings(evidence: Evidence) -> list[Finding]:
    """Return findings on points off the roof and places without points."""
    result = []
    if not evidence.points:
        result.append((True, "all its points lie on its walls, none on its roof"))
    elif evidence.near < LEAST_NEAR:
        share = math.floor(100 * evidence.near)
        result.append(
            (
                evidence.near < POOR_NEAR,
                f"only {share} % of its points lie within 0.2 m of the roof",
            )
        )
    unseen_m2 = evidence.unseen * evidence.area_m2
    is_seen = evidence.unseen <= MOST_UNSEEN or unseen_m2 < LEVEL_M2
    if not is_seen or unseen_m2 > MOST_UNSEEN_M2:
        share = round(100 * evidence.unseen)
        words = f"{share} % {Doubt.PLACES_WITHOUT_POINTS.value}; the roof there is a guess"
        result.append((evidence.unseen > POOR_UNSEEN, words))
    return result


def cluster_findings(evidence: Evidence) -> list[Finding]:
    """Return findings on points that lie off the roof together."""
    sides = ((evidence.above, Doubt.POINTS_ABOVE), (evidence.below, Doubt.POINTS_BELOW))
    return [
        (
            cluster.area_m2 > POOR_CLUSTER * evidence.area_m2,
            f"{count_things(cluster.points, 'point')} up to "
            f"{cluster.height_m:.{0 if cluster.height_m >= 10 else 1}f} m {doubt.value}",
        )
        for cluster, doubt in sides
        if cluster.points
    ]


def part_findings(evidence: Evidence) -> list[Finding]:
    """Return findings on parts with another slope, or on hardly any point."""
    area, share = evidence.unsupported_m2, evidence.unsupported_m2 / evidence.area_m2
    result = []
    if evidence.tilted_m2 >= TILT_M2:
        result.append((False, f"over {evidence.tilted_m2:.0f} m² {Doubt.OTHER_SLOPE.value}"))
    if area:
        result.append(
            (share > POOR_UNSUPPORTED, f"{area:.0f} m² of its roof {Doubt.UNSUPPORTED.value}")
        )
    return result


def collect_evidence(model: Model, points: np.ndarray, unused: np.ndarray) -> Evidence:
    """Collect the evidence of `points` (n, 3) and `unused` ones (m, 3); see `judge_model`."""
    roof = model.roof
    points, unused = (p[find_inside(roof.outline, *p[:, :2].T)] for p in (points, unused))
    everything = np.concatenate([points, unused])
    z_roof, part = find_highest(roof.parts, everything[:, :2])
    floor = model.solid.vertices[:, 2].min() - roof.frame.origin[2]
    dz = everything[:, 2] - np.maximum(z_roof, floor)  # where no part is the model shows ground
    on_roof = np.abs(dz) < NEAR_M
    is_off, walls = ~on_roof, list_rings(model.solid.move(-roof.frame.origin), WALL)
    is_off[is_off] = point_surface_distances(everything[is_off], walls, FACADE_M) >= FACADE_M
    counts, area_m2 = on_roof | is_off, roof.outline.area
    mask = np.arange(len(everything)) < len(points)
    roof_points = points[counts[mask]]
    support = np.bincount(part[on_roof & mask], minlength=len(roof.parts))
    shown_m2 = np.array(model.visible_m2)
    is_guess = (shown_m2 > SMALL_PART_M2) & (support < FEWEST_ON_PART)
    spacing_m = math.sqrt(area_m2 / max(np.count_nonzero(counts), 1))
    seen, z_off = everything[counts], dz[counts]
    inner = well_inside(seen, roof.outline).holds  # without walls of taller neighbours
    tilted = [
        shown_m2[k] * is_tilted(seen[member], z_off[member])
        for k in range(len(roof.parts))
        for member in [(part[counts] == k) & (np.abs(z_off) < LEVEL_M)]
    ]
    return Evidence(
        points=len(roof_points),
        near=float(on_roof[mask].sum() / max(len(roof_points), 1)),
        unseen=unseen_share(roof_points, roof.outline),
        above=largest_cluster(seen[inner], z_off[inner], spacing_m, TALL_M),
        below=max(
            largest_cluster(seen, -z_off, spacing_m),
            largest_cluster(seen[inner], -z_off[inner], spacing_m, DEEP_M, LEVEL_M2),
        ),
        tilted_m2=float(sum(tilted)),
        unsupported_m2=float(shown_m2[is_guess].sum()),
        area_m2=area_m2,
    )


def is_tilted(points: np.ndarray, dz: np.ndarray) -> bool:
    """Return whether points (n, 3), `dz` (n,) above a part, rise another way than it."""
    if len(points) < FEWEST_TILTED:
        return False
    design = np.column_stack([points[:, :2] - points[:, :2].mean(axis=0), np.ones(len(points))])
    slope = design @ np.linalg.lstsq(design, dz, rcond=None)[0]
    return bool(np.ptp(slope) >= TILT_M and slope.var() >= TILTED_SHARE * dz.var())


def largest_cluster(
    points: np.ndarray,
    dz: np.ndarray,
    spacing_m: float,
    tall_m: float = math.inf,
    tall_m2: float = 0.0,
) -> Cluster:
    """Return the largest cluster, tall or level, of points (n, 3) above a roof.

    `dz` (n,) is how far they lie above it. It is empty if there is none. A level is where most
    points lie off the roof. Those from `tall_m` on are a tower, however few of the points there,
    over `tall_m2` at least.
    """
    result, cell_m = Cluster(), max(LINK_SPACINGS * spacing_m, LINK_M)
    cells = np.floor(points[:, :2] / cell_m)
    _, number = number_cells(cells)
    is_off = dz > LEVEL_M
    share = np.bincount(number, is_off) / np.maximum(np.bincount(number), 1)
    is_level = is_off & (share[number] >= MOSTLY_OFF_SHARE)
    for chosen, least_m2 in ((dz >= tall_m, tall_m2), (is_level, LEVEL_M2)):
        for members in clusters_in_plan(points[chosen], cell_m):
            heights = dz[chosen][members]
            cluster = Cluster(len(members), float(heights.max()), len(members) * spacing_m**2)
            if cluster.points >= FEWEST_IN_CLUSTER and cluster.area_m2 >= least_m2:
                result = max(result, cluster)
    return result


def clusters_in_plan(points: np.ndarray, cell_m: float) -> list[np.ndarray]:
    """Return indices of points (n, 3), in groups whose plan cells touch, also at corners."""
    cells, number = number_cells(np.floor(points[:, :2] / cell_m))
    touching = cKDTree(cells).query_pairs(1.5, output_type="ndarray")
    label = label_components(len(cells), touching.T)[number]
    return [np.flatnonzero(label == k) for k in range(label.max(initial=-1) + 1)]
