"""Figure 8: RANSAC plane detection against the parametric fit.

Hip roofs have points that get worse.

For every roof: how many of its four planes are found, how many found planes are wrong or doubles,
and whether a closed model comes out. Planes make a closed model only when each true face is found
once and nothing else is; the parametric fit is closed by construction, so of it we ask that its
four faces are the true ones by the same measure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hiproof.primitives import CATALOGUE
from hiproof.primitives.contract import place_vertices
from hiproof.simulate import SimBuilding, random_building, uniform_points

from .methods import fit_model, run_in_parallel
from .output import Options, Result, Table
from .ransac import DetectedPlane, detect_planes, fit_least_squares_plane, is_available, match_faces

LEVELS = {
    "density, points/m2": (10.0, 5.0, 2.0, 1.0, 0.5),
    "noise, m": (0.02, 0.1, 0.2, 0.3, 0.5),
    "missing share at a corner": (0.0, 0.2, 0.4, 0.6),
}
BASE_DENSITY, BASE_NOISE_M = 4.72, 0.12
COLUMNS = (
    "what",
    "level",
    "method",
    "faces found of 4",
    "wrong planes",
    "closed and right, share of roofs",
)


def run(options: Options) -> Result:
    """Run one axis of trouble at a time, both methods on the same points."""
    if not is_available():
        remark = (
            "Not run: it needs pyransac3d, the extra `experiments` (pip install "
            "'hiproof[experiments]')."
        )
        return Result("against RANSAC plane detection", "none", (), remarks=remark)
    roofs = 1 if options.quick else 40
    rows = []
    for kind, levels in LEVELS.items():
        for level in levels[-2:] if options.quick else levels:
            for method in ("ransac", "likelihood"):
                work = [(method, kind, level, options.seed, roof) for roof in range(roofs)]
                errors, wrong, closed = np.array(
                    run_in_parallel(match_planes, work, options.jobs), float
                ).T
                rows.append(
                    (
                        kind,
                        level,
                        method,
                        float(errors.mean()),
                        float(wrong.mean()),
                        float(closed.mean()),
                    )
                )
    note = (
        "A face is found when a plane lies within 10 degrees and 0.3 m (at its centre) of it; a "
        "double is wrong. RANSAC's "
        "threshold is 0.2 m throughout; twice the noise, as it would be told, found fewer."
    )
    data = (
        f"{roofs} simulated hip roofs a level; otherwise {BASE_DENSITY} points/m2 and noise "
        f"{BASE_NOISE_M} m"
    )
    table = Table("Planes found on hip roofs", COLUMNS, rows, note)
    return Result("against RANSAC plane detection", data, (table,), {"fig8": draw_picture(rows)})


@dataclass(frozen=True)
class Trouble:
    """What is done to the points of one roof."""

    density: float = BASE_DENSITY
    noise_m: float = BASE_NOISE_M
    missing_share: float = 0.0

    @classmethod
    def of(cls, kind: str, level: float) -> Trouble:
        name = {"density, points/m2": "density", "noise, m": "noise_m"}.get(kind, "missing_share")
        return cls(**{name: level})

    def points(self, building: SimBuilding, rng: np.random.Generator) -> np.ndarray:
        return remove_corner(
            uniform_points(building, rng, self.density, self.noise_m), building, self.missing_share
        )


def remove_corner(points: np.ndarray, building: SimBuilding, share: float) -> np.ndarray:
    """Remove the share of points (n, 3) nearest to one corner.

    A tree's crown hides points so.

    Distances are in units of the sides, so that the same parts of both sides remain whatever the
    roof's proportions.
    """
    part = building.roof.parts[0]
    uv = turn_back(
        points[:, :2] - building.roof.frame.origin[:2] - part.translation[:2], part.kappa
    )
    uv = uv / [part.parameters["length"], part.parameters["width"]]
    order = np.argsort(np.linalg.norm(uv - 0.5, axis=1), kind="stable")
    return points[np.sort(order[int(share * len(points)) :])]


def turn_back(xy: np.ndarray, kappa: float) -> np.ndarray:
    """Plan vectors (n, 2) turned into the roof's own axes, along and across."""
    return xy @ np.array([[np.cos(kappa), -np.sin(kappa)], [np.sin(kappa), np.cos(kappa)]])


def match_planes(
    method: str, kind: str, level: float, seed: int, roof: int
) -> tuple[int, int, bool]:
    """Return the numbers of true faces found and wrong planes, and success.

    Success is that exactly the true faces came out.
    """
    rng = np.random.default_rng([seed, roof, 88])
    building = random_building(rng, "hip")
    points = Trouble.of(kind, level).points(building, rng)
    if len(points) < 4:
        return 0, 0, False
    planes = detect_planes(points) if method == "ransac" else fit_planes(points)
    n_found, wrong = match_faces(planes, list_true_faces(building))
    return n_found, wrong, n_found == 4 and wrong == 0


def fit_planes(points: np.ndarray) -> list[DetectedPlane]:
    """Return the faces of the fitted hip as planes."""
    model = fit_model("likelihood", points, ("hip",))
    return [
        DetectedPlane(*fit_least_squares_plane(face), np.empty(0, int)) for face in model.polygons
    ]


def list_true_faces(building: SimBuilding) -> list[np.ndarray]:
    """Return the roof surfaces (m, 3) in world metres."""
    part = building.roof.parts[0]
    primitive = CATALOGUE[part.type]
    vertices = place_vertices(
        primitive.vertices(part.parameters),
        part.kappa,
        part.translation + building.roof.frame.origin,
    )
    return [vertices[list(face)] for face in primitive.faces]


def draw_picture(rows: list[tuple]):
    """Share of roofs with a closed and right model, a panel an axis."""
    from .charts import draw_curves

    panels = {}
    for kind in dict.fromkeys(row[0] for row in rows):
        panel_rows = [row for row in rows if row[0] == kind]
        levels = list(dict.fromkeys(row[1] for row in panel_rows))
        series = {
            m: [row[5] for row in panel_rows if row[2] == m] for m in ("ransac", "likelihood")
        }
        panels[kind] = (levels, series)
    return draw_curves(panels, "closed and right")
